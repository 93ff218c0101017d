"""A load that is not the same all the time."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.track import Floats, Track

GUESSES = 32
NEAR = 4


class PayloadChange(Effect):
    """Gravity and inertia that step at some time."""

    name = "payload_change"
    domain = "load"
    origin = "load"
    meaning = "the payload has changed: check the tool, not the gear"
    needs = ("scale", "revisits")
    from_motion = True
    free_refinement = False
    open_limits = ("since_s",)

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Try steps all over the session: a stroke too early or too late, little is explained."""
        first, last = float(track.time_s[0]), float(track.time_s[-1])
        inside = np.linspace(first, last, GUESSES + 2)[1:-1]
        return [{"since_s": float(time)} for time in inside]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Anywhere in the session."""
        return {"since_s": (float(track.time_s[0]), float(track.time_s[-1]))}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Gravity's and inertia's regressors after the step."""
        after = (track.time_s >= parameters["since_s"]).astype(float)
        return stack(
            after * np.sin(track.position_rad),
            after * np.cos(track.position_rad),
            after * track.acceleration,
        )

    def settled(self, parameters: Parameters, track: Track) -> Parameters:
        """Take the middle of a stretch that nothing open tells the time in."""
        rows = track.open_samples
        if rows is None:
            return parameters
        times = track.time_s[rows]
        after = int(np.searchsorted(times, parameters["since_s"]))
        # A few samples more or less on one side are no reason to prefer its end of the stretch.
        first, last = max(after - NEAR, 0), min(after + NEAR, times.size - 1)
        if last <= first:
            return parameters
        widest = first + int(np.argmax(np.diff(times[first : last + 1])))
        return parameters | {"since_s": 0.5 * float(times[widest] + times[widest + 1])}

    def in_one_group(self, track: Track, parameters: Parameters) -> bool:
        """Whether all of what is open after the step, or before it, lies in one group."""
        rows = track.open_samples
        if rows is None:
            return False
        after = track.time_s[rows] >= parameters["since_s"]
        groups = track.group[rows]
        return any(np.unique(groups[side]).size == 1 for side in (after, ~after))

    def variants(self, parameters: Parameters) -> list[tuple[Parameters, tuple[int, ...]]]:
        """Allow that the inertia's step is too small to see."""
        return [(parameters | {"inertia": 0.0}, (0, 1))]
