"""A constant current."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track


class Offset(Effect):
    """A current that never changes: a sensor's zero, or a constant external force."""

    name = "offset"
    domain = "load"
    per = ("",)
    origin = "measurement"
    meaning = "zero error of the current reading, or a constant force: check the sensor's zero"
    needs = ()
    from_motion = True

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Ones."""
        return stack(np.ones(track.size))
