"""Friction that grows with the transmitted torque."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.least_squares import solve
from opamc_cli.joint.motion.track import Floats, Track

MOST_ROWS = 10_000
"""Samples by which the inertia's part of the load is told: the load has no noise."""


class LoadFriction(Effect):
    """Meshing losses: dry friction in proportion to the load's magnitude.

    What accelerates the rotor itself does not pass the gear: `inertia_share` is the part of the
    inertia's current that does.
    """

    name = "load_friction"
    domain = "load"
    per = ("current",)
    meaning = "meshing losses grow with load: check the gear's lubrication and wear"
    needs = ("position",)
    resists = True
    searches = ("inertia_share",)
    follows_load = True

    def untestable(self, track: Track) -> str | None:
        """Needs a load that is fitted and changes."""
        load = np.abs(track.load_a[track.moving])
        if load.size and np.std(load) < 1e-6 * (np.std(track.current_a) + 1e-30):
            return "no declared effect carries a load that changes (inertia, gravity, spring)"
        return super().untestable(track)

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """All of the inertia beyond the gear, half of it, or none."""
        return [{"inertia_share": share} for share in (1.0, 0.5, 0.0)]

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Direction times the magnitude of the fitted load current that passes the gear."""
        return stack(track.direction * np.abs(_passing(track, parameters)))


def _passing(track: Track, parameters: Parameters) -> Floats:
    share = parameters.get("inertia_share", 1.0)
    return track.load_a if share == 1 else track.load_a - (1 - share) * _inertial(track)


def _inertial(track: Track) -> Floats:
    """Part of the fitted load that follows the acceleration."""
    rows = np.flatnonzero(track.moving)
    rows = rows[:: max(rows.size // MOST_ROWS, 1)]
    place = track.position_rad[rows]
    shapes = (track.acceleration[rows], np.sin(place), np.cos(place), place, np.ones(rows.size))
    columns = stack(*shapes)
    share = solve(columns.T @ columns, columns.T @ track.load_a[rows])
    inertial: Floats = share[0] * track.acceleration
    return inertial
