"""Configuration of the virtual testbed: `configs/testbed.yaml` as the testbed's dataclasses."""

import difflib
import math
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_type_hints

from pydantic import Field

from opamc_cli.config.files import read_values, read_yaml, refuse_other_kind, validate
from opamc_cli.config.models import Positive, Section
from opamc_cli.config.shipped import shipped_file
from opamc_cli.errors import ConfigError
from opamc_cli.testbed.effects import complete
from opamc_cli.testbed.parameters import Effect, Robot
from opamc_cli.testbed.program import Program

Column = Literal["phases", "current", "position", "velocity", "temperature"]
Axis = Annotated[int, Field(ge=1)]


class RecordingConfig(Section):
    """What is recorded."""

    sampling_rate_hz: Positive = 2048.0
    columns: tuple[Column, ...] = Field(("phases",), min_length=1)
    # one a day
    sessions: Annotated[int, Field(ge=1, le=100_000)] = 1
    first_session: Annotated[int, Field(ge=0, le=1_000_000)] = 0


class FaultConfig(Section):
    """Damage of one axis's flexspline; what is not given is the robot's `damage`."""

    axis: Axis
    severity: Annotated[float, Field(ge=0, le=1)] = 1.0
    share: Annotated[float, Field(gt=0, le=0.5)] | None = None


class TestbedConfig(Section):
    """Everything that `opamc simulate` needs."""

    robot: Robot
    program: Program
    recording: RecordingConfig = RecordingConfig()
    faults: tuple[FaultConfig, ...] = ()
    effects: tuple[Effect, ...] = ()


def load_testbed(path: Path, overrides: Sequence[str] = ()) -> TestbedConfig:
    """Return the testbed's configuration from a YAML file.

    A file with the key `based_on` holds only what differs from the file named there (relative
    to itself). Every joint is completed from `robot.joint`.

    Raises
    ------
    ConfigError
        If a file cannot be read, or a key or value is not allowed.
    """
    file = shipped_file(path, "configs")
    values = _on_its_base(file, read_values(file, overrides), depth=0)
    refuse_other_kind(str(path), values, TestbedConfig.model_fields)
    robot = values.get("robot")
    if isinstance(robot, dict):
        values["robot"] = robot = dict(robot)
        common, joints = robot.pop("joint", {}), robot.get("joints")
        if isinstance(joints, list):
            robot["joints"] = [_merged(common, own or {}) for own in joints]
    _refuse_unknown(TestbedConfig, values, str(path), "")
    config = validate(TestbedConfig, values, str(path), overrides)
    _check(config, path)
    return config


def _on_its_base(path: Path, values: dict[str, Any], depth: int) -> dict[str, Any]:
    base = values.pop("based_on", None)
    if base is None:
        return values
    if depth > 5 or not isinstance(base, str):
        msg = f"{path}: based_on is {base!r}; name one file, at most five deep"
        raise ConfigError(msg)
    below = path.parent / base
    merged: dict[str, Any] = _merged(_on_its_base(below, read_yaml(below), depth + 1), values)
    return merged


def _merged(base: Any, over: Any) -> Any:
    if isinstance(base, dict) and isinstance(over, dict):
        return {
            key: _merged(base[key], over[key])
            if key in base and key in over
            else over.get(key, base.get(key))
            for key in {**base, **over}
        }
    return over


def _refuse_unknown(kind: Any, values: Any, source: str, place: str) -> None:
    """Refuse keys that a dataclass does not have; pydantic would drop them in silence."""
    hints = get_type_hints(kind) if is_dataclass(kind) or _is_section(kind) else {}
    if isinstance(values, list):
        for index, item in enumerate(values):
            _refuse_unknown(kind, item, source, f"{place}[{index}]")
        return
    if not hints or not isinstance(values, dict):
        return
    known = [f.name for f in fields(kind)] if is_dataclass(kind) else sorted(kind.model_fields)
    for key, value in values.items():
        name = f"{place}.{key}" if place else str(key)
        if key not in known:
            close = difflib.get_close_matches(str(key), known, n=1, cutoff=0.5)
            hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(known)}"
            msg = f"{source}: unknown key {name!r}; {hint}"
            raise ConfigError(msg)
        inner = hints[key]
        if isinstance(value, list) and get_args(inner):
            inner = get_args(inner)[0]
        _refuse_unknown(inner, value, source, name)


def _is_section(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Section)


def _check(config: TestbedConfig, path: Path) -> None:
    """Refuse values that no physical robot has."""
    for part in (config.robot, config.program):
        for place, value in _numbers(part, "robot" if part is config.robot else "program"):
            if not math.isfinite(value):
                limit = "finite"
            elif place.endswith(_POSITIVE) and value <= 0:
                limit = "positive"
            elif not place.endswith(_SIGNED) and value < 0:
                limit = "0 or more"
            else:
                continue
            msg = f"{path}: {place} is {value:g}; it must be {limit}"
            raise ConfigError(msg)
    program = config.program
    limits = {
        "robot.joints": (len(config.robot.joints), 1, 100),
        "program.speed_percent": (program.speed_percent, 1, 100),
        "program.payload_kg": (program.payload_kg, 0, 100),
        "program.cycles": (program.cycles, 1, 1_000_000),
        "robot.sensor.bits": (config.robot.sensor.bits, 2, 32),
        "robot.sensor.filter_order": (config.robot.sensor.filter_order, 1, 12),
        "program.waypoints_rad": (len(program.waypoints_rad), 2, 1000),
        "program.dwell_s": (program.dwell_s - program.dwell_jitter_s, 0, 1e6),
        "robot.sensor.filter_share": (config.robot.sensor.filter_share, 0.01, 0.49),
        "recording.sampling_rate_hz": (config.recording.sampling_rate_hz, 100, 20_000),
    }
    for place, (value, least, most) in limits.items():
        if not least <= value <= most:
            msg = f"{path}: {place} is {value:g}; it must lie in {least:g}..{most:g}"
            raise ConfigError(msg)
    count = len(config.robot.joints)
    if len(set(program.axes)) < len(program.axes) or not program.axes:
        msg = f"{path}: program.axes is {list(program.axes)}; name every axis that moves once"
        raise ConfigError(msg)
    for effect in config.effects:
        try:
            complete(effect)
        except ValueError as error:
            msg = f"{path}: {error}"
            raise ConfigError(msg) from error
    named = [*program.axes, *(f.axis for f in config.faults), *(e.axis for e in config.effects)]
    for axis in named:
        if not 1 <= axis <= count:
            msg = f"{path}: axis {axis} does not exist; the robot has axes 1 to {count}"
            raise ConfigError(msg)


_POSITIVE = (
    "ratio",
    "inertia_kgm2",
    "inductance_h",
    "bus_voltage_v",
    "current_limit_a",
    "torque_constant_nm_per_a",
    "pole_pairs",
    "stiffness_nm_per_rad",
    "width_rad",
    "velocity_rad_s",
    "integral_time_s",
    "time_constant_s",
    "electrical_hz_full_speed",
    "full_scale_a",
    "acceleration_rad_s2",
    "jerk_rad_s3",
)
_SIGNED = ("angle_rad", "ambient_c", "waypoints_rad", "acceleration_exponent")


def _numbers(part: Any, place: str) -> Iterator[tuple[str, float]]:
    """Every number of a dataclass with its place."""
    if is_dataclass(part):
        for item in fields(part):
            yield from _numbers(getattr(part, item.name), f"{place}.{item.name}")
    elif isinstance(part, tuple):
        for index, value in enumerate(part):
            # way points are one list, joints are many parts
            yield from _numbers(value, f"{place}[{index}]" if is_dataclass(value) else place)
    elif isinstance(part, int | float):
        yield place, float(part)
