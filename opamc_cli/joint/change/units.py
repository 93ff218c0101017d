"""What is compared as a whole: a recording session, or a cycle where there are too few of those."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.fit.model import Term, currents
from opamc_cli.joint.least_squares import solve
from opamc_cli.joint.motion.groups import Grouping
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.recordings import grouped_track, is_moving
from opamc_cli.joint.motion.track import Bools, Floats, Joint, Track, block_mean, coarsen

COARSE_RATE_HZ = 100.0
FEWEST_SAMPLES = 10

LOST = 2.0
"""Phases whose torque axis was followed wrongly leave this many times the usual residual."""


@dataclass(frozen=True)
class Unit:
    """One recording, or one cycle of it."""

    fine: Track
    coarse: Track
    """With `fine`: the recording at its own rate, and averaged to about 100 Hz."""
    fine_rows: Bools
    coarse_rows: Bools
    """With `fine_rows`: samples of the unit that count."""
    after: bool
    """True in the target."""
    # a search asks for most of them again at every step: half of its time
    _coarse_columns: dict[object, Floats] = field(init=False, repr=False, default_factory=dict)

    def columns(self, term: Term, fine: bool = False) -> Floats:
        """Regressors of a slow term on the unit's own samples."""
        if fine:
            return term.columns(self.fine)[self.fine_rows]
        if term.key not in self._coarse_columns:
            self._coarse_columns[term.key] = term.columns(self.coarse)[self.coarse_rows]
        return self._coarse_columns[term.key]

    def stacked(self, terms: tuple[Term, ...], fine: bool = False) -> Floats:
        """Regressors of several terms side by side."""
        return np.concatenate([self.columns(term, fine) for term in terms], axis=1)

    def current_a(self, fine: bool = False) -> Floats:
        """Torque current on the unit's own samples."""
        if fine:
            return self.fine.current_a[self.fine_rows]
        return self.coarse.current_a[self.coarse_rows]

    def with_model(self, terms: tuple[Term, ...], coefficients: Floats) -> "Unit":
        """Put the fitted load and the whole fitted current on both tracks."""
        blocks = [term.columns(self.fine) for term in terms]
        parts = np.split(coefficients, np.cumsum([block.shape[1] for block in blocks])[:-1])
        _, model, load = currents(terms, blocks, parts, self.fine.size)
        fine = self.fine.with_model(load, model, terms)
        return replace(self, fine=fine, coarse=self.coarse.with_model(load, model, terms))


Tracked = tuple[Track, Grouping]
Follow = Callable[[Recording, Joint], Tracked | None]


def follow(recording: Recording, joint: Joint) -> Tracked | None:
    """Lay one recording on its grid; None where the joint hardly moves."""
    track, grouping = grouped_track([replace(recording, started_s=None)], joint)
    return None if grouping is None or not is_moving(track) else (track, grouping)


def read_side(
    recordings: list[Recording], joint: Joint, after: bool, cycles: bool, follow: Follow = follow
) -> list[Unit]:
    """Turn the recordings of one side into units, but for those that hardly move.

    Units are cycles (or blocks) where `cycles` asks for it, else recordings.
    """
    units = []
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
        group = grouping.group if cycles else np.where(grouping.group >= 0, 0, -1)
        fine = replace(track, group=group)
        width = 1.0 / float(np.sum(fine.kernel**2))
        factor = max(int(fine.rate_hz / COARSE_RATE_HZ), int(0.8 * width), 1)
        coarse = coarsen(fine, factor)
        members = _cycles(fine, grouping.names) if cycles else [fine.group >= 0]
        for member in members:
            moving = fine.moving & member
            rows = moving & fine.clear
            slow = block_mean(moving.astype(float), fine.bounds, factor) > 1 - 1e-9
            if np.count_nonzero(slow & coarse.moving) >= FEWEST_SAMPLES:
                units.append(Unit(fine, coarse, rows, slow & coarse.moving, after))
    return units


def _cycles(track: Track, names: tuple[str, ...]) -> list[Bools]:
    """Tell whole cycles apart: halves, if they were halved, do not hold the same motion."""
    wholes: dict[str, list[int]] = {}
    for group, name in enumerate(names):
        run, _, piece = name.rpartition(":")
        wholes.setdefault(f"{run}:{piece.partition('.')[0]}", []).append(group)
    return [np.isin(track.group, groups) for groups in wholes.values()]


def usable_terms(units: list[Unit], effects: list[Effect]) -> tuple[Term, ...]:
    """Terms of the effects that every unit can show."""
    return tuple(
        Term(effect, {})
        for effect in effects
        if all(effect.untestable(unit.fine) is None for unit in units)
    )


def own_fit(
    unit: Unit, terms: tuple[Term, ...], fine: bool = False, current: Floats | None = None
) -> tuple[Floats, Floats]:
    """Coefficients and residual of least squares of the terms on one unit's samples alone.

    Another `current` may be given on the same samples.
    """
    columns = unit.stacked(terms, fine)
    values = unit.current_a(fine) if current is None else current
    blur = unit.fine.blur
    if fine and blur is not None:
        # What smoothing took from the acceleration is no effect.
        columns = np.concatenate([columns, blur[unit.fine_rows]], axis=1)
    coefficients = solve(columns.T @ columns, columns.T @ values)
    residual: Floats = values - columns @ coefficients
    return coefficients, residual


def followed(
    before: list[Unit], after: list[Unit], terms: tuple[Term, ...]
) -> tuple[list[Unit], list[Unit]]:
    """Leave out the units whose torque axis was followed wrongly.

    Phases alone lose the side of the torque axis where there is no current for a while. Where
    motion was logged, nothing is lost.
    """
    if not before or "logged" in before[0].fine.channels:
        return before, after
    old, new = ([_rms(unit, terms) for unit in side] for side in (before, after))
    usual = float(np.quantile(old, 0.25))
    # A changed joint may leave more everywhere: the target has a usual residual of its own.
    limit = LOST * max(usual, min(new, default=usual))
    return (
        [unit for unit, left in zip(before, old, strict=True) if left <= LOST * usual],
        [unit for unit, left in zip(after, new, strict=True) if left <= limit],
    )


def _rms(unit: Unit, terms: tuple[Term, ...]) -> float:
    return float(np.sqrt(np.mean(own_fit(unit, terms)[1] ** 2)))
