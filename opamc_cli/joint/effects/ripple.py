"""Torque that repeats with the angle of a rotating part."""

import math

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.spectra import order_peaks
from opamc_cli.joint.track import Floats, Track

FORMS = ("speed", "direction", "load")


class Ripple(Effect):
    """A sine of the motor angle, whose size and phase follow speed, direction and load's sign."""

    name = "ripple"
    domain = "motor-angle"
    meaning = "torque ripple"
    needs = ("position",)
    free_refinement = False
    fast = True
    several = True
    flags_choose_columns = True
    forms = FORMS

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Strongest order of the whitened residual, with every dependence."""
        peaks = order_peaks(track, residual, count=2)
        return [{"order": order, "speed": 1.0, "direction": 1.0, "load": 1.0} for order in peaks]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Anything above joint-angle orders."""
        return {"order": (0.0, 1e6)}

    def is_constant(self, parameters: Parameters) -> bool:
        """Only the sign of the load's current follows the model."""
        return not parameters["load"]

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Pairs of cosine and sine: constant, with speed, with direction, with load's sign."""
        angle = parameters["order"] * track.machine_angle_rad
        cosine, sine = np.cos(angle), np.sin(angle)
        pairs = [cosine, sine]
        if parameters["speed"]:
            scale = np.abs(track.velocity) / track.speed_scale - 0.5
            pairs += [scale * cosine, scale * sine]
        if parameters["direction"]:
            pairs += [track.direction * cosine, track.direction * sine]
        if parameters["load"]:
            side = np.sign(track.model_a)
            pairs += [side * cosine, side * sine]
        return stack(*pairs)

    def updated(self, columns: Floats, track: Track, parameters: Parameters) -> Floats:
        """Only the last pair follows the model, and it is the first one times a sign."""
        if not parameters["load"]:
            return columns
        side = np.sign(track.model_a)[:, None]
        return np.concatenate([columns[:, :-2], side * columns[:, :2]], axis=1)

    def variants(self, parameters: Parameters) -> list[tuple[Parameters, tuple[int, ...]]]:
        """Without the dependences that the data do not ask for."""
        kept = [form for form in FORMS if parameters[form]]
        smaller = []
        for chosen in range(2 ** len(kept) - 1):
            flags = {form: float(chosen >> i & 1) for i, form in enumerate(kept)}
            pairs = [0, *(i + 1 for i, form in enumerate(kept) if flags[form])]
            columns = tuple(column for pair in pairs for column in (2 * pair, 2 * pair + 1))
            smaller.append((parameters | flags, columns))
        return smaller

    def settled(self, parameters: Parameters, track: Track) -> Parameters:
        """Take the named order where it lies within a quarter of the order resolution."""
        order = parameters["order"]
        travel = float(np.ptp(track.machine_angle_rad[track.moving]))
        nearest = min(named_orders(track, order), key=lambda named: abs(named - order))
        close = abs(nearest - order) < 0.25 * 2 * math.pi / travel
        return parameters | {"order": nearest} if close else parameters

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """Read the order with the gear ratio and pole pairs that are known."""
        return read_order(parameters["order"], track)


def named_orders(track: Track, order: float) -> list[float]:
    """Orders near a found one that have a meaning."""
    named = [float(max(round(order), 1))]
    ratio = track.joint.gear_ratio
    if track.angle_kind == "motor" and ratio:
        named += [2 * (ratio + 1) / ratio * k for k in range(1, 5)]
    return named


def read_order(order: float, track: Track) -> str:
    """Say what a ripple order means.

    Parameters
    ----------
    order : float
        Cycles per revolution of the track's machine angle.
    track : Track
        Gives the kind of angle, gear ratio, pole pairs and angular resolution.

    Returns
    -------
    str
        Reading by the table of orders; "unknown periodic source" where none fits.
    """
    if track.angle_kind == "joint":
        return (
            f"unknown periodic source, order {order:.5g} per joint revolution "
            "(gear ratio unknown, so it cannot be counted per motor revolution)"
        )
    if track.angle_kind == "electrical":
        return (
            f"order {order:.4g} per electrical revolution (pole pairs unknown, so it cannot be "
            "counted per motor revolution)"
        )
    ratio, poles = track.joint.gear_ratio, track.joint.pole_pairs
    travel = float(np.ptp(track.machine_angle_rad[track.moving]))
    width = min(0.35 * 2 * math.pi / travel, 0.25)
    if ratio:
        for harmonic in (1, 2):
            tooth = 2 * (ratio + 1) / ratio * harmonic
            if abs(order - tooth) < width and abs(order - tooth) < abs(order - 2 * harmonic):
                return "flexspline tooth damage (2(N+1)/N): inspect the flexspline"
            for sideband in (-2, -1, 1, 2):
                if harmonic == 1 and abs(order - tooth - sideband / ratio) < min(
                    width, 0.35 / ratio
                ):
                    if abs(order - 2.0) < 0.35 / ratio:
                        continue
                    return "sideband of 2(N+1)/N, flexspline tooth damage: inspect the flexspline"
    if abs(order - 1) < width:
        return "eccentricity, once per motor revolution: check rotor and wave generator"
    if abs(order - 2) < width or abs(order - 4) < width:
        times = "twice" if abs(order - 2) < width else "four times"
        return f"kinematic error, {times} per wave generator turn: check the wave generator"
    if poles:
        for multiple in (1, 2, 6):
            if abs(order - multiple * poles) < width:
                return f"electrical, {multiple}p per motor revolution: check drive and sensors"
        for slots in (6, 9, 12, 15, 18, 24, 27, 36):
            if abs(order - math.lcm(slots, 2 * poles)) < width:
                return f"cogging of {slots} slots and {2 * poles} poles"
    return f"unknown periodic source, order {order:.5g} per motor revolution"
