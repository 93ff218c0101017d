"""Smooth functions of what was recorded, which claim nothing but their domain."""

from collections.abc import Callable, Sequence

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, geometric, stack
from opamc_cli.joint.effects.hysteresis import Hysteresis
from opamc_cli.joint.motion.track import Bools, Floats, Ints, Track
from opamc_cli.signal.transform.filters import answers
from opamc_cli.signal.transform.least_squares import solve

DEGREES = (2.0, 4.0, 8.0, 16.0)
"""Cosines over a covariate's range: from a bend to sixteen half waves."""
QUANTILES = 65
SAMPLES_OF_EACH = 100
"""By which the ranks of a long recording's covariates are told, evenly spread."""
RESPONSE_DAMPING = 0.3

Covariate = Callable[[Track], Floats]
MODIFIED: dict[str, Callable[[Track], Sequence[Floats]]] = {
    "one": lambda t: [np.ones(t.size)],
    "direction": lambda t: [t.direction],
    "speed": lambda t: [t.velocity],
    "friction": lambda t: [t.direction, t.velocity],
    "sign": lambda t: [np.sign(t.model_a)],
    "current": lambda t: [t.model_a],
    "load": lambda t: [np.sin(t.position_rad), np.cos(t.position_rad), t.acceleration],
}
"""What a function may change."""


class Smooth(Effect):
    """A function of one covariate, times what it may change: a cosine series.

    The covariate is stretched half-way towards its ranks, so that every stretch of the function
    is seen by enough samples and none is flattened.
    """

    unnamed = True
    of_its_recordings = True

    def __init__(
        self,
        name: str,
        domain: str,
        covariate: Covariate,
        modified: str,
        needs: tuple[str, ...] = ("position",),
        such_as: str = "",
    ) -> None:
        self.name = f"unnamed_{name}"
        self.domain = domain
        self.needs = needs
        told = name.replace("_", " ")
        such = f": {such_as}" if such_as else ""
        self.meaning = f"a function of {told}{such}; no effect of the library has its form"
        self.changes_in_time = bool({"returns", "revisits", "temperature"} & {*needs})
        self.from_motion = domain != "load" or modified == "load"
        self._told = told
        self._covariate = covariate
        self._modified = MODIFIED[modified]
        # The model holds a multiple of itself and of the acceleration already.
        self._first = int(modified == "current" or domain == "acceleration")

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """From a bend to sixteen half waves."""
        return [{"degree": degree} for degree in DEGREES]

    def drawn_over(self, track: Track) -> tuple[str, Floats, Floats] | None:
        """Its own covariate, and the sign of what it modifies; of a changing load that load."""
        if self.domain == "load" and self.changes_in_time:
            return None
        return self._told, self._covariate(track), np.sign(self._modified(track)[0])

    def columns_at(self, track: Track, parameters: Parameters, rows: Ints) -> Floats:
        """Cosines of the stretched covariate times each that they modify."""
        place = np.pi * stretched(self._covariate(track), track.moving, rows)
        # Of the place's multiples by Chebyshev's recurrence.
        waves = [np.ones_like(place), np.cos(place)]
        while len(waves) <= parameters["degree"]:
            waves.append(2 * waves[1] * waves[-1] - waves[-2])
        parts = [part[rows] for part in self._modified(track)]
        return stack(*(part * wave for part in parts for wave in waves[self._first :]))


class Response(Effect):
    """What resonances of the joint and of the drive would make of the acceleration."""

    unnamed = True
    as_smoothing = True
    name = "unnamed_response"
    domain = "acceleration"
    meaning = "a response to the acceleration; no effect of the library has its form"
    needs = ("position", "logged")
    from_motion = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Try three, six and twelve filters."""
        return [{"filters": count} for count in (3.0, 6.0, 12.0)]

    def columns_at(self, track: Track, parameters: Parameters, rows: Ints) -> Floats:
        """Low-passes and band-passes of second order, from 1.5 to 60 Hz."""
        full = track.full or track
        signal, rate_hz, bounds = [full.acceleration], full.rate_hz, full.bounds
        asked = rows if full is track else None
        highest, count = min(60.0, rate_hz / 3), int(parameters["filters"])
        filters = [2 * np.pi * hz for hz in geometric(1.5, highest, count)]
        parts = [answers(signal, w, RESPONSE_DAMPING, rate_hz, bounds, asked) for w in filters]
        columns = np.concatenate(parts).T
        return columns if full is track else np.asfortranarray(track.own_means(columns)[rows])


class Shift(Effect):
    """What a delay or a lag makes of the model: its rates of change.

    Of the model as it fits without: one that is fitted beside its own rates of change need not
    settle.
    """

    unnamed = True
    of_its_recordings = True
    as_smoothing = True
    name = "unnamed_shift"
    domain = "time"
    meaning = "a response of the model's own current; no effect of the library has its form"
    needs = ("position", "logged")
    static = False
    from_terms = True

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """First and second rate of change, by time, of the static terms' current."""
        rows = track.open_samples
        if rows is None or not track.static_terms:
            return np.zeros((track.size, 2))
        columns = track.static_columns
        part = columns.T[:, rows]
        fitted = columns @ solve(part @ part.T, part @ track.current_a[rows])
        first = track.rate_hz * np.gradient(fitted)
        return stack(first, track.rate_hz * np.gradient(first))


class Presliding(Hysteresis):
    """Friction that builds up over some 1e-4 rad after a reversal, which healthy bearings have."""

    unnamed = True
    name = "unnamed_presliding"
    meaning = "presliding: friction builds up over a short way after reversals, as in any bearing"
    lengths = (1 / 5000, 1 / 200, 6)


def stretched(values: Floats, members: Bools, rows: Ints | slice = slice(None)) -> Floats:
    """Put rows of a covariate on 0..1, half-way between the value and its rank among members."""
    known, values = values[members], values[rows]
    if not known.size:
        return np.zeros_like(values)
    # To sort is four times as fast as to ask for quantiles.
    known = np.sort(known[:: max(known.size // (QUANTILES * SAMPLES_OF_EACH), 1)])
    levels = np.interp(np.linspace(0, known.size - 1, QUANTILES), np.arange(known.size), known)
    span = max(float(levels[-1] - levels[0]), 1e-300)
    rank = np.interp(values, levels, np.linspace(0, 1, QUANTILES))
    return np.asarray(0.5 * (rank + np.clip((values - levels[0]) / span, 0, 1)))


def travel_since_reversal(track: Track) -> Floats:
    """Path since the direction last changed, in radians."""
    path = np.cumsum(np.abs(np.diff(track.position_rad, prepend=track.position_rad[:1])))
    known = np.maximum.accumulate(np.where(track.direction != 0, np.arange(track.size), 0))
    turned = np.diff(track.direction[known], prepend=np.nan) != 0
    return np.asarray(path - np.maximum.accumulate(np.where(turned, path, 0.0)))


def time_since_rest(track: Track) -> Floats:
    """Seconds since the joint last rested or turned, or its recording began."""
    direction, number = track.direction, np.arange(track.size)
    begins = (direction == 0) | (np.diff(direction, prepend=np.nan) != 0)
    begins[[start for start, _ in track.bounds]] = True
    return np.asarray((number - np.maximum.accumulate(np.where(begins, number, 0))) / track.rate_hz)


LATE = "a brake that opens late, or friction after a rest"
DRIVE = "a drive's dead zone, or less torque from each ampere of a large current"
POLARITY = "another gain of one polarity"
GAIN = "a gain that changes"
TIME = "position", "revisits"
WARM = "position", "temperature"
SMOOTH: tuple[Smooth, ...] = (
    Smooth("speed", "velocity", lambda t: np.abs(t.velocity), "direction"),
    Smooth("speed_and_direction", "velocity", lambda t: np.abs(t.velocity), "one"),
    Smooth("angle", "joint-angle", lambda t: t.position_rad, "one"),
    Smooth("angle_and_direction", "joint-angle", lambda t: t.position_rad, "direction"),
    Smooth("angle_and_speed", "joint-angle", lambda t: t.position_rad, "speed"),
    Smooth("travel_since_reversal", "joint-angle", travel_since_reversal, "direction"),
    Smooth("load", "load", lambda t: np.abs(t.load_a), "direction"),
    Smooth("time_since_rest", "time", time_since_rest, "direction", such_as=LATE),
    Smooth("current", "load", lambda t: np.abs(t.model_a), "sign", such_as=DRIVE),
    Smooth("current_size", "load", lambda t: np.abs(t.model_a), "one", such_as=POLARITY),
    Smooth("acceleration", "acceleration", lambda t: t.acceleration, "one"),
    Smooth("time", "time", lambda t: t.time_s, "one", TIME),
    Smooth("time_and_speed", "time", lambda t: t.time_s, "friction", ("position", "returns")),
    Smooth("time_and_load", "load", lambda t: t.time_s, "load", needs=("scale", "revisits")),
    Smooth("time_and_current", "load", lambda t: t.time_s, "current", TIME, GAIN),
    Smooth("temperature", "temperature", lambda t: np.asarray(t.temperature_c), "friction", WARM),
)
