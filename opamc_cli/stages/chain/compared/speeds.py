"""Recordings of another speed than the others: how long their motions last."""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.decision.significance.median_deviation import MAD_TO_SIGMA

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Strings = npt.NDArray[np.str_]

OTHER_SPEEDS = "other_speeds"
"""Where a motion table's record has what `odd_speeds` found."""

TWO_SPEEDS = "two_speeds"
"""And where the runs of which `odd_cycles` found some."""

OPEN_SAMPLES = 2.0
OPEN_S = 0.02
"""By which the lengths of one joint's motions are known, whichever is more, however many they are:
what moves one of its boundaries moves all. Of a measured actuator's recordings at 25 Hz the middle
of eight strokes differs by two samples; of motions of a second, from phase currents, by 10 ms."""

FEWEST_RUNS = 5
"""Of a baseline, from which on the scatter of its own recordings tells better."""

SCATTERS = 3.0
"""Of it, beyond which hardly a recording of the same speed lies."""

MOVED = 0.05
"""Of a motion that a fault's ringing may add to its length: of a damaged joint that is logged alone
1 to 3.5 %. The carrier of phase currents tells the speed, too, and a clock: with the usual one
motions that are longer or shorter by no more are of the same speed."""


def odd_speeds(motions: pa.Table, baseline: pa.Table, tolerance: float) -> dict[str, float]:
    """Find the runs whose motions are slower or faster than the baseline's.

    All joints of a robot change their speed together: a run is judged by the motions of all of
    them, so that a joint whose fault moves its boundaries does not count alone.

    Parameters
    ----------
    motions
        Rows of a motion table.
    baseline
        Those of the baseline's, which may be the same: then the speed that most runs share is its.
    tolerance
        Relative difference that counts as none, beside what is open of the lengths.

    Returns
    -------
    dict of str to float
        By run, how many times as long as the baseline's its motions last, in the middle.
    """
    usual = _usual(baseline, tolerance)
    known = [middle for middle, _, _ in _middles(baseline, usual).values()]
    scatter = MAD_TO_SIGMA * float(np.median(np.abs(np.array(known) - 1))) if known else 0.0
    found = {}
    for run, (middle, sample, open_) in _middles(motions, usual).items():
        if len(known) >= FEWEST_RUNS:
            open_ = max(sample, min(open_, SCATTERS * scatter))
        if abs(middle - 1) > tolerance + open_:
            found[run] = middle
    return found


def odd_cycles(motions: pa.Table) -> dict[tuple[str, int], dict[int, float]]:
    """Find cycles of another speed than most of their recording: it was changed midway.

    Where a joint creeps into its stop, a motion found from phase currents ends there in one cycle
    and before it in the next. The carrier tells that both are of one speed.

    Returns
    -------
    dict of (str, int) to dict of int to float
        By run and axis, how many times as long as the others its odd cycles last, by number.
    """
    run, axis, ratio, samples, _, carrier = _lasting(motions)
    cycle = np.asarray(motions["cycle"])[_whole_motions(motions)]
    found = {}
    for name, number in sorted(set(zip(run.tolist(), axis.tolist(), strict=True))):
        own = (run == name) & (axis == number)
        lasting = {int(k): float(np.median(ratio[own & (cycle == k)])) for k in set(cycle[own])}
        times = np.array(list(lasting.values()))
        open_ = 2 * MOVED + OPEN_SAMPLES / float(np.median(samples[own]))
        alike = (np.abs(times[:, None] / times - 1) <= open_).sum(axis=0)
        # of as many the speed of the reference
        first = [*lasting][np.lexsort((np.abs(times - 1), -alike))[0]]
        most = lasting[first]
        turning = {k: float(np.median(carrier[own & (cycle == k)])) for k in lasting}
        odd = {
            k: float(v / most)
            for k, v in lasting.items()
            # without a carrier this is NaN, which is near to nothing
            if abs(v / most - 1) > open_ and not abs(turning[k] / turning[first] - 1) <= MOVED
        }
        if odd:
            found[name, number] = dict(sorted(odd.items()))
    return found


def of_another_speed(ratio: float) -> str:
    """Say why a run, whose motions last so many times as long as the baseline's, is left out."""
    return (
        f"its motions last {ratio:.2f} times as long as the baseline's: of another speed, or a "
        "clock or lost samples, nothing can be compared; or a fault so gross that the joint no "
        "longer follows its program"
    )


def _middles(
    motions: pa.Table, usual: Mapping[int, tuple[float, float]]
) -> dict[str, tuple[float, float, float]]:
    """By run, how long its motions last, what a sample is of it, and what may be open of it."""
    run, axis, ratio, samples, rate, carrier = _lasting(motions)
    shared = np.array([usual.get(own, (1.0, np.nan)) for own in axis.tolist()]).reshape(-1, 2)
    ratio, carrier = ratio / shared[:, 0], carrier / shared[:, 1]
    found = {}
    for name in np.unique(run):
        own = run == name
        joints = np.sqrt(np.unique(axis[own]).size)
        sample = 1 / float(np.median(samples[own])) / joints
        open_ = sample * max(OPEN_SAMPLES, OPEN_S * float(rate[own][0]))
        middle, told = float(np.median(ratio[own])), carrier[own & np.isfinite(carrier)]
        if told.size and abs(middle - 1) <= MOVED:
            middle = min(middle, float(np.median(told)), key=lambda one: abs(one - 1))
        found[str(name)] = middle, sample, open_
    return found


def _usual(baseline: pa.Table, tolerance: float) -> dict[int, tuple[float, float]]:
    """By axis, how long most runs take in the reference's time: a motion, a carrier's period."""
    run, axis, ratio, *_, carrier = _lasting(baseline)
    usual = {}
    for number in np.unique(axis):
        runs = [(axis == number) & (run == name) for name in np.unique(run[axis == number])]
        middles, periods = (
            np.array([np.median(of[own]) for own in runs]) for of in (ratio, carrier)
        )
        alike = np.abs(middles[:, None] - middles) <= tolerance
        most = alike[np.argmax(alike.sum(axis=0))]
        usual[int(number)] = float(np.median(middles[most])), float(np.median(periods[most]))
    return usual


def _lasting(motions: pa.Table) -> tuple[Strings, Ints, Floats, Ints, Floats, Floats]:
    """Run, axis, length in the reference's and in samples, rate and period of identified motions.

    The period is the carrier's, in the reference's; NaN where there is none.

    How long a window is, or a motion at the edge of a recording, is the logger's affair.
    """
    identified = _whole_motions(motions)
    run, axis, start, stop, reference, rate = (
        np.asarray(motions[name])[identified]
        for name in ("run", "axis", "start", "stop", "reference_samples", "sampling_rate_hz")
    )
    phases, own, usual = (
        np.asarray(motions[name])[identified]
        for name in ("signal", "f_max_hz", "reference_f_max_hz")
    )
    period = np.where(phases == "phases", usual / own, np.nan)
    return run.astype(str), axis, (stop - start) / reference, stop - start, rate, period


def _whole_motions(motions: pa.Table) -> npt.NDArray[np.bool_]:
    cycle, edge, kind = (np.asarray(motions[name]) for name in ("cycle", "edge", "kind"))
    return np.asarray((cycle >= 0) & ~edge & (kind == "motion"))
