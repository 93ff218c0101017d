"""What is compared as a whole: a recording session, or a cycle where there are too few of those."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from opamc_cli.joint.fit.model import COARSE_RATE_HZ, Dataset, Term, grid_of
from opamc_cli.joint.fit.parts import Sums
from opamc_cli.joint.motion.groups import Grouping
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.phases.torque_axis import CLEARLY
from opamc_cli.joint.motion.recordings import grouped_track, is_moving
from opamc_cli.joint.motion.track import Bools, Floats, Ints, Joint, Track, coarsen, joined
from opamc_cli.signal.course import repeated_course
from opamc_cli.signal.motion.smoothing import CORNER_WINDOW, averaging_kernel
from opamc_cli.signal.transform.least_squares import solve

FEWEST_SAMPLES = 10
MOSTLY = 0.5
"""Share of the samples that must have a stroke alike for the load of other axes to be told."""

COURSE_TURNS = {"motor": 1.0, "joint": 0.05}
"""Turns of the machine angle between corners of that load's course: of a ripple, whose lowest order
that matters is one a turn of the motor, next to nothing is in it (2.5: a third more was left)."""

CORNER_SAMPLES = 2.0
"""From corner to corner at the median speed: of logs at 50 Hz corners at each turn of the motor hid
the friction of three joints in five."""

WEAK = 0.1
"""Of the current's standard deviation: with less, phases may lose the side of the torque axis."""


@dataclass(frozen=True)
class Compared:
    """Baseline and target of one joint, one after the other in one dataset."""

    dataset: Dataset
    """Its parts are the units that are compared."""
    after: Bools
    """Units of the target; bool array of shape (units,)."""

    @property
    def track(self) -> Track:
        """Everything at the full rate."""
        return self.dataset.fine.track

    def sums(self, terms: Sequence[Term], fine: bool = False, taken: Floats | None = None) -> Sums:
        """Products of regressors with one another and the current, over each unit.

        On the coarse grid, or at the full rate, where what smoothing took from the acceleration
        stands beside the terms: it is no effect. A current `taken`, (n,), is taken out first.
        """
        blur = self.track.blur
        beside = [] if not fine or blur is None else [blur]
        if taken is None:
            return self.dataset.sums(terms, fine, *beside)
        return self.dataset.sums(terms, fine, *beside, taken[:, None]).less_last()

    def only(self, units: Bools) -> "Compared":
        """Leave units out, those that are not among (units,)."""
        number = np.append(np.where(units, np.cumsum(units) - 1, -1), -1)
        tracks = []
        for track in (self.track, self.dataset.coarse.track):
            group = number[track.group]
            tracks.append(replace(track, group=group, moving=track.moving & (group >= 0)))
        return self.along(tracks, self.after[units])

    def along(self, tracks: Sequence[Track], after: Bools) -> "Compared":
        """Put other tracks on the fine and on the coarse grid."""
        fine, coarse = (grid_of(track, whole=True) for track in tracks)
        # Another dataset, for what was kept is of the other units.
        return Compared(Dataset(fine, coarse, self.dataset.factor, self.dataset.grouping), after)

    def enough(self) -> "Compared":
        """Leave units out of which one of the grids shows next to nothing."""
        shown = np.ones(self.after.size, dtype=bool)
        for grid in (self.dataset.fine, self.dataset.coarse):
            members = grid.track.group[grid.fit]
            shown &= np.bincount(members, minlength=shown.size) >= FEWEST_SAMPLES
        return self.only(shown)

    def less_repeated(self, terms: Sequence[Term]) -> "Compared":
        """Take out what terms leave of all baseline units alike: the load of other axes, above all.

        Strokes that no other unit of the baseline has are left out; where that is most of the
        motion, or nobody knows the place, nothing is taken.
        """
        spacing = 2 * np.pi * COURSE_TURNS.get(self.track.angle_kind, 0.0)
        if "logged" not in self.track.channels or not spacing:
            return self
        tracks = []
        for fine, grid in ((True, self.dataset.fine), (False, self.dataset.coarse)):
            track, unit = grid.track, grid.track.group
            late = np.append(self.after, False)[unit]
            ways = [one for one in stretches(track.direction, unit) if track.direction[one[0]]]
            # Of each unit's own fit: what its terms differ by is not to be shared.
            columns = np.concatenate([self.dataset.columns(term, fine) for term in terms], axis=1)
            own = own_fit(self, terms, fine)[0][:, : columns.shape[1]]
            left = track.current_a - np.einsum("nk,nk->n", columns, own[unit])
            left = np.where(grid.fit, left, np.nan)
            step = float(np.median(np.abs(np.gradient(track.machine_angle_rad))[grid.fit]))
            apart = max(spacing, CORNER_SAMPLES * step)
            course = repeated_course(track.machine_angle_rad, left, ways, unit, ~late, apart)
            known = np.isfinite(course)
            if min(np.mean(known[grid.fit & side]) for side in (late, ~late)) < MOSTLY:
                return self
            course, usual = np.where(known, course, 0.0), known * track.model_a
            # The current sensor's gain scales what the others ask, too.
            power, moment = (
                np.bincount(unit + 1, (usual + course) * one)
                for one in (usual + course, track.current_a)
            )
            current = track.current_a - (moment / np.maximum(power, 1e-300))[unit + 1] * course
            tracks.append(replace(track, current_a=current, moving=track.moving & known))
        return self.along(tracks, self.after).enough()


def stretches(side: Floats, group: Ints) -> list[tuple[int, int]]:
    """Half-open stretches of one direction and one group, both (n,)."""
    edges = np.flatnonzero((np.diff(side) != 0) | (np.diff(group) != 0)) + 1
    return list(pairwise([0, *edges.tolist(), side.size]))


Tracked = tuple[Track, Grouping]
Follow = Callable[[Recording, Joint], Tracked | None]


def follow(recording: Recording, joint: Joint) -> Tracked | None:
    """Lay one recording on its grid; None where the joint hardly moves."""
    track, grouping = grouped_track([replace(recording, started_s=None)], joint)
    return None if grouping is None or not is_moving(track) else (track, grouping)


def read_side(
    recordings: list[Recording], joint: Joint, cycles: bool, follow: Follow = follow
) -> list[Track]:
    """Lay the recordings of one side on their grids, but for those that hardly move.

    Their groups are cycles (or blocks) where `cycles` asks for it, else each is one.
    """
    tracks = []
    for recording in recordings:
        tracked = follow(recording, joint)
        if tracked is None:
            continue
        track, grouping = tracked
        if "logged" not in track.channels:
            # Phases give no zero of the joint angle; the same program has the same middle.
            at = track.position_rad[track.moving]
            middle = 0.5 * float(np.min(at) + np.max(at))
            track = replace(track, position_rad=track.position_rad - middle)
        group = grouping.group if cycles else np.minimum(grouping.group, 0)
        tracks.append(replace(track, group=group))
    return tracks


def side_by_side(before: Sequence[Track], after: Sequence[Track]) -> Compared:
    """Lay both sides' tracks in a row, each group a unit if the coarse grid shows enough of it."""
    tracks, late = [], np.zeros(0, dtype=bool)
    for side, new in ((before, False), (after, True)):
        for track in side:
            group = np.where(track.group >= 0, track.group + late.size, -1)
            tracks.append(replace(track, group=group))
            late = np.append(late, np.full(int(track.group.max()) + 1, new))
    track = joined(tracks)
    # a noisy path's acceleration, averaged over less, hides friction: a ball screw without grease
    # was viscous or dry friction in 6 of 10 draws, and is in 10
    kernel = max(track.kernel, averaging_kernel(CORNER_WINDOW, 2), key=len)
    noisy = "logged" in track.channels and kernel.size > CORNER_WINDOW
    width = (1.4 if noisy else 0.8) / float(np.sum(kernel**2))
    factor = max(int(track.rate_hz / COARSE_RATE_HZ), int(width), 1)
    coarse = coarsen(track, factor)
    # Of short motions in a slow log it may leave nothing.
    if not np.any(coarse.moving & (coarse.group >= 0)):
        factor, coarse = 1, track
    fine = replace(track, moving=track.moving & track.clear)
    grouping = Grouping(track.group, (), (), "units")
    return Compared(Dataset(grid_of(fine), grid_of(coarse), factor, grouping), late).enough()


def own_fit(
    compared: Compared, terms: Sequence[Term], fine: bool = False, taken: Floats | None = None
) -> tuple[Floats, Floats]:
    """Least squares of terms on each unit's samples alone; arguments are those of `Compared.sums`.

    Coefficients, (units, k), and the mean square of what they leave, (units,).
    """
    sums = compared.sums(terms, fine, taken)
    coefficients = solve(sums.gram, sums.moment)
    return coefficients, sums.left(coefficients) / sums.parts.counts


def turned(compared: Compared, terms: Sequence[Term]) -> Compared:
    """Turn what lies on the other side of the torque axis than the baseline's model has it.

    Phases alone lose that side where there is no current for a while, in one session, or in all
    cycles of one. The model is that of the baseline's unit which leaves the least of the others.
    Where motion was logged, nothing is lost.
    """
    late = compared.after
    if late.all() or "logged" in compared.track.channels:
        return compared
    sums, own = compared.sums(terms), own_fit(compared, terms)[0][~late]
    left = np.array([sums.left(np.tile(one, (late.size, 1))) for one in own])[:, ~late]
    usual = own[int(np.argmin(np.median(left / np.maximum(sums.power[~late], 1e-300), axis=1)))]
    tracks = []
    for fine, grid in ((True, compared.dataset.fine), (False, compared.dataset.coarse)):
        track = grid.track
        columns = np.concatenate([compared.dataset.columns(term, fine) for term in terms], axis=1)
        current, model = track.current_a, columns @ usual
        strong = np.abs(current) > WEAK * np.std(current[grid.fit])
        edges = np.diff(np.stack([strong, grid.fit, track.group])) != 0
        piece = np.append(0, np.cumsum(edges.any(axis=0)))
        same, other = (np.bincount(piece, grid.fit * (current + k * model) ** 2) for k in (-1, 1))
        wrong = strong & (other < CLEARLY * same)[piece]
        tracks.append(replace(track, current_a=np.where(wrong, -current, current)))
    return compared.along(tracks, late)
