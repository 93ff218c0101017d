"""Distance between recording sessions by the course of their current."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.significance.spread import Spread
from opamc_cli.decision.witnesses.departure import Block
from opamc_cli.decision.witnesses.deviation import (
    change_between,
    change_beyond_noise,
    chosen,
    clearest_of,
    variance_within_sessions,
)
from opamc_cli.decision.witnesses.evidence import Kind

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEAST_SHARE = 1e-3
"""Of the current: sessions that agree to a thousandth of its root mean square agree."""


@dataclass(frozen=True)
class ProfileCell:
    """Course of one motion's current by session."""

    motion: int
    """What it is of."""
    course: FloatArray
    """Mean over each session's cycles, baseline first, over the root mean square of the mean of all
    sessions; NaN where nothing is known; shape (B + T, P)."""
    cycles: FloatArray
    """Cycles that each is of; shape (B + T,)."""
    within: FloatArray
    """Variance of single cycles about their session's mean; NaN if unknown; shape (P,)."""
    scale: FloatArray
    """Size of each session's course: its regression on the mean of all; shape (B + T,)."""
    rms_a: float
    """That root mean square, A."""


def profile_cell(
    motion: int, courses: FloatArray, session: IntArray, n_sessions: int
) -> ProfileCell:
    """Average courses by session.

    Parameters
    ----------
    motion : int
        What they are of.
    courses : ndarray, shape (C, P)
        One row per cycle, A.
    session : ndarray, shape (C,)
        Number of the session of each, 0..n_sessions.
    n_sessions : int
        How many there are.

    Returns
    -------
    ProfileCell
    """
    cycles = np.bincount(session, minlength=n_sessions).astype(np.float64)
    sums = np.zeros((n_sessions, courses.shape[1]))
    np.add.at(sums, session, courses)
    means = sums / np.where(cycles > 0, cycles, np.nan)[:, np.newaxis]
    middle = means[cycles > 0].mean(axis=0)
    rms = math.sqrt(float(np.mean(middle**2))) or 1.0
    middle, courses, means = middle / rms, courses / rms, means / rms
    return ProfileCell(
        motion=motion,
        course=means,
        cycles=cycles,
        within=variance_within_sessions(courses, session),
        scale=means @ (middle / max(float(middle @ middle), 1e-12)),
        rms_a=rms,
    )


@dataclass(frozen=True)
class ProfileEvidence:
    """Distance by the course of the current."""

    cells: Sequence[ProfileCell]
    """All motions of one axis."""
    n_baseline: int
    """Number of baseline sessions."""
    kinds: ClassVar[Sequence[Kind]] = ("orthogonal", "score")
    healthy_spread: ClassVar[Spread] = Spread(0.65, 8.0)
    """0.47, 0.67 and 0.83 in the middle of joints of three simulators (18 to 100 robots each)."""
    weight: ClassVar[float] = 2.0
    """It finds bumps and friction, which a spectrum hardly sees: see docs/decision.md."""
    tells_conditions: ClassVar[bool] = True
    depends_on_conditions: ClassVar[bool] = False

    def blocks(self) -> list[Block]:
        """Return the mean current in each part of each motion."""
        return [Block(cell.course, cell.cycles, cell.within, LEAST_SHARE**2) for cell in self.cells]

    def effect(self) -> float:
        """Return the relative change of the course; see `profile_effect`."""
        return profile_effect(self.cells, self.n_baseline)

    def change(self) -> float:
        """Return the root-mean-square change beyond the noise of cycles."""
        return change_beyond_noise(
            [(cell.course, cell.cycles, cell.within) for cell in self.cells], self.n_baseline
        )

    def of_sessions(self, baseline: Sequence[int], target: Sequence[int]) -> "ProfileEvidence":
        """Return the evidence with some of its sessions as the baseline and some as the target."""
        cells = chosen(self.cells, ("course", "cycles", "scale"), [*baseline, *target])
        return replace(self, cells=cells, n_baseline=len(baseline))


@dataclass(frozen=True)
class CourseChange:
    """Where the course of the current has changed most clearly."""

    motion: int
    """In which motion."""
    start: float
    stop: float
    """With `start`: part of it, 0 at its beginning and 1 at its end."""
    change_a: float
    """Mean change of the current there, A."""
    scale: float
    """Size of the whole course over the baseline's."""


def clearest_course(cells: Sequence[ProfileCell], n_baseline: int) -> CourseChange | None:
    """Find the part of a motion whose change of current stands out most.

    Parameters
    ----------
    cells : sequence of ProfileCell
        All motions of one axis.
    n_baseline : int
        Number of baseline sessions.

    Returns
    -------
    CourseChange or None
        None for fewer than two baseline sessions.
    """
    found = clearest_of([cell.course for cell in cells], n_baseline, LEAST_SHARE**2)
    if found is None:
        return None
    number, place, change, n_parts = found
    cell = cells[number]
    return CourseChange(
        motion=cell.motion,
        start=place / n_parts,
        stop=(place + 1) / n_parts,
        change_a=change * cell.rms_a,
        scale=float(np.nanmean(cell.scale[n_baseline:]) / np.nanmean(cell.scale[:n_baseline])),
    )


def profile_effect(cells: Sequence[ProfileCell], n_baseline: int) -> float:
    """Relative change of the course of the current.

    Parameters
    ----------
    cells : sequence of ProfileCell
        All motions of one axis.
    n_baseline : int
        Number of baseline sessions.

    Returns
    -------
    float
        Root mean square of the change over that of the current, beyond what the baseline's
        sessions show, in the motion where it is largest; NaN for fewer than two baseline sessions.
    """
    effects = []
    for cell in cells:
        change, variance = change_between(cell.course, n_baseline)
        if np.isfinite(variance).all():
            effects.append(math.sqrt(max(float((change**2 - variance).mean()), 0.0)))
    return max(effects, default=math.nan)
