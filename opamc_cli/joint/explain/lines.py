"""Lines over an angle or over time, and other joints' motion, whatever they come from."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.effects.coupling import Coupling
from opamc_cli.joint.effects.mains_hum import MainsHum
from opamc_cli.joint.effects.ripple import Ripple
from opamc_cli.joint.explain.unnamed import DEGREES
from opamc_cli.joint.motion.track import Floats, Track
from opamc_cli.joint.spectra import LEAST_LINE, LOWEST_ORDER, line_power, order_lines

LOWEST_HZ = 1.0
HIGHEST_SHARE = 0.48


class AngleLine(Ripple):
    """A line over the motor's angle, which may follow speed, direction and the model's current."""

    unnamed = True
    name = "unnamed_order"
    meaning = "a line over the angle"

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Strongest orders of the residual, from where smooth functions of the angle end."""
        follows = dict.fromkeys(("speed", "direction", "current"), 1.0)
        lowest = min(0.5 * DEGREES[-1] * track.order_resolution, LOWEST_ORDER[track.angle_kind])
        return [{"order": o, **follows} for o, _ in order_lines(track, residual, 2, lowest)]

    # All that a line may follow is explained, at any order, and nothing claimed.
    variants, settled, interpretation = Effect.variants, Effect.settled, Effect.interpretation
    decoys = Effect.decoys


class Tone(MainsHum):
    """A line over time of any frequency."""

    unnamed = True
    name = "unnamed_tone"
    meaning = "a line over time"
    interpretation = Effect.interpretation

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Strongest frequency of the residual."""
        frequencies, power = line_power(track, [residual])
        inside = (frequencies > LOWEST_HZ) & (frequencies < HIGHEST_SHARE * track.rate_hz)
        power = np.where(inside, power, 0.0)
        best = int(np.argmax(power))
        if power[best] < 0.5 * LEAST_LINE * np.count_nonzero(residual):
            return []
        return [{"frequency_hz": float(frequencies[best])}]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Up to what the rate can show."""
        return {"frequency_hz": (0.5 * LOWEST_HZ, 0.49 * track.rate_hz)}


class Links(Coupling):
    """What an arm's other joints ask: no function of one covariate, but of a known form."""

    unnamed = True
    name = "unnamed_links"
    meaning = "a function of other joints' motion"
