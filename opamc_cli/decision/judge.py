"""Healthy, changed or at fault: from divergences between sessions to a state per joint."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.divergence.jensen_shannon import chance_divergence, jensen_shannon
from opamc_cli.decision.significance.median_deviation import MAD_TO_SIGMA
from opamc_cli.decision.significance.multiplicity import harmonic_mean, holm
from opamc_cli.decision.significance.permutation import relabelled_p_value, relabellings
from opamc_cli.decision.significance.spread import (
    BETWEEN_SESSIONS,
    Spread,
    moderated_spread,
    spliced_p_value,
    spread_among_siblings,
    tail_of_one_influence,
    upper_tail,
)
from opamc_cli.decision.witnesses.evidence import (
    LEAST_RATIO,
    Evidence,
    SessionDistances,
    pooled_together,
    session_distances,
    weigh_together,
)
from opamc_cli.decision.witnesses.patterns import Cell, PatternEvidence, pooled_divergence

FloatArray = NDArray[np.float64]
State = Literal["healthy", "changed", "fault", "insufficient-data"]
Method = Literal["sessions", "relabelled-sessions", "one-session", "none"]

HEALTHY_SHIFT_BITS = 0.0075
"""Divergence between two healthy sessions where only one is known.

Geometric mean of Δμ of the thesis's healthy joints before and after reassembly, order 4, Tables
5-3 and 5-6: 5.2, 10.1, 14.7, 8.6, 4.8 and 5.3 times 1e-3. Those of order 5 are larger because the
thesis holds its baseline, not its target, against a pool that contains it; that bias is gone here.
"""

HEALTHY_SHIFT_SPREAD = Spread(0.36, 5.0)
"""Spread of the logarithms of those six numbers and of order 5's six (24, 32, 35, 29, 20, 22 times
1e-3, Tables 5-4 and 5-7), each order about its own mean. Both orders are of the same six joints,
so that they are worth five degrees of freedom and not ten."""

MAD_EFFICIENCY = 0.37
"""Share of the values that a median absolute deviation is worth (Huber, 1981)."""

CYCLES_DIFFER = 0.05
"""Level at which cycles of baseline and target count as different where one session is known."""


PATTERNS = "patterns"
"""Name of the witness that every axis has."""


@dataclass(frozen=True)
class Bundle:
    """All that is known of one axis."""

    cells: Sequence[Cell]
    """Its pattern counts, which also say what sessions and cycles there are."""
    witnesses: Mapping[str, Evidence] = field(default_factory=dict)
    """What else tells its sessions apart, by name."""

    def evidence(self) -> dict[str, Evidence]:
        """Return all that the sessions can be told apart by: the patterns first."""
        kinds: dict[str, Evidence] = {PATTERNS: PatternEvidence(self.cells)}
        # Two sessions show no spread, and the one that stands in for it is that of divergences.
        if self.cells and len(self.cells[0].baseline) > 2:
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
class Shift:
    """How far the target lies from the baseline."""

    log_ratio: float
    """Log of the target's distance over that of a healthy session."""
    unit: float
    """Standard deviation of a healthy session's log distance."""
    spread: Spread
    """Standard deviation of `log_ratio` if nothing has changed."""


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
    """As `p_adjusted`, after what the siblings have in common is taken off."""
    common_log_ratio: float
    """What was taken off, not negative."""
    distance_ratio: float
    """Target's distance from the baseline over that of a healthy session."""
    effects: Mapping[str, float]
    """Relative change beyond the baseline's own by each witness; NaN where it knows none."""
    witnesses: Mapping[str, float]
    """p-value by each witness alone, not corrected for the number of joints."""
    method: Method
    """sessions, relabelled-sessions, one-session or none."""
    n_baseline_sessions: int
    n_target_sessions: int
    n_baseline_cycles: int
    n_target_cycles: int
    """With `n_baseline_sessions`, `n_target_sessions`, `n_baseline_cycles`: what it rests on."""

    @property
    def effect(self) -> float:
        """The largest of the relative changes; NaN if none is known."""
        return float(np.fmax.reduce(list(self.effects.values()), initial=math.nan))


def judge(bundles: Mapping[int, Bundle], policy: Policy = Policy()) -> dict[int, Judgement]:
    """Decide about every joint of a diagnosis.

    Parameters
    ----------
    bundles : mapping of int to Bundle
        What is known of each axis; one without cells has insufficient data.
    policy : Policy
        Levels and limits.

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
    evidence = {
        axis: bundles[axis].evidence()
        for axis in axes
        if methods[axis] in ("sessions", "relabelled-sessions")
    }
    each = {
        axis: {
            name: session_distances(kind, len(cells[axis][0].baseline), len(cells[axis][0].target))
            for name, kind in kinds.items()
        }
        for axis, kinds in evidence.items()
    }
    lone = {
        axis: one_session_log_ratio(cells[axis]) for axis in axes if methods[axis] == "one-session"
    }
    pooled: dict[tuple[int, str], FloatArray] = {}
    ranking = {
        axis: {name: kind for name, kind in kinds.items() if kind.ranks}
        for axis, kinds in evidence.items()
    }
    weighed = weigh_together(
        {axis: {name: each[axis][name] for name in kinds} for axis, kinds in ranking.items()}
    )
    together = _Comparison(cells, methods, ranking, weighed, lone, policy, pooled)
    alone_by_witness = {
        name: _Comparison(
            cells,
            methods,
            {axis: {name: kinds[name]} for axis, kinds in evidence.items() if name in kinds},
            {axis: kinds[name] for axis, kinds in each.items() if name in kinds},
            {},
            policy,
            pooled,
        )
        for name in dict.fromkeys([PATTERNS, *(n for kinds in evidence.values() for n in kinds)])
    }
    witnesses = {
        axis: {name: one.p_value(axis) for name, one in alone_by_witness.items()}
        for axis in axes
        if axis in evidence
    }
    p_values, p_alone, shifts, common = {}, {}, {}, {}
    for axis in axes:
        heard = together
        step, own = together.lowest_step(axis), witnesses.get(axis, {})
        asked = sum(math.isfinite(p) for p in own.values())
        ranked = [own[name] for name in ranking.get(axis, {})]
        p_values[axis] = _beyond_ranks(together.p_value(axis), step, ranked)
        for name, kind in evidence.get(axis, {}).items():
            sure = asked * own[name]
            if not kind.ranks and sure < min(p_values[axis], policy.false_alarm_rate):
                heard, p_values[axis] = alone_by_witness[name], sure
        shifts[axis] = heard.shifts.get(axis, Shift(math.nan, math.nan, BETWEEN_SESSIONS))
        # who speaks for itself has to be odd among all siblings, not only among most
        others = common_log_ratio(heard.shifts, axis, largest=heard is not together)
        common[axis] = others if axis in evidence else 0.0
        p_alone[axis] = p_values[axis]
        if common[axis]:
            p_alone[axis] = max(p_values[axis], heard.p_value(axis, common[axis]))
    witnesses |= {axis: {PATTERNS: p_values[axis]} for axis in axes if axis not in evidence}
    adjusted = dict(zip(axes, holm([p_values[axis] for axis in axes]).tolist(), strict=True))
    alone = dict(zip(axes, holm([p_alone[axis] for axis in axes]).tolist(), strict=True))
    judgements = {}
    for axis in axes:
        known = methods[axis] != "none"
        every = {PATTERNS: PatternEvidence(cells[axis]), **bundles[axis].witnesses}
        effects = {name: kind.effect() if known else math.nan for name, kind in every.items()}
        judgement = Judgement(
            state="healthy",
            health_index=_health_index(shifts[axis]),
            p_value=p_values[axis],
            p_adjusted=adjusted[axis],
            p_alone=alone[axis],
            common_log_ratio=common[axis],
            distance_ratio=math.exp(min(shifts[axis].log_ratio, 100.0)),
            effects=effects,
            witnesses=witnesses[axis],
            method=methods[axis],
            n_baseline_sessions=_present(cells[axis], "baseline"),
            n_target_sessions=_present(cells[axis], "target"),
            n_baseline_cycles=max((len(cell.cycles) for cell in cells[axis]), default=0),
            n_target_cycles=max((len(cell.target_cycles) for cell in cells[axis]), default=0),
        )
        judgements[axis] = replace(judgement, state=_state(judgement, policy))
    return judgements


def _beyond_ranks(p_value: float, step: float, ranked: Sequence[float]) -> float:
    """Say how improbable a shift is that exceeds all healthy ones.

    Ranks say no more of it than the lowest step. The soft maximum has a longer tail than its parts
    have, which a Student tail does not know: below the step it is the harmonic mean of the p-values
    by those that rank.
    """
    known = [p for p in ranked if math.isfinite(p)]
    if len(known) < 2 or not p_value <= step:
        return p_value
    return min(step, harmonic_mean(known))


class _Comparison:
    """The joints of a diagnosis as some of the witnesses see them."""

    def __init__(
        self,
        cells: Mapping[int, Sequence[Cell]],
        methods: Mapping[int, Method],
        evidence: Mapping[int, Mapping[str, Evidence]],
        distances: Mapping[int, SessionDistances],
        lone: Mapping[int, float],
        policy: Policy,
        pooled: dict[tuple[int, str], FloatArray],
    ) -> None:
        self._logs = pooled
        self._cells = cells
        self._methods = methods
        self._evidence = evidence
        self._policy = policy
        # a witness that lacks a session has nothing to say by itself
        self._distances = {axis: one for axis, one in distances.items() if one.known}
        self._pooled: dict[int, FloatArray] = {}
        self._by_cycles: dict[int, float] = {}
        self.shifts = _session_shifts(self._distances)
        self.shifts |= {axis: one_session_shift(lone, axis) for axis in lone}

    def p_value(self, axis: int, taken_off: float = 0.0) -> float:
        """Probability of such a shift, after some of it is taken off; NaN if unknown."""
        if axis not in self.shifts:
            return math.nan
        shift = self.shifts[axis]
        cells = self._cells[axis]
        ranks = all(kind.ranks for kind in self._evidence.get(axis, {}).values())
        if ranks:
            tail = upper_tail(shift.log_ratio - taken_off, shift.spread)
        else:
            dof = len(self._distances[axis].own) - 1
            tail = tail_of_one_influence(shift.log_ratio - taken_off, dof)
        if self._methods[axis] == "sessions":
            if not ranks:
                return tail
            one = self._distances[axis]
            # Of three sessions the odd one is half of what each other one is compared with: then
            # pairs place them better, who leave it out.
            gaps = one.each[-1] - one.each[:-1] if len(one.own) > 2 else one.target[:, 0] - one.own
            place = shift.log_ratio - gaps
            above = int((one.each[:-1] >= one.each[-1] - taken_off).sum())
            return spliced_p_value(place, shift.log_ratio - taken_off, shift.spread, above)
        if self._methods[axis] == "one-session":
            # What exchanging cycles cannot tell from chance is no change, however large it looks.
            # Beyond that the cycles say nothing: they cannot know how much sessions differ.
            if axis not in self._by_cycles:
                self._by_cycles[axis] = _cycle_p_value(cells, self._policy)
            by_cycles = self._by_cycles[axis]
            return tail if by_cycles <= CYCLES_DIFFER else max(tail, by_cycles)
        n_baseline, n_target = len(cells[0].baseline), len(cells[0].target)
        if axis not in self._pooled:
            self._pooled[axis] = pooled_together(
                [self._log_pooled(axis, name) for name in self._evidence[axis]]
            )
        values = self._pooled[axis].copy()
        values[0] *= math.exp(-taken_off)
        values = values[np.isfinite(values)]
        relabelled = relabelled_p_value(values, n_baseline + n_target)
        # Half-changed labellings fatten the tail of a gross change. Where none exceeds the
        # observed one, the pairs' own tail may go below it, doubled for the second look.
        return min(relabelled, 2 * tail) if (values[1:] < values[0]).all() else relabelled

    def lowest_step(self, axis: int) -> float:
        """Smallest p-value that ranks alone can give; 0 where they give none."""
        if axis not in self._evidence:
            return 0.0
        n_baseline, n_target = len(self._cells[axis][0].baseline), len(self._cells[axis][0].target)
        if self._methods[axis] == "sessions":
            return 1 / (n_baseline + 1)
        return 1 / len(
            relabellings(n_baseline, n_target, self._policy.permutations, self._policy.seed)
        )

    def _log_pooled(self, axis: int, name: str) -> FloatArray:
        """Log distance between the groups under every labelling, computed once a witness."""
        if (axis, name) not in self._logs:
            cells = self._cells[axis]
            labels = relabellings(
                len(cells[0].baseline),
                len(cells[0].target),
                self._policy.permutations,
                self._policy.seed,
            )
            distances = self._evidence[axis][name].pooled(labels)
            self._logs[axis, name] = np.log(np.maximum(distances, LEAST_RATIO))
        return self._logs[axis, name]


def one_session_log_ratio(cells: Sequence[Cell]) -> float:
    """Log of the target's divergence over what healthy sessions are allowed.

    Parameters
    ----------
    cells : sequence of Cell
        Motions and orders of an axis with a single baseline session.

    Returns
    -------
    float
        0 if the divergence equals chance plus `HEALTHY_SHIFT_BITS`.
    """
    ratios = []
    for cell in cells:
        pool = cell.baseline.sum(axis=0)
        sessions = cell.target[cell.target.sum(axis=1) > 0]
        if pool.sum() == 0 or not len(sessions):
            continue
        n = sessions.sum(axis=1) / cell.inflation
        chance = chance_divergence(pool, n, pool.sum() / cell.inflation)
        ratio = jensen_shannon(sessions, pool) / (chance + HEALTHY_SHIFT_BITS)
        ratios.append(float(np.mean(ratio)))
    return math.log(max(float(np.mean(ratios)), 1e-6)) if ratios else math.nan


def one_session_shift(log_ratios: Mapping[int, float], axis: int) -> Shift:
    """Place a joint among its siblings where the variation between sessions is unknown.

    Parameters
    ----------
    log_ratios : mapping of int to float
        `one_session_log_ratio` of each joint.
    axis : int
        The joint in question.

    Returns
    -------
    Shift
        Relative to the median of the siblings and of published healthy joints, with a spread
        blended from both.

    Notes
    -----
    The siblings went through the same two sessions and most of them are healthy: what they show
    is the variation between sessions. Median and median absolute deviation let less than half of
    them be at fault.
    """
    others = [value for key, value in log_ratios.items() if key != axis and math.isfinite(value)]
    prior = HEALTHY_SHIFT_SPREAD
    if len(others) < 2:
        scale = prior.scale * math.sqrt(1 + 1 / (prior.dof + 1))
        return Shift(log_ratios[axis], prior.scale, Spread(scale, prior.dof))
    values = np.array([0.0, *others])
    centre = float(np.median(values))
    deviation = MAD_TO_SIGMA * float(np.median(np.abs(values - centre)))
    blended = moderated_spread(deviation**2, MAD_EFFICIENCY * len(others), prior)
    scale = blended.scale * math.sqrt(1 + 1 / len(values))
    return Shift(log_ratios[axis] - centre, blended.scale, Spread(scale, blended.dof))


def common_log_ratio(shifts: Mapping[int, Shift], axis: int, *, largest: bool = False) -> float:
    """Shift that the siblings of a joint have in common.

    Parameters
    ----------
    shifts : mapping of int to Shift
        All joints of the session.
    axis : int
        The joint in question.
    largest : bool
        The largest of the siblings' shifts instead of their median, as a log ratio.

    Returns
    -------
    float
        Median over the siblings, the lower one of an even number, as a log ratio, or in units of
        each joint's own spread if that is more; 0 if negative, with fewer than two siblings, or
        if the joint itself was not compared.
    """
    others = [shift for key, shift in shifts.items() if key != axis]
    if axis not in shifts or len(others) < 2:
        return 0.0
    if largest:
        return max(0.0, *(shift.log_ratio for shift in others))
    # of two siblings the one that moved less: else one that fails would excuse the others
    plain = float(np.quantile([shift.log_ratio for shift in others], 0.5, method="lower"))
    moved = [shift.log_ratio / shift.spread.scale for shift in others]
    scaled = float(np.quantile(moved, 0.5, method="lower"))
    return max(0.0, plain, scaled * shifts[axis].spread.scale)


def _session_shifts(distances: Mapping[int, SessionDistances]) -> dict[int, Shift]:
    variances = {
        axis: float(one.own.var(ddof=1)) if len(one.own) > 2 else math.nan
        for axis, one in distances.items()
    }
    ratios = {
        axis: float(np.mean(one.target) - np.mean(one.own)) for axis, one in distances.items()
    }
    shares = {axis: 1 / len(one.own) + 1 / one.target.shape[1] for axis, one in distances.items()}
    shifts = {}
    for axis, one in distances.items():
        siblings = [key for key in distances if key != axis]
        if len(one.own) > 2:
            others = [variances[key] for key in siblings]
            unit = spread_among_siblings(variances[axis], others, len(one.own) - 1)
        else:
            # Two sessions have the same divergence from each other: no spread can be had from
            # them. What the target's session did to the siblings stands in for it.
            moved = np.array([ratios[key] / math.sqrt(shares[key]) for key in siblings])
            unit = BETWEEN_SESSIONS
            if len(moved) > 1:
                deviation = MAD_TO_SIGMA * float(np.median(np.abs(moved)))
                unit = moderated_spread(deviation**2, MAD_EFFICIENCY * len(moved), unit)
        scale = unit.scale * math.sqrt(shares[axis])
        shifts[axis] = Shift(ratios[axis], unit.scale, Spread(scale, unit.dof))
    return shifts


def _cycle_p_value(cells: Sequence[Cell], policy: Policy) -> float:
    """Exchange cycles between baseline and target; 0 if there are too few to show anything."""
    n_baseline = max(len(cell.cycles) for cell in cells)
    n_target = max(len(cell.target_cycles) for cell in cells)
    by_cycle = [
        cell.with_units(cell.cycles, cell.target_cycles)
        for cell in cells
        if len(cell.cycles) == n_baseline and len(cell.target_cycles) == n_target
    ]
    labels = relabellings(n_baseline, n_target, policy.permutations, policy.seed)
    if not by_cycle or len(labels) * CYCLES_DIFFER < 1:
        return 0.0
    return relabelled_p_value(pooled_divergence(by_cycle, labels), n_baseline + n_target)


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
        return "healthy"
    return "fault" if judgement.effect >= policy.fault_effect else "changed"
