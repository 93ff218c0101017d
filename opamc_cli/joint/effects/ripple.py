"""Torque that repeats with the angle of a rotating part."""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.motion.track import Floats, Ints, Track
from opamc_cli.joint.spectra import highest_order, order_lines
from opamc_cli.signal.transform.filters import answers

SWITCHES = ("speed", "direction", "load", "current")
DAMPING = 0.4
"""Of the filters in which a drive's answer is expanded."""
OCTAVES = 5.5
LOWEST_HZ = 1.0
HIGHEST_SHARE = 0.4
"""The filters' range below the highest frequency that a ripple reaches; below the lowest of them a
velocity loop answers as if nothing moved; and the highest one as a share of the sampling rate."""
FILTERS_PER_OCTAVE = {1000.0: 2.0, 150.0: 1.0}
"""From which power of a line on, in units of white noise's: each of their columns must earn its
keep. Every other filter, and every fourth, are the smaller forms."""
RIDGE = 1e-3
"""Of an answer's regressors: a hundred filters nearly alike cancel into whatever repeats."""
MOST_EXPANDED = 2
"""Lines of a round whose answer is tried: each is some fifty regressors."""
COARSEST = 0.5
"""Of them. With fewer filters than that per octave there is none."""
ASIDE = (-3.7, -2.3, 2.3, 3.7)
SMALLEST_RATIO = 30.0
"""Of strain wave gears: a joint that turns faster has neither flexspline nor wave generator."""
OF_A_SENSOR = {"1p": "sensor_offset", "2p": "sensor_gain", "6p": "dead_time"}
"""Kinds of orders that errors of the current measurement have, with the effects."""


class Ripple(Effect):
    """A sine of the motor angle, as the drive answers it.

    The velocity loop makes of a torque that follows the angle a current whose size and phase follow
    the speed: along the loop's resonance, with the lag of its filters, and with what the smoothing
    of the motion takes. Where the ripple is small a straight line in the speed is enough. Where it
    is large its `answer` is that of a linear system, expanded in filters of second order below the
    highest frequency that the ripple reaches (`top_hz`), each direction with coefficients of its
    own. Beside that, a damaged mesh follows the sign of the load, and one that turns unevenly the
    current itself.
    """

    name = "ripple"
    domain = "motor-angle"
    per = ("",)
    searches = ("order",)
    meaning = "torque ripple"
    fast = True
    several = True
    flags_choose_columns = True
    forms = (*SWITCHES, "answer", "top_hz")

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Strongest orders of the residual, with every dependence."""
        found: list[Parameters] = []
        lines = order_lines(track, residual, count=2)
        strongest = sorted(lines, key=lambda line: -line[1])[:MOST_EXPANDED]
        for order, power in lines:
            plain = {"order": order, **dict.fromkeys(SWITCHES, 1.0)}
            density = self._density(track, order, power) if (order, power) in strongest else 0.0
            if density:
                answered = {"order": order, "direction": 1.0, "answer": density}
                found.append(answered | {"top_hz": _top_hz(track, order)})
            found.append(plain)
        return found

    def _density(self, track: Track, order: float, power: float) -> float:
        """Choose how many filters per octave a line may be worth; 0 where it has no answer."""
        top_hz = _top_hz(track, order)
        if order > highest_order(track) or top_hz <= LOWEST_HZ:
            # Its frequency is not the one that the samples show, or nothing answers to it.
            return 0.0
        turns = order / track.order_resolution
        for least, density in FILTERS_PER_OCTAVE.items():
            # With fewer turns than pairs of coefficients in each direction a wave takes the form
            # of any friction.
            if power > least and turns > 2 * _filters(top_hz, density):
                return density
        return 0.0

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Anything above joint-angle orders."""
        return {"order": (0.0, 1e6)}

    def first_steps(self, track: Track, parameters: Parameters) -> dict[str, float]:
        """Half of what two orders have to differ by."""
        return {"order": 0.5 * track.order_resolution}

    def is_constant(self, parameters: Parameters) -> bool:
        """Only the load's sign and the current follow the model."""
        return not (parameters.get("load") or parameters.get("current"))

    def ridge(self, parameters: Parameters) -> float:
        """Of a drive's answer."""
        return RIDGE if parameters.get("answer") else 0.0

    def columns_at(self, track: Track, parameters: Parameters, rows: Ints) -> Floats:
        """Pairs of cosine and sine of the samples that are asked for; the model's come last."""
        answering = _answering(track, parameters)
        at = track.machine_angle_rad if answering else track.machine_angle_rad[rows]
        turning = [np.cos(parameters["order"] * at), np.sin(parameters["order"] * at)]
        waves = [wave[rows] for wave in turning] if answering else turning
        scale = np.abs(track.velocity[rows]) / track.speed_scale - 0.5
        swelling = [scale * wave for wave in waves] if parameters.get("speed") else []
        model_a = track.model_a[rows]
        sizes = [np.sign(model_a)] * bool(parameters.get("load"))
        sizes += [model_a] * bool(parameters.get("current"))
        following = [size * wave for size in sizes for wave in waves]
        turned = 2 + 4 * len(answering) if parameters.get("direction") else 0
        plain = 2 + len(swelling)
        last = plain + 4 * len(answering)
        # A hundred columns: each is written once, where it stays.
        columns = np.empty((last + turned + len(following), rows.size))
        for row, column in zip(columns, (*waves, *swelling), strict=False):
            row[:] = column
        for k, w in enumerate(answering):
            out = columns[plain + 4 * k : plain + 4 * k + 4]
            answers(turning, w, DAMPING, track.rate_hz, track.bounds, rows, out)
        direction = track.direction[rows]
        for row, column in zip(
            columns[last : last + turned], (*waves, *columns[plain:last]), strict=False
        ):
            np.multiply(direction, column, out=row)
        columns[last + turned :] = following or 0.0
        return columns.T

    def variants(self, parameters: Parameters) -> list[tuple[Parameters, tuple[int, ...]]]:
        """Without the dependences that the data do not ask for."""
        switches = [name for name in SWITCHES if parameters.get(name)]
        densest = parameters.get("answer", 0.0)
        halves = {densest, densest / 2, densest / 4}
        densities = [0.0, *sorted(density for density in halves if density >= COARSEST)]
        smaller = []
        for on in product((False, True), repeat=len(switches)):
            for density in densities:
                form = {name: 1.0 for name, kept in zip(switches, on, strict=True) if kept}
                if density:
                    form |= {"answer": density, "top_hz": parameters["top_hz"]}
                form = {"order": parameters["order"], **form}
                if form != parameters:
                    smaller.append((form, _kept(parameters, form)))
        return smaller

    def settled(self, parameters: Parameters, track: Track) -> Parameters:
        """Take the named order where it lies within a quarter of the order resolution."""
        order, ratio = parameters["order"], track.joint.gear_ratio
        named = [float(max(round(order), 1))]
        if track.angle_kind == "motor" and ratio:
            named += [2 * teeth / ratio * k for _, teeth in meshes(ratio) for k in range(1, 5)]
        nearest = min(named, key=lambda one: abs(one - order))
        close = abs(nearest - order) < 0.25 * track.order_resolution
        return parameters | {"order": nearest} if close else parameters

    def decoys(self, parameters: Parameters, track: Track) -> list[Parameters]:
        """Orders beside one of no known source, between the lobes that the stroke makes of it."""
        order, width = parameters["order"], track.order_resolution
        if read_order(order, track).kind != "unknown":
            return []
        beside = [order + k * width for k in ASIDE]
        return [parameters | {"order": other} for other in beside if other > ASIDE[-1] * width]

    def ties(self, parameters: Parameters, track: Track) -> tuple[str, ...]:
        """Tell what current sensors do at such an order: alone, or by what a drive answers."""
        found = OF_A_SENSOR.get(read_order(parameters["order"], track).kind)
        itself = "logged" in track.channels and not parameters.get("answer")
        return () if found is None or itself else (found,)

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """Read the order with the gear ratio and pole pairs that are known."""
        return read_order(parameters["order"], track, compared=False).text


def _answering(track: Track, parameters: Parameters) -> list[float]:
    """Angular frequencies (rad/s) of the filters in which a drive's answer is expanded.

    Evenly spread over the octaves, highest first: `answer`, so many per octave, from `top_hz` down;
    if that is missing, from the ripple's own where the joint is as fast as it gets.
    """
    density = parameters.get("answer", 0.0)
    if not density:
        return []
    top_hz = parameters.get("top_hz") or _top_hz(track, parameters["order"])
    return [2 * np.pi * top_hz / 2.0 ** (k / density) for k in range(_filters(top_hz, density))]


def _filters(top_hz: float, density: float) -> int:
    """Count the filters from a highest frequency down, so many per octave; one at least."""
    return 1 + max(int(density * min(math.log2(top_hz / LOWEST_HZ), OCTAVES)), 0)


def _kept(parameters: Parameters, form: Parameters) -> tuple[int, ...]:
    """Columns of a full form that a smaller one has, in the order of `Ripple.columns_at`."""
    densest, density = parameters.get("answer", 0.0), form.get("answer", 0.0)
    count = _filters(parameters["top_hz"], densest) if densest else 0
    step = round(densest / density) if density else count + 1
    answers = [density > 0 and k % step == 0 for k in range(count) for _ in range(4)]
    pair = [True, True]
    parts = {"order": pair, "speed": pair, "answer": answers, "direction": pair + answers}
    parts |= {"load": pair, "current": pair}
    flags = [
        kept and name in form
        for name, columns in parts.items()
        if parameters.get(name)
        for kept in columns
    ]
    return tuple(place for place, kept in enumerate(flags) if kept)


def _top_hz(track: Track, order: float) -> float:
    """Frequency of an order at a speed that a hundredth of the moving samples exceeds."""
    speed = np.abs(np.gradient(track.machine_angle_rad)) * track.rate_hz
    fastest = float(np.quantile(speed[track.moving], 0.99))
    return min(order * fastest / (2 * math.pi), HIGHEST_SHARE * track.rate_hz)


def meshes(ratio: float) -> tuple[tuple[str, float], ...]:
    """Return the teeth that two lobes pass per output turn, with the line's formula.

    The flexspline of a gear that turns its flexspline out meets a damaged tooth 2(N+1)/N times per
    turn of the motor; one that is mounted the other way round, with the circular spline turning
    out, 2(N-1)/N times. Without a strain wave gear there are none.
    """
    return (("2(N+1)/N", ratio + 1), ("2(N-1)/N", ratio - 1)) if ratio >= SMALLEST_RATIO else ()


@dataclass(frozen=True)
class OrderMeaning:
    """What an order of a ripple means."""

    kind: str
    """"tooth", "rotor", "generator", "1p", "2p", "6p" (of the electrical angle), "cogging" or
    "unknown"."""
    text: str
    """To a maintainer."""


def read_order(order: float, track: Track, compared: bool = True) -> OrderMeaning:
    """Read an order, per revolution of the track's machine angle, by the table of orders.

    Many healthy gears have one of the gear's lines: where it was not `compared` with an earlier
    recording nothing is to be inspected.
    """
    unknown = f"unknown periodic source, order {order:.5g} per {track.angle_kind} revolution"
    if track.angle_kind != "motor":
        lacking = "gear ratio" if track.angle_kind == "joint" else "pole pairs"
        unknown += f" ({lacking} unknown, so it cannot be counted per motor revolution)"
        return OrderMeaning("unknown", unknown)
    ratio, poles = track.joint.gear_ratio, track.joint.pole_pairs
    width = min(0.35 * track.order_resolution, 0.25)
    if ratio:
        for harmonic, (formula, teeth) in product((1, 2, 3), meshes(ratio)):
            tooth = 2 * teeth / ratio * harmonic
            damage = (
                f"flexspline tooth damage ({formula}): inspect the flexspline"
                if compared
                else f"line of the tooth mesh ({formula}), which healthy gears may have: only its "
                "growth since an earlier recording tells tooth damage"
            )
            if abs(order - tooth) < width and abs(order - tooth) < abs(order - 2 * harmonic):
                if harmonic == 3 or 2 * harmonic / ratio >= width:
                    return OrderMeaning("tooth", damage)
                # A short travel cannot tell it from the line that every gear has.
                order = 2.0 * harmonic
            for sideband in (-2, -1, 1, 2):
                beside = abs(order - tooth - sideband / ratio) < min(width, 0.35 / ratio)
                if harmonic == 1 and beside and abs(order - 2.0) >= max(width, 0.35 / ratio):
                    return OrderMeaning("tooth", f"sideband of {formula}, {damage}")
    healthy = "many healthy gears have it, compare with an earlier recording"
    rotor = "check rotor and wave generator" if compared else healthy
    generator = "check the wave generator" if compared else healthy
    known = [(1, "rotor", f"eccentricity or magnets, once per motor revolution: {rotor}")]
    for k, often in ((2, "twice"), (4, "four times")) if not ratio or meshes(ratio) else ():
        text = f"kinematic error, {often} per wave generator turn: {generator}"
        known.append((k, "generator", text))
    if poles:
        known += [
            (k * poles, f"{k}p", f"electrical, {k}p per motor revolution: check drive and sensors")
            for k in (1, 2, 6)
        ]
        known += [
            (math.lcm(n, 2 * poles), "cogging", f"cogging of {n} slots and {2 * poles} poles")
            for n in (6, 9, 12, 15, 18, 24, 27, 36)
        ]
    for meant, kind, text in known:
        if abs(order - meant) < width:
            return OrderMeaning(kind, text)
    return OrderMeaning("unknown", unknown)
