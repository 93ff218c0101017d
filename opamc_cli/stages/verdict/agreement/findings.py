"""Why an axis of a run cannot be compared with the baseline, rule by rule."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from statistics import median_low

import numpy as np
import numpy.typing as npt

from opamc_cli.stages.verdict.agreement.measured import Measured

Floats = npt.NDArray[np.float64]

LARGEST_RATIO = 20.0
"""Of the current's size to the baseline's: a healthy joint's load, warmth and wear change it by
some tens of per cent, a seized gear by a few times, one that grinds by ten; wrong units by 1000
(mA) or by ten to thirty (per cent)."""

SCALED = 8.0
"""Likewise of a position or a speed (9.5 times are rpm), and of a current whose smallest changes
are of another size by the same factor: a fault that asks for so much more leaves its noise."""

ALL_SCALED = 2.0
"""Likewise where it is one factor for all axes of a recording: no payload, warmth or fault is."""

WITH_NOISE, AS_ONE = 1.2, 1.1
"""Likewise where the axes' noise is of another size by that factor, too, in the middle within a
tenth: a load and its friction leave the sensors' noise as it was."""

ROOT_MEAN_SQUARE = math.sqrt(2.0)
"""Of a sine its peak, which drives report as often."""

ALIKE, UNLIKE = 1.2, 1.5
"""Two joints are exchanged if every channel of each is within 20 % of the other's size in the
baseline and one is 50 % away from its own: no fault makes two joints each the other."""

LARGEST_IMBALANCE = 0.5
"""Of the phases' sum to the phases: 0 for a motor without neutral, 1.15 with one phase inverted,
0.82 with one dead; sensors of equal make leave some per cent."""

DEAD_SHARE = 0.1
"""Of the baseline's current in motion: noise alone is less than that (0.4 % in the samples)."""

TURNED = 0.2
"""Share of a current that has the sign of the speed: friction makes it positive, a load between
nothing and some of it; less tells no direction. So of a current vector that turns with it."""

REVERSING = 0.1
"""Share of the samples with the rarer sign, from which on a current that has none lost it."""

ONE_WAY = 0.5
"""Of a reported current's level its mean: from here on a load leads, whose direction no wear turns.
Where the current is as large as it was, and of the other sign, the log is."""

RETURNING = 0.1
"""Share of the way in the rarer direction, from which on a joint moves both ways: one that moves
one way alone has a current of one sign, and leans as its load does."""

CLIPPED_SHARE = 0.01
"""Of the samples, beyond the baseline's: from here the clipped crests are patterns of their own."""

MISSING_SHARE = 0.05
"""Of the samples: from here every fourth pattern of five samples touches one that is no number."""

FINE, COARSER = 0.5, 3.0
"""A current changes with nearly each sample where its steps are finer than its noise. One that
then changes in less than a third as many is logged in coarser steps, or each value several times:
no fault takes a joint's noise away. One that changes in more may knock."""

ONE_STEP, OTHER_STEP, TIED = 1.5, 2.0, 0.85
"""A current comes in steps where the smallest of its changes are within 1.5 of each other (five
times apart without). They are others than the baseline's where they are twice as large or as small,
and matter where the coarser ones leave less than 85 % as many samples that differ from the one
before: a healthy joint in steps of half its noise was at fault at 80 %, and healthy at 90 %."""


@dataclass(frozen=True)
class Finding:
    """Why one axis of one run is not compared."""

    run: str
    axis: int
    why: str
    """A clause such as "axis3_b keeps one value"."""
    at_rest: bool = False
    """Whether it is no more than that the axis rests, as most do where axes move in turn."""
    of_log: bool = False
    """Whether another logger or map does it, which reach further than one joint's sensor."""


@dataclass(frozen=True)
class Reference:
    """What the baseline's runs have in common, by axis."""

    signal: Mapping[int, tuple[str, ...]]
    size: Mapping[tuple[int, str], float]
    imbalance: Mapping[int, float]
    clipped: Mapping[int, float]
    leaning: Mapping[int, float]
    reversing: Mapping[int, float]
    level: Mapping[int, float]
    one_way: Mapping[int, float]
    returning: Mapping[int, float]
    turning: Mapping[int, float]
    changing: Mapping[int, float]
    noise: Mapping[int, float]
    steps: Mapping[int, tuple[float, float]]


def reference_of(baseline: Sequence[Measured]) -> Reference:
    """Take the most frequent signal and the middle of sizes, imbalances and clipping."""
    by_axis: dict[int, list[Measured]] = {}
    for own in baseline:
        if own.moves:
            by_axis.setdefault(own.axis, []).append(own)
    return Reference(
        {
            axis: Counter(own.signal for own in runs).most_common(1)[0][0]
            for axis, runs in by_axis.items()
        },
        {
            (axis, kind): median_low([own.size[kind] for own in runs if kind in own.size])
            for axis, runs in by_axis.items()
            for kind in sorted({kind for own in runs for kind in own.size})
        },
        {axis: _middle([own.imbalance for own in runs]) for axis, runs in by_axis.items()},
        {axis: _middle([_most_clipped(own)[1] for own in runs]) for axis, runs in by_axis.items()},
        {axis: _middle([own.leaning for own in runs]) for axis, runs in by_axis.items()},
        {axis: _middle([own.reversing for own in runs]) for axis, runs in by_axis.items()},
        {axis: _middle([own.level for own in runs]) for axis, runs in by_axis.items()},
        {axis: _middle([own.one_way for own in runs]) for axis, runs in by_axis.items()},
        {axis: _middle([own.returning for own in runs]) for axis, runs in by_axis.items()},
        {axis: _middle([own.turning for own in runs]) for axis, runs in by_axis.items()},
        {axis: _middle([own.changing for own in runs]) for axis, runs in by_axis.items()},
        {axis: _middle([own.noise for own in runs]) for axis, runs in by_axis.items()},
        {axis: sorted(own.steps for own in runs)[len(runs) // 2] for axis, runs in by_axis.items()},
    )


def findings(measured: Sequence[Measured], reference: Reference) -> list[Finding]:
    """Return what forbids the comparison of an axis of a run with the baseline.

    Joints that are exchanged first: the signs and sizes of each are wrong besides. Else the first
    rule that applies names the reason.
    """
    known = [own for own in measured if own.axis in reference.signal]
    found = _exchanged([own for own in known if own.moves], reference)
    found += _all_scaled([own for own in known if own.moves], reference)
    told = {(finding.run, finding.axis) for finding in found}
    for own in known:
        if (own.run, own.axis) in told:
            continue
        rules = RULES if own.moves else RULES_AT_REST
        told_by = ((why, rule in OF_LOG) for rule in rules if (why := rule(own, reference)))
        why, of_log = next(told_by, (None, False))
        if why is not None:
            found.append(Finding(own.run, own.axis, why, of_log=of_log))
        elif not own.moves:
            found.append(Finding(own.run, own.axis, _still(own, reference), at_rest=True))
    told = {(finding.run, finding.axis) for finding in found}
    rest = [own for own in known if own.moves and (own.run, own.axis) not in told]
    return found + _all_filtered(rest, reference)


def _exchanged(measured: Sequence[Measured], reference: Reference) -> list[Finding]:
    """Find pairs of joints of a run whose sizes, or currents' sizes, are each the other's."""
    found = []
    for one, other in combinations(measured, 2):
        if one.run != other.run:
            continue
        for kinds, what in ((one.size.keys(), "axes"), (("current",), "the currents of axes")):
            own = min(_away(each, each.axis, reference, kinds) for each in (one, other))
            across = max(
                _away(one, other.axis, reference, kinds), _away(other, one.axis, reference, kinds)
            )
            if across <= math.log(ALIKE) and own >= math.log(UNLIKE):
                why = (
                    f"{what} {one.axis} and {other.axis} each look like the other: are the two "
                    "exchanged?"
                )
                found += [Finding(each.run, each.axis, why, of_log=True) for each in (one, other)]
                break
    return found


def _all_scaled(measured: Sequence[Measured], reference: Reference) -> list[Finding]:
    """Find recordings of two axes or more whose currents are all of one other size."""
    found = []
    for run in sorted({own.run for own in measured}):
        axes = [own for own in measured if own.run == run and own.size["current"] > 0]
        usual = [reference.size.get((own.axis, "current"), 0.0) for own in axes]
        if len(axes) < 2 or min(usual) <= 0:
            continue
        times = np.array([own.size["current"] for own in axes]) / usual
        middle = float(np.median(times))
        noise, least = "", ALL_SCALED
        if _noise_scaled(axes, times, reference):
            noise, least = ", and their noise,", WITH_NOISE
        if times.max() > ALIKE * times.min() or abs(math.log(middle)) < math.log(least):
            continue
        peaks = abs(abs(math.log(middle)) - math.log(ROOT_MEAN_SQUARE)) <= math.log(AS_ONE) / 2
        unit = "root mean square for peak" if peaks else "mA for A"
        why = (
            f"the currents of all its axes{noise} are {middle:.3g} times the baseline's: "
            f"another unit ({unit})? Check the map of `opamc ingest`, and the sensors"
        )
        found += [Finding(run, own.axis, why) for own in axes]
    return found


def _noise_scaled(axes: Sequence[Measured], times: Floats, reference: Reference) -> bool:
    """Whether the noise of all axes is of another size by the one factor of their currents."""
    noise = np.array([own.noise for own in axes])
    usual = np.array([reference.noise[own.axis] for own in axes])
    if min(*noise, *usual) <= 0:
        return False
    middle = np.median(times)
    sizes, noises = (np.abs(np.log(one / middle)) for one in (times, noise / usual))
    # of a current in steps the noise is known to some per cent alone
    as_noisy = np.median(noises) <= math.log(AS_ONE) and noises.max() <= math.log(ALIKE)
    return bool(sizes.max() <= math.log(AS_ONE) and as_noisy)


def _all_filtered(measured: Sequence[Measured], reference: Reference) -> list[Finding]:
    """Find recordings of two axes or more all of whose currents are smoother, or all noisier."""
    found = []
    for run in sorted({own.run for own in measured}):
        axes = [own for own in measured if own.run == run]
        usual = np.array([reference.noise[own.axis] for own in axes])
        noise = np.array([own.noise for own in axes])
        if len(axes) < 2 or min(*usual, *noise) <= 0:
            continue
        times = noise / usual
        if times.min() < ALL_SCALED and times.max() > 1 / ALL_SCALED:
            continue
        why = (
            f"what the currents of all its axes change by from sample to sample is "
            f"{np.median(times):.2g} times the baseline's: another filter in drive or log, or "
            "another noise, which no joint's fault is"
        )
        found += [Finding(run, own.axis, why, of_log=True) for own in axes]
    return found


def _away(own: Measured, axis: int, reference: Reference, kinds: Iterable[str]) -> float:
    """Return by how much, as a logarithm, the sizes of an axis are not those of one's baseline."""
    return max(
        _away_by(own.size.get(kind, 0.0), reference.size.get((axis, kind), 0.0)) for kind in kinds
    )


def _away_by(size: float, usual: float) -> float:
    return abs(math.log(size / usual)) if size > 0 and usual > 0 else math.inf


def _other_signal(own: Measured, reference: Reference) -> str | None:
    wanted = reference.signal[own.axis]
    if own.signal == wanted:
        return None
    return (
        f"axis {own.axis} is recorded as {', '.join(own.signal)}, the baseline has "
        f"{', '.join(wanted)}; record the same channels"
    )


def _frozen(own: Measured, _: Reference) -> str | None:
    if own.frozen is None:
        return None
    name, second = own.frozen
    other = "another phase swings" if len(own.signal) == 3 else "the joint moves"
    return f"{name} keeps one value from {second:.4g} s on while {other}; check it"


def _other_unit(own: Measured, reference: Reference) -> str | None:
    for kind, size in own.size.items():
        usual = reference.size.get((own.axis, kind))
        if usual is None or (usual == 0 and size == 0):
            continue
        times = size / usual if usual > 0 else math.inf
        if kind == "current" and own.level and reference.level[own.axis] and usual > 0:
            # a unit scales the mean, too, about which that of a joint that runs on hardly swings
            times = min(times, max(1.0, own.level / reference.level[own.axis]))
        largest = SCALED if kind != "current" or _scaled(own, reference, times) else LARGEST_RATIO
        if not 1 / largest <= times <= largest:
            if size == 0:
                return (
                    f"the {kind} of axis {own.axis} never changes or is missing; check its sensor"
                )
            many = f"{times:.3g}" if usual > 0 else "infinitely many"
            unit = {"current": "mA for A", "position": "degrees", "velocity": "degrees or rpm"}
            little = ", or hardly any of the program's motion" if size < usual else ""
            return (
                f"the {kind} of axis {own.axis} is {many} times the baseline's: another unit "
                f"({unit[kind]}){little}? Check the map of `opamc ingest`, and the sensor"
            )
    return None


def _scaled(own: Measured, reference: Reference, times: float) -> bool:
    """Whether the smallest changes of an axis' current are of another size by a factor, too."""
    mine, usual = own.steps[1], reference.steps[own.axis][1]
    return 0 < times < math.inf and _away_by(mine, usual * times) <= math.log(UNLIKE)


def _far_too_large(own: Measured, reference: Reference) -> str | None:
    for kind, size in own.size.items():
        usual = reference.size.get((own.axis, kind), math.inf)
        if size > (LARGEST_RATIO if kind == "current" else SCALED) * usual:
            return _other_unit(own, reference)
    return None


def _unbalanced(own: Measured, reference: Reference) -> str | None:
    limit = max(LARGEST_IMBALANCE, 2 * reference.imbalance[own.axis])
    dead = own.size["current"] <= DEAD_SHARE * reference.size[own.axis, "current"]
    if own.imbalance is None or own.imbalance <= limit or dead:
        return None
    return (
        f"the three phases of axis {own.axis} do not add up to zero ({own.imbalance:.2g} of a "
        "phase is left): one is inverted, lost, or of another axis; check the sensors' wiring"
    )


def _still(own: Measured, reference: Reference) -> str:
    usual = reference.size.get((own.axis, "current"), 0.0)
    moved = reference.size.get((own.axis, "position"), 0.0)
    if own.size["current"] <= DEAD_SHARE * usual:
        share = own.size["current"] / usual
        text = f"the current of axis {own.axis} is {share:.1%} of the baseline's"
        if own.size.get("position", 0.0) > DEAD_SHARE * moved:
            return f"{text} though its position moves: the sensor is dead, or its cable loose"
        return f"{text}; the joint stands without load, or its sensor is dead"
    if own.size.get("position", math.inf) <= DEAD_SHARE * moved:
        return (
            f"the position of axis {own.axis} does not change though its current is "
            f"{own.size['current'] / usual:.0%} of the baseline's: the encoder is dead, its "
            "channel stuck, or the joint blocked"
        )
    return f"no motion is found in {', '.join(own.signal)}: axis {own.axis} stands still there"


def _clipped(own: Measured, reference: Reference) -> str | None:
    name, share = _most_clipped(own)
    if share <= reference.clipped[own.axis] + CLIPPED_SHARE:
        return None
    return f"{name} is clipped in {share:.1%} of the motion; check the sensor's range"


def _other_sign(own: Measured, reference: Reference) -> str | None:
    usual = reference.leaning[own.axis], reference.reversing[own.axis]
    if own.leaning is None or own.reversing is None or own.level is None or own.returning is None:
        return None
    if (own.returning < RETURNING) != (reference.returning[own.axis] < RETURNING):
        return None
    # a load that is always there takes one sign away, too, but adds to the current
    as_large = _away_by(own.level, reference.level[own.axis]) <= math.log(ALIKE)
    if own.reversing == 0 and usual[1] >= REVERSING and as_large:
        return f"the current of axis {own.axis} has lost its sign; log it with its sign"
    if own.leaning * usual[0] < 0 and min(abs(own.leaning), abs(usual[0])) >= TURNED:
        return (
            f"the current of axis {own.axis} drives against the motion where the baseline's drives "
            "it: is the sign of the current or of the position inverted?"
        )
    way, usual_way = own.one_way or 0.0, reference.one_way[own.axis]
    leads = way * usual_way < 0 and min(abs(way), abs(usual_way)) >= ONE_WAY
    if leads and as_large and _away(own, own.axis, reference, ("current",)) <= math.log(ALIKE):
        return (
            f"the current of axis {own.axis} is as large as the baseline's, and of the other sign "
            "throughout: is it inverted?"
        )
    return None


def _turned_round(own: Measured, reference: Reference) -> str | None:
    usual = reference.turning[own.axis]
    if own.turning is None or own.turning * usual >= 0:
        return None
    if min(abs(own.turning), abs(usual)) < TURNED:
        return None
    return (
        f"the current of axis {own.axis} turns the other way with the joint's motion than the "
        "baseline's: are two of its phases exchanged?"
    )


def _incomplete(own: Measured, _: Reference) -> str | None:
    name, share = max(own.missing.items(), default=("", 0.0), key=lambda entry: entry[1])
    if share <= MISSING_SHARE:
        return None
    return f"{name} holds no number in {share:.0%} of the motion; check the log"


def _coarser(own: Measured, reference: Reference) -> str | None:
    usual = reference.changing[own.axis]
    if usual < FINE or own.changing > usual / COARSER:
        return None
    return (
        f"the current of axis {own.axis} changes from sample to sample in {own.changing:.0%} of "
        f"them, the baseline's in {usual:.0%}: is it logged in other steps, or each value several "
        "times?"
    )


def _other_steps(own: Measured, reference: Reference) -> str | None:
    mine = (own.steps, own.changing)
    usual = (reference.steps[own.axis], reference.changing[own.axis])
    (fine, fine_changing), (coarse, coarse_changing) = sorted((mine, usual))
    in_steps = coarse[1] <= ONE_STEP * coarse[0] and coarse[0] >= OTHER_STEP * fine[0] > 0
    if not in_steps or coarse_changing > TIED * fine_changing:
        return None
    steps = f"steps of {coarse[0]:.2g}, the baseline's in finer ones"
    if coarse is not own.steps:
        steps = f"finer steps than the baseline's of {coarse[0]:.2g}"
    why = "log both alike, steps look like a fault"
    return f"the current of axis {own.axis} comes in {steps}; {why}"


RULES: tuple[Callable[[Measured, Reference], str | None], ...] = (
    _other_signal,
    _frozen,
    _other_unit,
    _unbalanced,
    _other_sign,
    _turned_round,
    _clipped,
    _incomplete,
    _coarser,
    _other_steps,
)
"""In the order in which they are asked."""

OF_LOG = frozenset({_other_sign, _turned_round, _coarser, _other_steps})
"""A joint that they do not show may be logged in another way all the same."""

RULES_AT_REST = (_other_signal, _frozen, _far_too_large, _unbalanced, _incomplete)
"""Of an axis in which no motion was found, since its current may be why."""


def _most_clipped(own: Measured) -> tuple[str, float]:
    return max(own.clipped.items(), default=("", 0.0), key=lambda entry: entry[1])


def _middle(values: Sequence[float | None]) -> float:
    known = [value for value in values if value is not None]
    return float(np.median(known)) if known else 0.0
