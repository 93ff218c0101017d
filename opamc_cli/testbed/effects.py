"""Undeclared effects: what each name does to the robot when it is switched on.

Torque effects act on the motor shaft and are sized in ampere of motor current per unit of their
regressor; mechanical ones change a parameter; sensor effects change what is recorded.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from opamc_cli.testbed.mechanics.kernel import AxisConstants
from opamc_cli.testbed.parameters import Effect

Constants = dict[str, float]
_Change = Callable[[Constants, float, dict[str, float]], None]


@dataclass(frozen=True)
class EffectKind:
    """One name of the list."""

    unit: str
    """Of the magnitude."""
    parameters: dict[str, float]
    """Parameters with their defaults."""
    change: _Change | None
    """Changes the constants of the axis; None for ripples and for what happens to the recording."""


def _set(*names: str) -> _Change:
    """Add the magnitude to the first name, set the rest from the parameters in order."""

    def change(constants: Constants, magnitude: float, parameters: dict[str, float]) -> None:
        constants[names[0]] += magnitude
        for name, value in zip(names[1:], parameters.values(), strict=True):
            constants[name] = value

    return change


def _inertia(c: Constants, magnitude: float, _: dict[str, float]) -> None:
    c["motor_inertia"] += magnitude * c["torque_constant"] / c["ratio"]


def _payload(c: Constants, magnitude: float, parameters: dict[str, float]) -> None:
    c["late_link_inertia"] += magnitude * c["payload_inertia_per_kg"]
    c["late_gravity"] += magnitude * c["payload_gravity_per_kg"]
    c["payload_change_s"] = parameters["start_s"]


def _elasticity(c: Constants, magnitude: float, _: dict[str, float]) -> None:
    c["stiffness"] *= 1.0 - magnitude
    c["stiffening"] *= 1.0 - magnitude


KINDS: dict[str, EffectKind] = {
    "inertia": EffectKind("A per rad/s^2", {}, _inertia),
    "gravity": EffectKind("A", {"angle_rad": 0.0}, _set("fx_gravity", "fx_gravity_angle")),
    "offset": EffectKind("A", {}, _set("fx_offset")),
    "coulomb": EffectKind("A", {}, _set("fx_coulomb")),
    "viscous": EffectKind("A per rad/s", {}, _set("fx_viscous")),
    "stribeck": EffectKind(
        "A", {"velocity_rad_s": 0.1}, _set("fx_stribeck", "fx_stribeck_velocity")
    ),
    "quadratic_friction": EffectKind("A per (rad/s)^2", {}, _set("fx_quadratic")),
    "sublinear_friction": EffectKind(
        "A per (rad/s)^exponent", {"exponent": 0.5}, _set("fx_power", "fx_power_exponent")
    ),
    "asymmetric_friction": EffectKind("A", {}, _set("fx_asymmetric")),
    "load_friction": EffectKind("A per N.m of joint torque", {}, _set("fx_load")),
    "thermal_viscous": EffectKind(
        "A per rad/s per K",
        {"reference_c": 25.0},
        _set("fx_thermal", "fx_thermal_reference_c"),
    ),
    "warmup": EffectKind("A", {"time_constant_s": 60.0}, _set("fx_warmup", "fx_warmup_time")),
    "spring": EffectKind("A per rad", {"angle_rad": 0.0}, _set("fx_spring", "fx_spring_angle")),
    "payload_change": EffectKind("kg", {"start_s": 0.0}, _payload),
    "position_drag": EffectKind(
        "A",
        {"angle_rad": 0.3, "width_rad": 0.1},
        _set("fx_drag", "fx_drag_angle", "fx_drag_width"),
    ),
    "hysteresis": EffectKind(
        "A", {"width_rad": 0.02}, _set("fx_hysteresis", "fx_hysteresis_width")
    ),
    "elasticity": EffectKind("share of the stiffness lost", {}, _elasticity),
    "ripple": EffectKind("A", {"order": 2.0, "phase_rad": 0.0, "speed_exponent": 0.0}, None),
    "time_delay": EffectKind("s", {}, None),
    "sensor_offset": EffectKind("A", {"phase": 0.0}, None),
    "sensor_gain": EffectKind("relative", {"phase": 0.0}, None),
    "dead_time": EffectKind("A", {}, _set("fx_dead_time")),
    "mains_hum": EffectKind("A", {"frequency_hz": 50.0, "phase_rad": 0.0, "phase": 0.0}, None),
}
"""Every effect name with its unit, its parameters and what it changes."""


def complete(effect: Effect) -> Effect:
    """Return an effect with the defaults of its parameters filled in.

    Raises
    ------
    ValueError
        For an unknown name or parameter, or a value out of bounds; the message names it.
    """
    if effect.name not in KINDS:
        msg = f"effect {effect.name!r} is unknown; known: {', '.join(sorted(KINDS))}"
        raise ValueError(msg)
    known = KINDS[effect.name].parameters
    unknown = sorted(set(effect.parameters) - set(known))
    if unknown:
        have = ", ".join(known) or "none"
        msg = f"effect {effect.name!r} has no parameter {unknown[0]!r}; it has: {have}"
        raise ValueError(msg)
    completed = {**known, **effect.parameters}
    _check_sizes(effect.name, {"magnitude": effect.magnitude, **completed})
    return Effect(effect.name, effect.axis, effect.magnitude, completed)


def _check_sizes(name: str, values: dict[str, float]) -> None:
    for key, value in values.items():
        if not np.isfinite(value):
            limit = "finite"
        elif key.endswith(_POSITIVE) and value <= 0:
            limit = "positive"
        elif key == "phase" and value not in (0, 1, 2):
            limit = "0, 1 or 2"
        elif (name, key) == ("elasticity", "magnitude") and not 0 <= value < 1:
            limit = "at least 0 and below 1"
        else:
            continue
        msg = f"effect {name!r}: {key} is {value:g}; it must be {limit}"
        raise ValueError(msg)


_POSITIVE = ("width_rad", "time_constant_s", "velocity_rad_s", "frequency_hz")


def apply_to_constants(effects: Sequence[Effect], constants: Constants) -> NDArray[np.float64]:
    """Switch the mechanical and electrical effects of one axis on.

    Parameters
    ----------
    effects : sequence of Effect
        Of one axis, completed.
    constants : dict
        The axis's constants by name; changed in place.

    Returns
    -------
    ndarray, shape (k, 4)
        The ripples for the kernel: order, amplitude in A, phase in rad, exponent of the speed.
    """
    ripples = []
    for effect in effects:
        change = KINDS[effect.name].change
        if change is not None:
            change(constants, effect.magnitude, effect.parameters)
        elif effect.name == "ripple":
            p = effect.parameters
            ripples.append([p["order"], effect.magnitude, p["phase_rad"], p["speed_exponent"]])
    names = [name for name in AxisConstants._fields if name.startswith("fx_")]
    constants["any_effect"] = bool(ripples) or any(constants[name] != 0.0 for name in names)
    return np.array(ripples, dtype=np.float64).reshape(-1, 4)


def apply_to_sensors(
    effects: Sequence[Effect],
    gain: NDArray[np.float64],
    offset_a: NDArray[np.float64],
    vector_a: NDArray[np.float64],
    rate_hz: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Switch the sensor effects of one axis on for its phase currents.

    Parameters
    ----------
    effects : sequence of Effect
        Of one axis, completed.
    gain, offset_a : ndarray, shape (3,)
        Of the sensors.
    vector_a : ndarray, shape (n, 2)
        Current vector, alpha and beta.
    rate_hz : float

    Returns
    -------
    gain, offset_a, hum_a, vector_a : ndarray
        As they are with the effects; the hum has shape (n, 3).
    """
    gain, offset_a = gain.copy(), offset_a.copy()
    hum = np.zeros((len(vector_a), 3))
    for effect in effects:
        size, p = effect.magnitude, effect.parameters
        if effect.name == "time_delay":
            vector_a = np.column_stack([delayed(vector_a[:, k], size * rate_hz) for k in range(2)])
        elif effect.name == "mains_hum":
            hum[:, int(p["phase"])] += _hum(len(vector_a), size, p, rate_hz)
        elif effect.name == "sensor_offset":
            offset_a[int(p["phase"])] += size
        elif effect.name == "sensor_gain":
            gain[int(p["phase"])] *= 1.0 + size
    return gain, offset_a, hum, vector_a


def apply_to_reported(
    effects: Sequence[Effect],
    current_a: NDArray[np.float64],
    electrical_rad: NDArray[np.float64],
    rate_hz: float,
) -> NDArray[np.float64]:
    """Apply the sensor effects of one axis to its reported current.

    The drive computes what it reports from its own phase sensors: an error of one of them turns
    with the field, once per electrical revolution for an offset, twice for a gain.

    Parameters
    ----------
    effects : sequence of Effect
        Of one axis, completed.
    current_a, electrical_rad : ndarray, shape (n,)
        Reported torque current and the angle of the rotor's field.
    rate_hz : float
    """
    out = current_a
    for effect in effects:
        size = effect.magnitude
        if effect.name == "time_delay":
            out = delayed(out, size * rate_hz)
        elif effect.name == "mains_hum":
            out = out + _hum(len(out), size, effect.parameters, rate_hz)
        elif effect.name in ("sensor_offset", "sensor_gain"):
            # The share of this phase in the torque current: the field leads by a quarter turn.
            seen = -np.sin(electrical_rad - 2.0 * np.pi / 3.0 * effect.parameters["phase"])
            error = size if effect.name == "sensor_offset" else size * current_a * seen
            out = out + 2.0 / 3.0 * error * seen
    return out


def delayed(values: NDArray[np.float64], samples: float) -> NDArray[np.float64]:
    """Delay a signal by a number of samples, whole or not; first and last value are held.

    Cubic splines: straight lines between samples would weaken a carrier by several per cent.
    """
    times = np.arange(len(values))
    inside = np.clip(times - samples, 0, len(values) - 1)
    result: NDArray[np.float64] = CubicSpline(times, values)(inside)
    return result


def _hum(n: int, size: float, p: dict[str, float], rate_hz: float) -> NDArray[np.float64]:
    turn = 2.0 * np.pi * p["frequency_hz"] / rate_hz
    result: NDArray[np.float64] = size * np.sin(turn * np.arange(n) + p["phase_rad"])
    return result
