"""A load that is not the same all the time."""

from itertools import combinations

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track

GUESSES, NEAR = 32, 4
LEAST_SIDE = 0.03
"""Share of the open samples before or after the step."""
RESTS, EDGES = 8, 11
"""Most rests of a cycle between any two of which a payload may be held; times, for once in all."""


class PayloadChange(Effect):
    """Gravity and inertia that step at some time, between a cycle's rests, or as metadata tell."""

    name = "payload_change"
    domain = "load"
    per = ("", "", "rad/s²")
    of_its_recordings = True
    origin = "load"
    changes_in_time = True
    searches = ("since_s", "until_s", "gripped_s", "released_s", "per_kg")
    meaning = "another payload: check the tool, not the gear"
    needs = ("scale", "revisits")
    from_motion = True

    def untestable(self, track: Track) -> str | None:
        """Nor where half turns may have been lost at some time: the place steps, too."""
        why = "what was turned without current is a guess, and a place that steps looks the same"
        return super().untestable(track) or (why if track.guessed_s else None)

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Try steps all over the session: a stroke too early or too late, little is explained."""
        first, last = self.limits(track)["since_s"]
        # Where no recording comes back by itself, a step within one is a function of place.
        tried = track.starts_s[1 :: len(track.starts_s) // GUESSES + 1]
        if not tried.size or track.comes_back:
            tried = np.linspace(first, last, GUESSES)
        times = [float(time) for time in tried if first <= time <= last]
        steps = [{"since_s": time} for time in times]
        edges = combinations(times[len(times) // EDGES :: len(times) // EDGES + 1], 2)
        steps += [{"since_s": one, "until_s": other} for one, other in edges]
        # Where phases follow the joint, half turns that are lost from rest to rest look the same.
        held = "logged" in track.channels and np.isfinite(track.period_s)
        pairs = combinations(_rests(track) if held else (), 2)
        # What each run is told to carry is no step, and is known of those left out, too.
        if track.payload_kg is not None and np.ptp(track.payload_kg) > 0:
            steps.append({"per_kg": 1.0})
        return [*steps, *({"gripped_s": one, "released_s": other} for one, other in pairs)]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Anywhere in the session, but not so close to its ends that one side tells nothing."""
        rows = track.moving if track.open_samples is None else track.open_samples
        first, last = np.quantile(track.time_s[rows], [LEAST_SIDE, 1 - LEAST_SIDE])
        return dict.fromkeys(("since_s", "until_s"), (float(first), float(last)))

    def first_steps(self, track: Track, parameters: Parameters) -> dict[str, float]:
        """Of both ends more than a sealed block, one of twelve: within it nothing tells."""
        both = {end: 1.2 * (b - a) / EDGES for end, (a, b) in self.limits(track).items()}
        return both if "until_s" in parameters else super().first_steps(track, parameters)

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Gravity's and inertia's regressors after the step."""
        place, since = track.time_s, parameters.get("since_s", 0.0)
        until = parameters.get("until_s", np.inf)
        if "gripped_s" in parameters:
            place = track.run_time_s % track.period_s
            since, until = parameters["gripped_s"], parameters["released_s"]
        after = ((place >= since) & (place < until)).astype(float)
        if "per_kg" in parameters:
            after = np.zeros(track.size) if track.payload_kg is None else track.payload_kg
        asked = np.sin(track.position_rad), np.cos(track.position_rad), track.acceleration
        return stack(*(after * one for one in asked))

    def settled(self, parameters: Parameters, track: Track) -> Parameters:
        """Where nothing open tells a time, take a recording's start, or the middle."""
        rows = track.open_samples
        if rows is None or "since_s" not in parameters:
            return parameters
        times, ends = track.time_s[rows], parameters.keys() & {"since_s", "until_s"}
        found = parameters | {end: _between(parameters[end], times, track) for end in ends}
        told = times if track.payload_kg is None else track.payload_kg[rows]
        # From then on the runs tell another one: what that asks holds elsewhere, too.
        step = np.where(times < found["since_s"], told[0], told[-1])
        return {"per_kg": 1.0} if told[0] != told[-1] and np.all(told == step) else found

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """Say whether it changes in every cycle."""
        if "per_kg" in parameters:
            return "payloads as the recordings' payload_kg tells: no fault"
        if len(parameters) < 2:
            return self.meaning
        since, until = sorted(parameters.values())
        when = " of every cycle" if "gripped_s" in parameters else ""
        return f"a payload held from {since:.3g} to {until:.3g} s{when}: no fault"


def _between(at_s: float, times_s: Floats, track: Track) -> float:
    """Return the widest gap near a step: where a recording starts in it, else its middle."""
    after = int(np.searchsorted(times_s, at_s))
    # A few samples more or less on one side are no reason to prefer its end of the stretch.
    first, last = max(after - NEAR, 0), min(after + NEAR, times_s.size - 1)
    widest = first + int(np.argmax(np.diff(times_s[first : last + 1])))
    early, late = times_s[widest : widest + 2]
    starts = [start for start in track.starts_s if early < start <= late]
    return float(np.median(starts or (early, late)))


def _rests(track: Track) -> list[float]:
    """Beginning of the cycle, and the middles of its longest rests in order, in seconds."""
    places = np.sort(track.run_time_s[track.moving & (track.group >= 0)] % track.period_s)
    gaps = np.diff(places)
    longest = [k for k in np.argsort(-gaps)[:RESTS] if gaps[k] > 2 / track.rate_hz]
    return [0.0, *sorted(float(places[k] + gaps[k] / 2) for k in longest)]
