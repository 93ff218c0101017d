"""A gain error of one phase's current sensor."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track


class SensorGain(Effect):
    """Unequal gains turn twice per electrical revolution, in proportion to the current."""

    name = "sensor_gain"
    domain = "electrical"
    per = ("current",)
    origin = "measurement"
    meaning = "gain error of a phase current sensor: recalibrate it"
    needs = ("electrical",)
    fast = True

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Twice the electrical angle, times the model's current."""
        assert track.electrical_rad is not None
        twice = 2 * track.electrical_rad
        return stack(track.model_a * np.cos(twice), track.model_a * np.sin(twice))
