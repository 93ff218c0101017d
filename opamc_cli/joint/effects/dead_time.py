"""Dead time of the inverter."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track


class DeadTime(Effect):
    """Every phase loses a constant against its sign: six-fold per electrical revolution.

    References
    ----------
    Jeong and Park, IEEE Transactions on Industrial Electronics 38, 1991.
    """

    name = "dead_time"
    domain = "electrical"
    per = ("",)
    origin = "measurement"
    meaning = "dead time of the inverter is not compensated: check the drive's setting"
    needs = ("electrical",)
    fast = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Try the six-step wave itself, and its first harmonic as the current loop leaves it."""
        return [{"six_step": 1.0}, {"six_step": 0.0}]

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Torque part of three square waves, or the sixth harmonic alone."""
        assert track.electrical_rad is not None
        angle = track.electrical_rad
        side = np.sign(track.model_a)
        if parameters["six_step"]:
            waves = [np.cos(angle - 2 * np.pi * phase / 3) for phase in range(3)]
            return stack(side * (2 / 3 * np.abs(waves).sum(axis=0) - 4 / np.pi))
        return stack(side * np.cos(6 * angle), side * np.sin(6 * angle))
