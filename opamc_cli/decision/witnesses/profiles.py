"""Distance between recording sessions by the course of their current."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.witnesses.deviation import (
    PRIOR_DOF,
    change_between,
    clearest_of,
    deviation_from_rest,
    mean_of_known,
    variance_within_sessions,
)
from opamc_cli.decision.witnesses.evidence import log_mean

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEAST_SHARE = 1e-3
"""Of the current: sessions that agree to a thousandth of its root mean square agree."""


@dataclass(frozen=True)
class ProfileCell:
    """Course of one motion's current by session, its size and its shape apart."""

    motion: int
    """What it is of."""
    scale: FloatArray
    """Size of each session's course over that of all sessions' mean; NaN where nothing is known;
    shape (B + T, 1)."""
    shape: FloatArray
    """The course over its size, over the root mean square of all sessions' mean; (B + T, P)."""
    cycles: FloatArray
    """Cycles that each is of; shape (B + T,)."""
    within_scale: FloatArray
    within_shape: FloatArray
    """With `within_scale`: variance of single cycles about their session's mean; NaN if unknown;
    shape (1,) and (P,)."""
    course: FloatArray
    """The course itself, over the same root mean square; shape (B + T, P)."""
    rms_a: float
    """That root mean square, A."""


def profile_cell(
    motion: int, courses: FloatArray, session: IntArray, n_sessions: int
) -> ProfileCell:
    """Average courses by session and take their size apart from their shape.

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

    Notes
    -----
    The size is the regression on the mean of all sessions, the judged one among them: a mean of
    the others alone would know which session is being judged.
    """
    cycles = np.bincount(session, minlength=n_sessions).astype(np.float64)
    sums = np.zeros((n_sessions, courses.shape[1]))
    np.add.at(sums, session, courses)
    means = sums / np.where(cycles > 0, cycles, np.nan)[:, np.newaxis]
    middle = means[cycles > 0].mean(axis=0)
    rms = math.sqrt(float(np.mean(middle**2))) or 1.0
    middle, courses, means = middle / rms, courses / rms, means / rms
    along = middle / max(float(middle @ middle), 1e-12)

    def apart(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        scale = (rows @ along)[:, np.newaxis]
        return scale, rows - scale * middle

    scale, shape = apart(means)
    cycle_scale, cycle_shape = apart(courses)
    return ProfileCell(
        motion=motion,
        scale=scale,
        shape=shape,
        cycles=cycles,
        within_scale=variance_within_sessions(cycle_scale, session),
        within_shape=variance_within_sessions(cycle_shape, session),
        course=means,
        rms_a=rms,
    )


@dataclass(frozen=True)
class ProfileEvidence:
    """Distance by the course of the current, size and shape counting alike."""

    cells: Sequence[ProfileCell]
    """All motions of one axis."""
    n_baseline: int
    """Number of baseline sessions."""
    ranks: ClassVar[bool] = False

    def log_distances(self, units: IntArray, rest: IntArray) -> FloatArray:
        """Return the log of the squared deviation, the mean of that of size and of shape."""
        least = LEAST_SHARE**2
        parts = []
        for sessions, within in (("scale", "within_scale"), ("shape", "within_shape")):
            ratios = [
                deviation_from_rest(
                    getattr(cell, sessions), cell.cycles, getattr(cell, within), units, rest, least
                )
                for cell in self.cells
            ]
            parts.append(mean_of_known(np.array(ratios))[0])
        return log_mean(np.array(parts).T)

    def pooled(self, is_target: NDArray[np.bool_]) -> FloatArray:
        """Return the squared difference between the groups' means, in units of their scatter."""
        parts = []
        for name in ("scale", "shape"):
            ratios = [between_groups(getattr(cell, name), is_target) for cell in self.cells]
            parts.append(mean_of_known(np.array(ratios))[0])
        return mean_of_known(np.array(parts))[0]

    def effect(self) -> float:
        """Return the relative change of the course; see `profile_effect`."""
        return profile_effect(self.cells, self.n_baseline)


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
    scales = cell.scale[:, 0]
    return CourseChange(
        motion=cell.motion,
        start=place / n_parts,
        stop=(place + 1) / n_parts,
        change_a=change * cell.rms_a,
        scale=float(np.nanmean(scales[n_baseline:]) / np.nanmean(scales[:n_baseline])),
    )


def between_groups(sessions: FloatArray, is_target: NDArray[np.bool_]) -> FloatArray:
    """Squared difference between the means of two groups of sessions, averaged over parts.

    Parameters
    ----------
    sessions : ndarray, shape (B + T, P)
        NaN rows where nothing is known.
    is_target : ndarray of bool, shape (R, B + T)
        Which sessions form the target's group; one row per labelling.

    Returns
    -------
    ndarray, shape (R,)
        In units of its variance as the scatter within both groups shows it, moderated by that of
        all parts; NaN where a group is empty or nothing scatters.
    """
    present = np.isfinite(sessions).all(axis=1)
    x = sessions[present]
    chosen = is_target[:, present].astype(np.float64)
    n_target = chosen.sum(axis=1)
    n_other = len(x) - n_target
    result = np.full(len(is_target), np.nan)
    both = (n_target > 0) & (n_other > 0)
    dof = len(x) - 2
    if not both.any() or dof < 1:
        return result
    x = x - x.mean(axis=0)
    sums = chosen[both] @ x
    n_a, n_b = n_target[both, np.newaxis], n_other[both, np.newaxis]
    mean_a, mean_b = sums / n_a, -sums / n_b
    squares = (x**2).sum(axis=0) - n_a * mean_a**2 - n_b * mean_b**2
    variance = np.maximum(squares, 0.0) / dof
    typical = variance.mean(axis=1, keepdims=True)
    variance = (PRIOR_DOF * typical + dof * variance) / (PRIOR_DOF + dof)
    variance = np.maximum(variance, LEAST_SHARE**2) * (1 / n_a + 1 / n_b)
    result[both] = np.mean((mean_a - mean_b) ** 2 / variance, axis=1)
    return result


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
