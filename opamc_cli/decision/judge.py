"""Healthy, changed or at fault: from divergences between sessions to a state per joint."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.comparison import Compared, Shift, compare_sessions
from opamc_cli.decision.one_session import compare_one_session, least_effect, one_session_log_ratio
from opamc_cli.decision.significance.multiplicity import holm
from opamc_cli.decision.significance.spread import BETWEEN_SESSIONS
from opamc_cli.decision.witnesses.evidence import Evidence, WitnessEvidence
from opamc_cli.decision.witnesses.patterns import Cell, PatternEvidence

FloatArray = NDArray[np.float64]

State = Literal["healthy", "changed", "fault", "insufficient-data"]

Method = Literal["sessions", "relabelled-sessions", "one-session", "cause", "none"]

FAR = 20.0
"""Health index beyond which nothing is called healthy because other joints have moved as far:
warmth, supply and load move all joints by a few of the baseline's own spreads; what moves them
by more (a wrong unit, another controller, a changed logger) hides any fault."""

HEARD_FROM = 3
"""Sessions of the baseline from which all witnesses are asked: fewer show no spread."""

UNKNOWN_CHANGE = 0.2
"""Relative change of the current's course or size from a baseline of one or two sessions, from
which a joint is not called healthy.

How much nights differ by it is not known then. Of pairs of healthy nights 1 of 250 robots of
another simulator has as much, none of 220 single joints, 5 of 150 fleets.
"""

PATTERNS = "patterns"
"""Name of the witness that every axis has."""


@dataclass(frozen=True)
class Bundle:
    """All that is known of one axis."""

    cells: Sequence[Cell]
    """Its pattern counts, which also say what sessions and cycles there are."""
    witnesses: Mapping[str, WitnessEvidence] = field(default_factory=dict)
    """What else tells its sessions apart, by name."""
    target_sessions: Sequence[str] = ()
    """Names of the target's sessions, in the order of the cells' rows."""
    baseline_sessions: tuple[str, ...] = ()
    """Names of the baseline's sessions, likewise."""

    def of_sessions(self, baseline: Sequence[int], target: Sequence[int]) -> "Bundle":
        """Return the same with some sessions, numbered baseline first, on either side."""
        n_target = len(self.cells[0].target) if self.cells else 0
        own, other = self.baseline_sessions, self.target_sessions
        names = [*(own or ("",) * self.n_baseline), *(other or ("",) * n_target)]
        own, other = (tuple(names[i] for i in side) for side in (baseline, target))
        return Bundle(
            [cell.of_sessions(baseline, target) for cell in self.cells],
            {name: one.of_sessions(baseline, target) for name, one in self.witnesses.items()},
            other,
            own,
        )

    def of_target(self, session: int) -> "Bundle":
        """Return the same with one of the target's sessions alone."""
        return self.of_targets([session])

    def of_targets(self, sessions: Sequence[int]) -> "Bundle":
        """Return the same with some of the target's sessions alone."""
        n = self.n_baseline
        return self.of_sessions(range(n), [n + session for session in sessions])

    def held_out(self, session: int) -> "Bundle":
        """Return one of the baseline's sessions as the target of the others."""
        return self.of_sessions([i for i in range(self.n_baseline) if i != session], [session])

    def without(self, names: Sequence[str]) -> "Bundle":
        """Return the same without some of the baseline's sessions."""
        n = self.n_baseline
        kept = [i for i in range(n) if self.baseline_sessions[i] not in names]
        return self.of_sessions(kept, range(n, n + len(self.cells[0].target)))

    @property
    def n_baseline(self) -> int:
        """Number of the baseline's sessions."""
        return len(self.cells[0].baseline) if self.cells else 0

    def evidence(self) -> dict[str, Evidence]:
        """Return all that the sessions can be told apart by: the patterns first."""
        kinds: dict[str, Evidence] = {PATTERNS: PatternEvidence(self.cells)}
        # Two sessions show no spread, and the one that stands in for it is that of divergences.
        if self.cells and len(self.cells[0].baseline) >= HEARD_FROM:
            kinds |= self.witnesses
        return kinds


@dataclass(frozen=True)
class Policy:
    """What it takes to call a joint changed or at fault."""

    false_alarm_rate: float = 0.01
    """Largest accepted probability of any false alarm over all joints of one diagnosis."""
    minimum_effect: float = 0.1
    """Least relative change of the pattern probabilities (Cohen's w), or of the size of the
    envelope's fluctuations, that matters."""
    fault_effect: float = 0.3
    """Relative change from which a change is called a fault."""
    permutations: int = 1000
    """Most relabellings evaluated."""
    seed: int = 0
    """Seed of the draw if there are more."""


@dataclass(frozen=True)
class Judgement:
    """The decision about one joint."""

    state: State
    """healthy, changed, fault or insufficient-data."""
    health_index: float
    """0 at the baseline's mean, in units of the baseline's own spread; larger is worse."""
    p_value: float
    """Probability of at least such a shift if the joint is healthy; NaN without data."""
    p_adjusted: float
    """Corrected for the number of joints (Holm)."""
    p_alone: float
    """As `p_adjusted`, after what the siblings tell of is taken off."""
    common_log_ratio: float
    """What they have in common, not negative."""
    allowed_log_ratio: float
    """What was taken off: that, and what conditions as unusual as theirs may move one joint by."""
    distance_ratio: float
    """Target's distance from the baseline over that of a healthy session."""
    effects: Mapping[str, float]
    """Relative change beyond the baseline's own by each witness; NaN where it knows none."""
    witnesses: Mapping[str, float]
    """p-value by each witness alone, not corrected for the number of joints."""
    method: Method
    """sessions, relabelled-sessions, one-session, none, or cause: what has changed in it tells."""
    unusual_log_ratio: float
    """Log of how unusual the target's conditions are, by its current's course; 0 if unknown."""
    unknown_change: float
    """Relative change of the current's course or size, where one or two baseline sessions do not
    tell how much healthy ones differ by it; else NaN."""
    least_effect: float
    """Relative change of the patterns that a single baseline session would have shown; else NaN."""
    n_baseline_sessions: int
    n_target_sessions: int
    n_baseline_cycles: int
    n_target_cycles: int
    """With `n_baseline_sessions`, `n_target_sessions`, `n_baseline_cycles`: what it rests on."""
    apart: tuple[float, ...] = ()
    """How far each baseline session lies from the others; see `comparison.Compared`."""

    @property
    def effect(self) -> float:
        """The largest of the relative changes; NaN if none is known.

        One whose own witness places the target within the nearer half of healthy sessions is
        chance, and counts only if all are.
        """
        known = self.effects.items()
        heard = [size for name, size in known if not self.witnesses.get(name, 0.0) > 0.5]
        return _largest(heard or list(self.effects.values()))


def judge(
    bundles: Mapping[int, Bundle], policy: Policy = Policy(), *, sized: bool = True
) -> dict[int, Judgement]:
    """Decide about every joint of a diagnosis.

    Parameters
    ----------
    bundles : mapping of int to Bundle
        What is known of each axis; one without cells has insufficient data.
    policy : Policy
        Levels and limits.
    sized : bool
        Whether the effects are wanted of joints, too, whose shift is not improbable: a sixth of the
        work, and no matter of their state.

    Returns
    -------
    dict of int to Judgement
        By axis, in ascending order.

    Notes
    -----
    A joint is unhealthy if three things hold: the shift is improbable for a healthy joint, after
    correction for the number of joints; it remains so after the shift that the siblings have in
    common is taken off; and it is large enough to matter by one witness at least.
    """
    axes = sorted(bundles)
    cells = {axis: bundles[axis].cells for axis in axes}
    methods = {axis: _method(cells[axis]) for axis in axes}
    many = [axis for axis in axes if methods[axis] in ("sessions", "relabelled-sessions")]
    compared = compare_sessions(
        {axis: bundles[axis].evidence() for axis in many},
        {axis: (len(cells[axis][0].baseline), len(cells[axis][0].target)) for axis in many},
        policy.permutations,
        policy.seed,
    )
    lone = {
        axis: one_session_log_ratio(cells[axis]) for axis in axes if methods[axis] == "one-session"
    }
    compared |= {
        axis: compare_one_session(cells[axis], lone, axis, policy.permutations, policy.seed)
        for axis in lone
    }
    unknown = Compared(Shift(math.nan, math.nan, BETWEEN_SESSIONS), math.nan, math.nan, 0.0, {})
    compared |= {axis: unknown for axis in axes if axis not in compared}
    p_values = {axis: one.p_value for axis, one in compared.items()}
    p_alone = {axis: one.p_alone for axis, one in compared.items()}
    witnesses = {axis: compared[axis].witnesses or {PATTERNS: p_values[axis]} for axis in axes}
    adjusted = dict(zip(axes, holm([p_values[axis] for axis in axes]).tolist(), strict=True))
    alone = dict(zip(axes, holm([p_alone[axis] for axis in axes]).tolist(), strict=True))
    judgements = {}
    for axis in axes:
        wanted = sized or max(adjusted[axis], alone[axis]) <= policy.false_alarm_rate
        known = wanted and methods[axis] != "none"
        every = {PATTERNS: PatternEvidence(cells[axis]), **bundles[axis].witnesses}
        effects = {name: kind.effect() if known else math.nan for name, kind in every.items()}
        judgement = Judgement(
            state="healthy",
            health_index=_health_index(compared[axis].shift),
            p_value=p_values[axis],
            p_adjusted=adjusted[axis],
            p_alone=alone[axis],
            common_log_ratio=compared[axis].common_log_ratio,
            allowed_log_ratio=compared[axis].allowed_log_ratio,
            distance_ratio=math.exp(min(compared[axis].shift.log_ratio, 100.0)),
            effects=effects,
            witnesses=witnesses[axis],
            method=methods[axis],
            unusual_log_ratio=compared[axis].unusual_log_ratio,
            unknown_change=(
                _largest([kind.change() for kind in bundles[axis].witnesses.values()])
                if 0 < _present(cells[axis], "baseline") < HEARD_FROM
                else math.nan
            ),
            least_effect=(
                least_effect(
                    cells[axis],
                    lone[axis] - compared[axis].shift.log_ratio,
                    compared[axis].shift.spread,
                    policy.false_alarm_rate / sum(map(math.isfinite, p_values.values())),
                )
                if axis in lone and math.isfinite(lone[axis])
                else math.nan
            ),
            n_baseline_sessions=_present(cells[axis], "baseline"),
            n_target_sessions=_present(cells[axis], "target"),
            n_baseline_cycles=max((len(cell.cycles) for cell in cells[axis]), default=0),
            n_target_cycles=max((len(cell.target_cycles) for cell in cells[axis]), default=0),
            apart=compared[axis].apart,
        )
        judgements[axis] = replace(judgement, state=_state(judgement, policy))
    return judgements


def one_of_many(judgement: Judgement, times: int, policy: Policy) -> Judgement:
    """Return what is left of a judgement that was chosen from so many (Bonferroni)."""
    adjusted, alone = min(1.0, times * judgement.p_adjusted), min(1.0, times * judgement.p_alone)
    left = replace(judgement, p_adjusted=adjusted, p_alone=alone)
    return replace(left, state=_state(left, policy))


def _largest(values: Sequence[float]) -> float:
    """Return the largest of those that are known; NaN without any."""
    return float(np.fmax.reduce(values, initial=math.nan))


def _method(cells: Sequence[Cell]) -> Method:
    n_baseline, n_target = _present(cells, "baseline"), _present(cells, "target")
    n_cycles = max((len(cell.cycles) for cell in cells), default=0)
    if not n_target or n_cycles < 2:
        return "none"
    if n_baseline == 1:
        return "one-session"
    return "sessions" if n_target == 1 else "relabelled-sessions"


def _present(cells: Sequence[Cell], side: Literal["baseline", "target"]) -> int:
    """Return in how many sessions of one side the axis moves at all."""
    counts = [getattr(cell, side).sum(axis=1) > 0 for cell in cells]
    return int(np.any(counts, axis=0).sum()) if counts else 0


def _health_index(shift: Shift) -> float:
    """Place a shift on a scale with 0 at a healthy session's mean and its spread as unit."""
    # The mean of a log-normal ratio lies above its median by half the variance of the logarithm.
    log_mean = shift.spread.scale**2 / 2
    return math.expm1(min(shift.log_ratio - log_mean, 100.0)) / shift.unit


def _state(judgement: Judgement, policy: Policy) -> State:
    if not math.isfinite(judgement.p_adjusted):
        return "insufficient-data"
    level = policy.false_alarm_rate
    improbable = judgement.p_adjusted <= level and judgement.p_alone <= level
    if not improbable or judgement.effect < policy.minimum_effect:
        return "insufficient-data" if judgement.unknown_change > UNKNOWN_CHANGE else "healthy"
    return "fault" if judgement.effect >= policy.fault_effect else "changed"
