"""A load that is not the same all the time."""

from itertools import combinations

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track

GUESSES, NEAR = 32, 4
LEAST_SIDE = 0.03
"""Share of the open samples before or after the step."""
RESTS = 8
"""Most rests of a cycle between any two of which a payload may be held."""


class PayloadChange(Effect):
    """Gravity and inertia that step at some time, between a cycle's rests, or as metadata tell."""

    name = "payload_change"
    domain = "load"
    per = ("", "", "rad/s²")
    of_its_recordings = True
    origin = "load"
    changes_in_time = True
    searches = ("since_s", "gripped_s", "released_s", "per_kg")
    meaning = "another payload: check the tool, not the gear"
    needs = ("scale", "revisits")
    from_motion = True

    def untestable(self, track: Track) -> str | None:
        """Nor where half turns may have been lost at some time: the place steps, too."""
        why = "what was turned without current is a guess, and a place that steps looks the same"
        return super().untestable(track) or (why if track.guessed_s else None)

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Try steps all over the session: a stroke too early or too late, little is explained."""
        first, last = _judgeable(track)
        # Where no recording comes back by itself, a step within one is a function of place.
        times = track.starts_s[1 :: len(track.starts_s) // GUESSES + 1]
        if not times.size or track.comes_back:
            times = np.linspace(first, last, GUESSES)
        steps = [{"since_s": float(time)} for time in times if first <= time <= last]
        # Where phases follow the joint, half turns that are lost from rest to rest look the same.
        held = "logged" in track.channels and np.isfinite(track.period_s)
        pairs = combinations(_rests(track) if held else (), 2)
        # What each run is told to carry is no step, and is known of those left out, too.
        if track.payload_kg is not None and np.ptp(track.payload_kg) > 0:
            steps.append({"per_kg": 1.0})
        return [*steps, *({"gripped_s": one, "released_s": other} for one, other in pairs)]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Anywhere in the session, but not so close to its ends that one side tells nothing."""
        return {"since_s": _judgeable(track)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Gravity's and inertia's regressors after the step."""
        place, since, until = track.time_s, parameters.get("since_s", 0.0), np.inf
        if "gripped_s" in parameters:
            place = track.run_time_s % track.period_s
            since, until = parameters["gripped_s"], parameters["released_s"]
        after = ((place >= since) & (place < until)).astype(float)
        if "per_kg" in parameters:
            after = np.zeros(track.size) if track.payload_kg is None else track.payload_kg
        return stack(
            after * np.sin(track.position_rad),
            after * np.cos(track.position_rad),
            after * track.acceleration,
        )

    def settled(self, parameters: Parameters, track: Track) -> Parameters:
        """Where nothing open tells the time, take a recording's start, or the middle."""
        rows = track.open_samples
        if rows is None or "since_s" not in parameters:
            return parameters
        times = track.time_s[rows]
        after = int(np.searchsorted(times, parameters["since_s"]))
        # A few samples more or less on one side are no reason to prefer its end of the stretch.
        first, last = max(after - NEAR, 0), min(after + NEAR, times.size - 1)
        if last <= first:
            return parameters
        widest = first + int(np.argmax(np.diff(times[first : last + 1])))
        early, late = times[widest : widest + 2]
        # Tools are changed between recordings.
        starts = [start for start in track.starts_s if early < start <= late]
        since_s = float(np.median(starts or (early, late)))
        told = times if track.payload_kg is None else track.payload_kg[rows]
        # From then on the runs tell another one: what that asks holds elsewhere, too.
        if told[0] != told[-1] and np.all(told == np.where(times < since_s, told[0], told[-1])):
            return {"per_kg": 1.0}
        return parameters | {"since_s": since_s}

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """Say whether it changes in every cycle."""
        if "per_kg" in parameters:
            return "payloads as the recordings' payload_kg tells: no fault"
        held = "a payload held from {gripped_s:.3g} to {released_s:.3g} s of every cycle: no fault"
        return held.format(**parameters) if "gripped_s" in parameters else self.meaning


def _rests(track: Track) -> list[float]:
    """Beginning of the cycle, and the middles of its longest rests in order, in seconds."""
    places = np.sort(track.run_time_s[track.moving & (track.group >= 0)] % track.period_s)
    gaps = np.diff(places)
    longest = [k for k in np.argsort(-gaps)[:RESTS] if gaps[k] > 2 / track.rate_hz]
    return [0.0, *sorted(float(places[k] + gaps[k] / 2) for k in longest)]


def _judgeable(track: Track) -> tuple[float, float]:
    """Find the times with enough of the open samples on both sides."""
    rows = track.moving if track.open_samples is None else track.open_samples
    first, last = np.quantile(track.time_s[rows], [LEAST_SIDE, 1 - LEAST_SIDE])
    return float(first), float(last)
