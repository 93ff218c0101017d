"""Friction that grows with the transmitted torque."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.track import Floats, Track


class LoadFriction(Effect):
    """Meshing losses: dry friction in proportion to the load's magnitude."""

    name = "load_friction"
    domain = "load"
    meaning = "meshing losses grow with load: check the gear's lubrication and wear"
    needs = ("position",)

    def untestable(self, track: Track) -> str | None:
        """Needs a load that is fitted and changes."""
        load = np.abs(track.load_a[track.moving])
        if load.size and np.std(load) < 1e-6 * (np.std(track.current_a) + 1e-30):
            return "no declared effect carries a load that changes (inertia, gravity, spring)"
        return super().untestable(track)

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Direction times the magnitude of the fitted load current."""
        return stack(track.direction * np.abs(track.load_a))

    def plausible(self, coefficients: Floats, parameters: Parameters) -> bool:
        """Friction resists."""
        return bool(coefficients[0] > 0)
