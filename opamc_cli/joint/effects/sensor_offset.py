"""A zero error of one phase's current sensor."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track


class SensorOffset(Effect):
    """A constant in a phase turns once per electrical revolution in both d and q."""

    name = "sensor_offset"
    domain = "electrical"
    per = ("",)
    origin = "measurement"
    meaning = "zero error of a phase current sensor: recalibrate it"
    needs = ("electrical",)
    from_motion = True
    fast = True

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Sine and cosine of the electrical angle."""
        assert track.electrical_rad is not None
        return stack(np.cos(track.electrical_rad), np.sin(track.electrical_rad))
