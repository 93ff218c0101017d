"""Friction that grows with the transmitted torque."""

import numpy as np

from opamc_cli.joint.effects.base import ByLoad, Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Ints, Track


class LoadFriction(Effect):
    """Meshing losses: dry friction in proportion to the load's magnitude, or to its square.

    The square is what a strain wave gear's teeth, preloaded against each other, come near (two of
    a UR10's joints, docs/validation/machines.md). What accelerates the rotor itself does not pass
    the gear: `inertia_share` is the part of the inertia's current that does.
    """

    name = "load_friction"
    domain = "load"
    meaning = "meshing losses that grow with load: check the gear's lubrication and wear"
    resists = True
    searches = ("inertia_share", "exponent")
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

    def variants(self, parameters: Parameters) -> list[tuple[Parameters, tuple[int, ...]]]:
        """Give the square of the load, or shares half of the way to the next guesses, or nearer."""
        shares = (parameters["inertia_share"] + way for way in (-0.25, 0.25, -0.1, 0.1))
        near = [{"inertia_share": min(max(share, 0.0), 1.0)} for share in shares]
        return [(parameters | form, (0,)) for form in ({"exponent": 2.0}, *near)]

    def columns_at(self, track: Track, parameters: Parameters, rows: Ints) -> Floats:
        """Direction times a power of the fitted load current that passes the gear."""
        return stack(self.beside(track, parameters, track.load_a[:, None], rows)(np.ones(1))[0])

    def beside(self, track: Track, parameters: Parameters, carriers: Floats, rows: Ints) -> ByLoad:
        """Likewise, of any load."""
        passing, exponent = carriers[rows], parameters.get("exponent", 1.0)
        if beyond := 1 - parameters.get("inertia_share", 1.0):
            places, weights = track.inertia_weights
            inertia = beyond * (weights @ carriers[places])
            passing = passing - np.outer(track.acceleration[rows], inertia)

        def by_load(values: Floats) -> tuple[Floats, Floats]:
            load = passing @ values
            along = track.direction[rows] * np.abs(load) ** (exponent - 1)
            return along * np.abs(load), (exponent * along * np.sign(load))[:, None] * passing

        return by_load

    def coefficient_units(self, parameters: Parameters, count: int, unit: str = "A") -> list[str]:
        """Return a share of the load, or one per unit of it."""
        return [f"per {unit}" if "exponent" in parameters else ""] * count
