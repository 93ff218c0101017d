"""Recordings of which a part is missing, or of another program: what is left may look healthy."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.errors import InputError
from opamc_cli.stages.verdict.agreement.unjudged import Side
from opamc_cli.storage.schemas.channels import axes_phrase

FEW_CYCLES = 0.6
"""Of the fewest cycles, or else motions, that a recording of the baseline holds."""

ALIKE = 0.1
"""Of these, a cycle at least: baseline recordings that differ by more have no usual length."""

MORE_GAPS = 2
"""Times as many samples without a number as any baseline recording has, from which on it is said: a
logger that loses some each night loses about as many."""

LONE_WARMTH_C = 25.0
"""By which a joint's logged temperature has moved beyond the middle of the others': a sensor that
is torn off tells -40 or 0 °C, one that is short-circuited 150; seasons move all joints."""

MUCH_UNKNOWN = 0.4
"""Share of a recording's segments that fit nothing: about half, of two programs that were glued."""


@dataclass(frozen=True)
class _Held:
    """What one axis of one run holds."""

    cycles: int
    n_motions: int
    """Of a cycle."""
    n_segments: int
    n_unfit: int
    """Segments that fit no motion."""
    n_unknown: int
    """Of these, a cycle's worth or more in a row."""
    within_s: float
    """When the first segment begins that fits nothing between others that fit; inf if none."""
    ends_s: float

    @property
    def length(self) -> float:
        """Its segments in cycles."""
        return self.n_segments / self.n_motions


def not_whole(baseline: Side, target: Side) -> list[InputError]:
    """Return one error for each of the target's recordings that is judged by a part of it alone.

    One that is shorter on purpose is none where the baseline's own differ in length, or there is
    but one; nor is one of which some joint holds as many cycles as ever.
    """
    usual, found = _held(baseline.motions), _held(target.motions)
    paths = {own.run: own.path for own in target.measured}
    errors = []
    for run, axes in found.items():
        if run in target.two_speeds:
            continue
        known = {
            axis: [own[axis] for own in usual.values() if axis in own] for axis in sorted(axes)
        }
        odd = [axis for axis, others in known.items() if _much_unknown(axes[axis], others)]
        if odd:
            why, of = _of_another_program(axes, odd), odd
        elif cut := _cut(axes, known):
            why, of = cut, [*axes]
        elif broken := _broken_off(axes, usual.values()):
            of, why = broken
        else:
            continue
        errors.append(InputError(f"{paths[run]}: {why}", axes=of))
    return errors


def with_gaps(baseline: Side, target: Side) -> list[InputError]:
    """Return one error for each of the target's recordings that lacks samples as none usually does.

    What they touch is left out, and might hide a fault.
    """
    usual: dict[int, int] = {}
    for (_, axis), count in baseline.missing.items():
        usual[axis] = max(count, usual.get(axis, 0))
    found: dict[str, dict[int, int]] = {}
    for (run, axis), count in target.missing.items():
        if count > MORE_GAPS * usual.get(axis, count):
            found.setdefault(run, {})[axis] = count
    paths = {own.run: own.path for own in target.measured}
    return [
        InputError(
            f"{paths[run]}: {_lost(max(lacking.values()), sorted(lacking))} (no number, or the "
            f"last one kept), in the baseline's recordings {max(usual[axis] for axis in lacking)} "
            "at most; what that touches is not judged: check sensor, cable and log",
            axes=lacking,
        )
        for run, lacking in found.items()
    ]


def _lost(count: int, axes: Sequence[int]) -> str:
    are = "samples of {} are lost" if count > 1 else "sample of {} is lost"
    return f"{count} {are.format(axes_phrase(axes))}"


def of_odd_warmth(baseline: Side, target: Side) -> list[InputError]:
    """Return one error for each temperature that is logged no more, or has moved far alone."""
    usual = {axis: list(of.values()) for axis, of in _warmths(baseline).items()}
    n_runs = len({own.run for own in baseline.measured})
    now = _warmths(target)
    moved = {
        (axis, run): warm - float(np.median(usual[axis]))
        for axis, of in now.items()
        if axis in usual
        for run, warm in of.items()
    }
    found = []
    for own in target.measured:
        name = f"{own.path}: the temperature of axis {own.axis}"
        others = [by for (axis, run), by in moved.items() if run == own.run and axis != own.axis]
        theirs = float(np.median(others)) if others else 0.0
        mine = moved.get((own.axis, own.run))
        if not own.moves or len(usual.get(own.axis, ())) < n_runs:
            continue
        if mine is None:
            why = f"{name} is told no more, in each of the baseline's recordings it is"
        elif abs(mine - theirs) > LONE_WARMTH_C:
            why = f"{name} has moved by {mine:+.0f} °C"
            why += f", the others by {theirs:+.0f}" if others else ""
        else:
            continue
        found.append(InputError(f"{why}: check its sensor and cable", axes=[own.axis]))
    return found


def _warmths(side: Side) -> dict[int, dict[str, float]]:
    """Return mean logged temperatures by axis and run."""
    found: dict[int, dict[str, list[float]]] = {}
    for row in side.motions.select(["run", "axis", "temperature_c"]).to_pylist():
        if row["temperature_c"] is not None:
            of_axis = found.setdefault(row["axis"], {})
            of_axis.setdefault(row["run"], []).append(row["temperature_c"])
    return {
        axis: {run: float(np.mean(values)) for run, values in of.items()}
        for axis, of in found.items()
    }


def _much_unknown(own: _Held, others: Sequence[_Held]) -> bool:
    """Tell whether much fits nothing, more than all that does not in any baseline recording."""
    share = own.n_unknown / own.n_segments
    usual = max((one.n_unfit / one.n_segments for one in others), default=0.0)
    return share >= MUCH_UNKNOWN and share > usual


def _far_fewer(own: float, usual: Sequence[float]) -> bool:
    if len(usual) < 2 or max(usual) - min(usual) > max(1.0, ALIKE * max(usual)):
        return False
    return own <= FEW_CYCLES * min(usual)


def _cut(axes: Mapping[int, _Held], usual: Mapping[int, Sequence[_Held]]) -> str | None:
    """Say that all joints hold far fewer cycles, or motions, than in the baseline; None if not.

    Of few cycles the last one may be nearly whole and count as none: motions tell it then.
    """
    most = max(axes, key=lambda axis: axes[axis].cycles)
    own, others = axes[most], usual[most]
    if all(_far_fewer(axes[axis].cycles, [o.cycles for o in usual[axis]]) for axis in axes):
        what, count, counts = "cycle", own.cycles, [one.cycles for one in others]
    elif all(_far_fewer(axes[axis].length, [o.length for o in usual[axis]]) for axis in axes):
        what, count, counts = "segment", own.n_segments, [one.n_segments for one in others]
    else:
        return None
    hold = " to ".join(map(str, dict.fromkeys((min(counts), max(counts)))))
    ends_s = max(one.ends_s for one in axes.values())
    ended = ends_s < min(one.ends_s for one in others)
    why = f"its motion ends at {ends_s:.3g} s" if ended else "it stands still for longer in between"
    return (
        f"holds {count} {what}{'s' * (count > 1)} where the baseline's recordings hold {hold} "
        f"({why})"
    )


def _broken_off(
    axes: Mapping[int, _Held], usual: Iterable[Mapping[int, _Held]]
) -> tuple[list[int], str] | None:
    """Say that most joints together made motions within their cycles that fit none; None if not.

    One joint alone may creep, or its noise may look like a motion.
    """
    odd = _within(axes)
    if not odd or any(_within(own) for own in usual):
        return None
    at_s = min(axes[axis].within_s for axis in odd)
    return odd, (
        f"within the cycles of axes {', '.join(map(str, odd))} segments fit no motion (from "
        f"{at_s:.3g} s on), in no recording of the baseline: did the robot stop there?"
    )


def _within(axes: Mapping[int, _Held]) -> list[int]:
    """Return the axes that hold what fits nothing between what fits; none if not most do."""
    odd = [axis for axis, own in axes.items() if math.isfinite(own.within_s)]
    return odd if len(odd) > max(1, len(axes) / 2) else []


def _of_another_program(axes: Mapping[int, _Held], odd: Sequence[int]) -> str:
    first = axes[odd[0]]
    rest = ", ".join(map(str, odd[1:]))
    others = f" (ax{'i' if len(odd) == 2 else 'e'}s {rest} likewise)" if rest else ""
    return (
        f"{first.n_unknown} of {first.n_segments} segments of axis {odd[0]}{others} fit no motion "
        "of the baseline's cycle and are not judged: another program before or behind it, or a "
        "fault that changes the motion itself?"
    )


def _held(motions: pa.Table) -> dict[str, dict[int, _Held]]:
    """Return, by run and axis, what the recordings hold of which any segment fits."""
    runs, axes, cycle, motion, start, stop, rate = (
        np.asarray(motions[name])
        for name in ("run", "axis", "cycle", "motion", "start", "stop", "sampling_rate_hz")
    )
    found: dict[str, dict[int, _Held]] = {}
    for axis in np.unique(axes).tolist():
        for run in np.unique(runs[axes == axis]).tolist():
            own = (axes == axis) & (runs == run)
            if cycle[own].max() >= 0:
                fits = cycle[own] >= 0
                inside = ~fits & np.logical_or.accumulate(fits)
                inside &= np.logical_or.accumulate(fits[::-1])[::-1]
                n_motions = int(motion[own].max()) + 1
                found.setdefault(str(run), {})[axis] = _Held(
                    int(cycle[own].max()) + 1,
                    n_motions,
                    fits.size,
                    int(np.count_nonzero(~fits)),
                    _unknown(fits, n_motions),
                    float((start[own] / rate[own])[inside].min(initial=math.inf)),
                    float((stop[own] / rate[own]).max()),
                )
    return found


def _unknown(fits: npt.NDArray[np.bool_], n_motions: int) -> int:
    """Count what fits nothing where it lasts a cycle or more.

    A shorter stretch is a cycle that an edge of the recording has cut, or a motion that noise has
    made: of a measured actuator's healthy strokes up to half the segments are.
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([True], fits, [True]))))
    lengths = edges[1::2] - edges[::2]
    return int(lengths[lengths >= n_motions].sum())
