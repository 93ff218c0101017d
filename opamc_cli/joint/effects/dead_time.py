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
    meaning = "uncompensated dead time of the inverter: check the drive's setting"
    needs = ("electrical",)
    forms = ("whole",)
    fast = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Try the six-step wave, of logged phases also whole, and what a current loop leaves."""
        whole = [{"six_step": 1.0, "whole": 1.0}] * ("phases" in track.channels)
        return [{"six_step": 1.0}, *whole, {"six_step": 0.0}]

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Torque part of three square waves, whole or less its mean, or its first harmonic."""
        assert track.electrical_rad is not None
        angle, side = track.electrical_rad, np.sign(track.model_a)
        if parameters["six_step"]:
            waves = [np.cos(angle - 2 * np.pi * phase / 3) for phase in range(3)]
            mean = 0.0 if parameters.get("whole") else 4 / np.pi
            return stack(side * (2 / 3 * np.abs(waves).sum(axis=0) - mean))
        return stack(side * np.cos(6 * angle), side * np.sin(6 * angle))
