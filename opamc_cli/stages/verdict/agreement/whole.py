"""Recordings of which much is missing, or of another program: what is left may look healthy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.errors import InputError
from opamc_cli.stages.verdict.agreement.unjudged import Side

FEW_CYCLES = 0.6
"""Of the fewest that a recording of the baseline holds."""

ALIKE = 0.1
"""Of the cycles, one at least: baseline recordings that differ by more have no usual length."""

MUCH_UNKNOWN = 0.4
"""Share of a recording's segments that fit nothing: about half, of two programs that were glued."""


@dataclass(frozen=True)
class _Held:
    """What one axis of one run holds."""

    cycles: int
    n_segments: int
    n_unknown: int
    """Segments that fit no motion, a cycle's worth or more of them in a row."""
    ends_s: float

    @property
    def unknown(self) -> float:
        return self.n_unknown / self.n_segments


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
        odd = [
            axis
            for axis, others in known.items()
            if axes[axis].unknown >= MUCH_UNKNOWN
            and axes[axis].unknown > 2 * median([own.unknown for own in others] or [0.0])
        ]
        if odd:
            why, of = _of_another_program(axes, odd), odd
        elif all(_far_fewer(axes[axis].cycles, others) for axis, others in known.items()):
            why, of = _cut(axes, known), [*axes]
        else:
            continue
        errors.append(InputError(f"{paths[run]}: {why}", axes=of))
    return errors


def _far_fewer(cycles: int, others: Sequence[_Held]) -> bool:
    counts = [own.cycles for own in others]
    if len(counts) < 2 or max(counts) - min(counts) > max(1.0, ALIKE * max(counts)):
        return False
    return cycles <= FEW_CYCLES * min(counts)


def _cut(axes: Mapping[int, _Held], usual: Mapping[int, Sequence[_Held]]) -> str:
    most = max(axes, key=lambda axis: axes[axis].cycles)
    own, others = axes[most], sorted({one.cycles for one in usual[most]})
    hold = " to ".join(map(str, dict.fromkeys((others[0], others[-1]))))
    ends_s = max(one.ends_s for one in axes.values())
    ended = ends_s < min(one.ends_s for one in usual[most])
    why = f"its motion ends at {ends_s:.3g} s" if ended else "it stands still for longer in between"
    return (
        f"holds {own.cycles} cycle{'s' * (own.cycles > 1)} where the baseline's recordings hold "
        f"{hold} ({why})"
    )


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
    runs, axes, cycle, motion, stop, rate = (
        np.asarray(motions[name])
        for name in ("run", "axis", "cycle", "motion", "stop", "sampling_rate_hz")
    )
    found: dict[str, dict[int, _Held]] = {}
    for axis in np.unique(axes).tolist():
        for run in np.unique(runs[axes == axis]).tolist():
            own = (axes == axis) & (runs == run)
            if cycle[own].max() >= 0:
                found.setdefault(str(run), {})[axis] = _Held(
                    int(cycle[own].max()) + 1,
                    int(own.sum()),
                    _unknown(cycle[own] >= 0, int(motion[own].max()) + 1),
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
