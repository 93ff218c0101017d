"""The joints of a diagnosis side by side: how improbable each one's distances are."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.significance.median_deviation import MAD_TO_SIGMA
from opamc_cli.decision.significance.multiplicity import harmonic_mean
from opamc_cli.decision.significance.permutation import relabelled_p_value, relabellings
from opamc_cli.decision.significance.spread import (
    BETWEEN_SESSIONS,
    Spread,
    moderated_spread,
    spliced_p_value,
    spread_among_siblings,
    tail_of_influences,
    upper_tail,
)
from opamc_cli.decision.witnesses.departure import influences
from opamc_cli.decision.witnesses.evidence import (
    Evidence,
    Kind,
    SessionDistances,
    labelled_distances,
    session_distances,
    soft_maximum,
)

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Voice = tuple[str, Kind]
"""A witness and one of its two distances."""

ALONG_SPREAD = Spread(1.3, 8.0)
"""Expected of a healthy session's log distance along: of one influence's square it is 2.2, of four
1.0; 1.0 to 1.7 in the middle of joints of three simulators."""

CONDITIONS = 2.0
"""Spreads by which patterns may lie further beyond for each e-fold of a session's distance along.

Patterns are not linear in what moves them: of 200 healthy nights four standard deviations warmer or
colder than the others (5600 to 5649) 73 alarm without it, 24 with it. Spectra and
courses need none.
"""

FOREIGN_CONDITIONS = 1.0
"""Spreads by which every distance beyond may lie further out for each e-fold by which the siblings
lie further along than healthy sessions do: joints bend by different amounts. In a hall that warms
by 14 and cools by 10 degrees (docs/decision.md) 4 % of healthy joint-nights are called changed
without it, 1.1, 0.2, 0 and 0 % with 0.25, 0.5, 1 and 2; a joint's own fault does not move it."""

MAD_EFFICIENCY = 0.37
"""Share of the values that a median absolute deviation is worth (Huber, 1981)."""

FAR_OUT = Spread(1.0, BETWEEN_SESSIONS.dof)
"""Of places by all voices together above their median: one voice may carry them there."""

LEAST_SCALE = 0.01
"""Distances that agree to a percent agree: none weighs infinitely."""


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
class Compared:
    """One joint's place among healthy sessions."""

    shift: Shift
    """By all voices together."""
    p_value: float
    """Probability of at least such distances if the joint is healthy; NaN if unknown."""
    p_alone: float
    """The same after what the siblings have in common is taken off."""
    common_log_ratio: float
    """What they have in common, not negative."""
    witnesses: Mapping[str, float]
    """p-value by each witness alone."""
    unusual_log_ratio: float = 0.0
    """Log of how many times further the target lies along what sessions differ by than a healthy
    one: what it has beyond is allowed for by as much."""
    allowed_log_ratio: float = 0.0
    """What was taken off: what the siblings have in common, and what conditions as unusual as
    theirs may move one joint by."""
    apart: tuple[float, ...] = ()
    """How far each baseline session lies from the others, beyond the middle one, by the voice that
    places it farthest; in spreads that are expected of healthy ones."""


def compare_sessions(
    evidence: Mapping[int, Mapping[str, Evidence]],
    sessions: Mapping[int, tuple[int, int]],
    permutations: int,
    seed: int,
) -> dict[int, Compared]:
    """Say of each joint how improbable its target is.

    Parameters
    ----------
    evidence : mapping of int to mapping of str to Evidence
        By axis and witness; the first witness of an axis is the one that every axis has.
    sessions : mapping of int to (int, int)
        Numbers of baseline (two at least) and target sessions of each axis.
    permutations, seed : int
        Most relabellings evaluated, and the seed of the draw if there are more.

    Returns
    -------
    dict of int to Compared

    Notes
    -----
    A witness's distance beyond what healthy sessions differ by is judged by the Student tail of its
    logarithm, its distance along by the F tail of as many influences as the baseline shows. The
    p-values are combined by their harmonic mean (D. J. Wilson, 2019). Where a single target is
    exceeded by a healthy session its rank decides; with several targets whole sessions are
    exchanged.
    """
    joints = {axis: Joint(kinds, *sessions[axis]) for axis, kinds in evidence.items()}
    shifts: dict[Voice, dict[int, Shift]] = {}
    for voice in dict.fromkeys(voice for joint in joints.values() for voice in joint.voices):
        own = {axis: joint for axis, joint in joints.items() if voice in joint.voices}
        shifts[voice] = _shifts(own, voice)
    scales = scales_of(joints.values())
    unusual = {axis: joint.unusual() for axis, joint in joints.items()}
    found = {}
    for axis, joint in joints.items():
        own_shifts = {voice: shifts[voice][axis] for voice in joint.voices}
        labels = relabellings(*sessions[axis], permutations, seed)
        foreign = FOREIGN_CONDITIONS * of_siblings(unusual, axis)
        shared = {
            voice: common_log_ratio(shifts[voice], axis, largest=voice[1] == "score")
            for voice in joint.voices
        }
        taken_off = {
            voice: shared[voice]
            + (foreign * own_shifts[voice].spread.scale if voice[1] == "orthogonal" else 0.0)
            for voice in joint.voices
        }
        tails = joint.tails(own_shifts, {})
        p_value = joint.p_value(own_shifts, {}, scales, labels)
        p_alone = p_value
        if any(taken_off.values()):
            p_alone = max(p_value, joint.p_value(own_shifts, taken_off, scales, labels))
        together = joint.together(own_shifts, {})
        common, allowed = (
            max(together.log_ratio - joint.together(own_shifts, off).log_ratio, 0.0)
            for off in (shared, taken_off)
        )
        found[axis] = Compared(
            shift=together,
            p_value=p_value,
            p_alone=p_alone,
            common_log_ratio=common,
            witnesses={
                name: joint.combined({v: p for v, p in tails.items() if v[0] == name})
                for name in evidence[axis]
            },
            unusual_log_ratio=unusual[axis],
            allowed_log_ratio=allowed,
            apart=joint.apart(),
        )
    return found


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
        Median over the siblings, the lower one of an even number, as a log ratio; 0 if negative,
        with fewer than two siblings, or if the joint itself was not compared.
    """
    others = [shift for key, shift in shifts.items() if key != axis]
    if axis not in shifts or len(others) < 2:
        return 0.0
    if largest:
        return max(0.0, *(shift.log_ratio for shift in others))
    # of two siblings the one that moved less: else one that fails would excuse the others
    return of_siblings({key: shift.log_ratio for key, shift in shifts.items()}, axis)


def of_siblings(values: Mapping[int, float], axis: int) -> float:
    """Return the siblings' median, the lower one of an even number; 0 if negative, or of one."""
    others = [value for key, value in values.items() if key != axis]
    return max(0.0, float(np.quantile(others, 0.5, method="lower"))) if len(others) > 1 else 0.0


class Joint:
    """One axis's voices, those that lack a session left out."""

    def __init__(self, evidence: Mapping[str, Evidence], n_baseline: int, n_target: int) -> None:
        self.n_baseline, self.n_target = n_baseline, n_target
        self._evidence = evidence
        found = {
            name: session_distances(one, n_baseline, n_target) for name, one in evidence.items()
        }
        self.distances = {
            (name, kind): found[name][kind]
            for name, one in evidence.items()
            for kind in one.kinds
            if found[name][kind].known
        }
        self.voices = list(self.distances)
        self._influences = {
            name: influences(one.blocks(), np.arange(n_baseline))
            for name, one in evidence.items()
            if (name, "score") in self.distances
        }
        self._conditions = next(
            (
                self.distances[name, "score"]
                for name, one in evidence.items()
                if one.tells_conditions and (name, "score") in self.distances
            ),
            None,
        )
        self._labelled: dict[Voice, FloatArray] | None = None

    def expected(self, voice: Voice) -> Spread:
        """Return the spread of healthy log distances that is expected of a voice."""
        return self._evidence[voice[0]].healthy_spread if voice[1] == "orthogonal" else ALONG_SPREAD

    def weights(self, voices: Iterable[Voice]) -> list[float]:
        """Return how much each voice counts for."""
        return [self._evidence[name].weight for name, _ in voices]

    def combined(self, tails: Mapping[Voice, float]) -> float:
        """Combine the p-values of some voices; NaN without any."""
        return harmonic_mean(list(tails.values()), self.weights(tails)) if tails else math.nan

    def depends_on_conditions(self, voice: Voice) -> bool:
        """Whether unusual conditions move a voice by more than its own error allows for."""
        return voice[1] == "orthogonal" and self._evidence[voice[0]].depends_on_conditions

    def far_in(self) -> Spread:
        """Return the spread of places below their median.

        One voice can carry a soft maximum up, but all of them have to be low for it to be low:
        it is then their mean, and they hardly depend on each other.
        """
        weights = np.array(self.weights(self.voices))
        return Spread(float(np.linalg.norm(weights) / weights.sum()), math.inf)

    def unusual(self) -> float:
        """How much further along the target lies than a healthy session does, as a log ratio."""
        if self._conditions is None:
            return 0.0
        own = self._conditions.own - self._conditions.own.mean()
        target = self._conditions.target - self._conditions.own.mean()
        return float(np.maximum(target, 0.0).mean() - np.maximum(own, 0.0).mean())

    def apart(self) -> tuple[float, ...]:
        """How far each baseline session lies from the others; see `Compared`."""
        places = [
            (one.own - np.median(one.own)) / self.expected(voice).scale
            for voice, one in self.distances.items()
        ]
        return tuple(np.max(places, axis=0).tolist()) if places else ()

    def tails(
        self, shifts: Mapping[Voice, Shift], taken_off: Mapping[Voice, float]
    ) -> dict[Voice, float]:
        """Return the p-value by each voice, after some of its shift is taken off."""
        found = {}
        for voice in self.voices:
            left = shifts[voice].log_ratio - taken_off.get(voice, 0.0)
            if voice[1] == "orthogonal":
                found[voice] = upper_tail(left, shifts[voice].spread)
            else:
                dof = self._influences[voice[0]]
                found[voice] = tail_of_influences(left, dof, dof * (self.n_baseline - 1))
        return found

    def together(self, shifts: Mapping[Voice, Shift], taken_off: Mapping[Voice, float]) -> Shift:
        """Return one shift for all voices, in the harmonic mean of their units."""
        if not self.voices:
            return Shift(math.nan, math.nan, BETWEEN_SESSIONS)
        units = np.array([shifts[voice].unit for voice in self.voices])
        left = np.array([shifts[v].log_ratio - taken_off.get(v, 0.0) for v in self.voices])
        unit = float(1 / (1 / units).mean())
        ratio = unit * float(soft_maximum(left / units, self.weights(self.voices)))
        share = math.sqrt(1 / self.n_baseline + 1 / self.n_target)
        dof = min(shifts[voice].spread.dof for voice in self.voices)
        return Shift(ratio, unit, Spread(unit * share, dof))

    def p_value(
        self,
        shifts: Mapping[Voice, Shift],
        taken_off: Mapping[Voice, float],
        scales: Mapping[Voice, float],
        labels: BoolArray,
    ) -> float:
        """Probability of such distances, after some of them is taken off; NaN if unknown."""
        if not self.voices:
            return math.nan
        tail = self.combined(self.tails(shifts, taken_off))
        if self.n_target > 1:
            return self._p_by_exchange(tail, taken_off, labels)
        places = self.places(scales, taken_off)
        above = int((places[:-1] >= places[-1]).sum())
        gaps, place = places[:-1] - np.median(places), float(places[-1] - np.median(places))
        by_rank = spliced_p_value(gaps, place, FAR_OUT, above, self.far_in())
        # the first of all is in the lowest step; how deep in it, only the tails know
        half_step = 0.5 / len(places)
        return by_rank if above else min(max(by_rank, half_step), max(tail, 1e-300))

    def places(self, scales: Mapping[Voice, float], taken_off: Mapping[Voice, float]) -> FloatArray:
        """Place every session, the target last, by all voices; nothing knows which one it is."""
        rows = []
        unusual = 0.0
        if self._conditions is not None:
            each = self._conditions.each
            unusual = CONDITIONS * np.maximum(each - each.mean(), 0.0)
        for voice in self.voices:
            each = self.distances[voice].each.copy()
            middle = np.median(each)
            each[-1] -= taken_off.get(voice, 0.0)
            standard = (each - middle) / scales[voice]
            rows.append(standard - unusual if self.depends_on_conditions(voice) else standard)
        return soft_maximum(np.array(rows), self.weights(self.voices))

    def _p_by_exchange(
        self, tail: float, taken_off: Mapping[Voice, float], labels: BoolArray
    ) -> float:
        if self._labelled is None:
            by_witness = {
                name: labelled_distances(self._evidence[name], labels)
                for name in dict.fromkeys(name for name, _ in self.voices)
            }
            self._labelled = {
                (name, kind): getattr(by_witness[name], kind) for name, kind in self.voices
            }
        rows = {}
        for voice in self.voices:
            logs = self._labelled[voice].copy()
            if not np.isfinite(logs).all():
                continue
            scale = MAD_TO_SIGMA * float(np.median(np.abs(logs - np.median(logs))))
            middle = np.median(logs)
            logs[0] -= taken_off.get(voice, 0.0)
            rows[voice] = (logs - middle) / max(scale, LEAST_SCALE)
        if not rows:
            return 1.0
        joined = soft_maximum(np.array(list(rows.values())), self.weights(rows))
        values = np.exp(np.clip(joined, -300, 300))
        relabelled = relabelled_p_value(values, self.n_baseline + self.n_target)
        if (values[1:] >= values[0]).any():
            return relabelled
        # the first of all is in the lowest step; how deep in it, only the tails know
        return min(max(relabelled, 0.5 / len(labels)), max(tail, 1e-300))


def scales_of(joints: Iterable[Joint]) -> dict[Voice, float]:
    """Spread of all sessions' log distances, the target's among them, the same for all joints.

    By median absolute deviation: taken from the baseline alone, or by squares, it would tell which
    session is the target's.
    """
    each: dict[Voice, list[FloatArray]] = {}
    expected: dict[Voice, list[Spread]] = {}
    for joint in joints:
        for voice in joint.voices:
            each.setdefault(voice, []).append(joint.distances[voice].each)
            expected.setdefault(voice, []).append(joint.expected(voice))
    scales = {}
    for voice, own in each.items():
        deviations = [np.median(np.abs(one - np.median(one))) for one in own]
        dof = MAD_EFFICIENCY * sum(len(one) for one in own)
        variance = (MAD_TO_SIGMA * float(np.median(deviations))) ** 2
        usual = Spread(
            float(np.median([one.scale for one in expected[voice]])), expected[voice][0].dof
        )
        scales[voice] = moderated_spread(variance, dof, usual).scale
    return scales


def _shifts(joints: Mapping[int, Joint], voice: Voice) -> dict[int, Shift]:
    """Place the target of each joint by one voice."""
    distances = {axis: joint.distances[voice] for axis, joint in joints.items()}
    variances = {
        axis: float(one.own.var(ddof=1)) if len(one.own) > 2 else math.nan
        for axis, one in distances.items()
    }
    shares = {axis: 1 / len(one.own) + 1 / one.target.shape[1] for axis, one in distances.items()}
    shifts = {}
    for axis, one in distances.items():
        siblings = [key for key in distances if key != axis]
        if len(one.own) > 2:
            unit = spread_among_siblings(
                variances[axis],
                [variances[key] for key in siblings],
                len(one.own) - 1,
                joints[axis].expected(voice),
                # conditions bend what they move by each joint's own load
                alike=not joints[axis].depends_on_conditions(voice),
            )
        else:
            unit = _spread_by_siblings([distances[key] for key in siblings], shares[axis])
        ratio = one.log_ratio(voice[1])
        if joints[axis].depends_on_conditions(voice):
            ratio -= CONDITIONS * unit.scale * joints[axis].unusual()
        scale = unit.scale * math.sqrt(shares[axis])
        # The logarithm of a sum of squares has a light upper tail, which makes up for what the
        # scale is not known by: if not by three sessions, nor of what conditions bend, whose
        # spread differs tenfold from machine to machine (docs/decision.md).
        bent = joints[axis].depends_on_conditions(voice)
        dof = math.inf if len(one.own) > 3 and not bent else unit.dof
        shifts[axis] = Shift(ratio, unit.scale, Spread(scale, dof))
    return shifts


def _spread_by_siblings(siblings: Sequence[SessionDistances], share: float) -> Spread:
    """Spread where two sessions, which have one distance from each other, show none.

    What the target's session did to the siblings stands in for it.
    """
    if len(siblings) < 2:
        return BETWEEN_SESSIONS
    moved = np.array([one.log_ratio("orthogonal") / math.sqrt(share) for one in siblings])
    deviation = MAD_TO_SIGMA * float(np.median(np.abs(moved)))
    return moderated_spread(deviation**2, MAD_EFFICIENCY * len(moved), BETWEEN_SESSIONS)
