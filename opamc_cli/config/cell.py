"""`cell.yaml`: the robots that `opamc nightly` looks after, where their logs lie, when to alarm."""

import re
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, field_validator, model_validator

from opamc_cli.config.files import read_yaml, validate
from opamc_cli.config.models import Config, Positive, Section
from opamc_cli.config.reading import shown
from opamc_cli.errors import ConfigError

ROBOT, NIGHT = "{robot}", "{night}"

Count = Annotated[int, Field(ge=1)]
RobotName = Annotated[str, Field(pattern=r"^[^/\\\x00-\x1f.][^/\\\x00-\x1f]*$")]
"""A robot's results are a folder of its name."""


class RobotConfig(Section):
    """What differs for one robot."""

    axes: Annotated[tuple[Count, ...], Field(min_length=1)] | None = Field(
        None, description="Joints that are watched; null: all."
    )
    set: dict[str, Any] = Field(
        {}, description="Options of the diagnosis, such as joint.pole_pairs."
    )


class BaselineConfig(Section):
    """Which nights are the healthy state."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)

    nights: Annotated[int, Field(ge=2, le=365)] | None = Field(
        None, description="The first so many nights of each program and condition."
    )
    first: date | None = Field(None, alias="from", description="First night of a fixed baseline.")
    last: date | None = Field(None, alias="to", description="Last night of a fixed baseline.")
    runs: str | None = Field(None, description="Files of a fixed baseline, {robot} in their path.")

    @model_validator(mode="after")
    def _says_one_thing(self) -> Self:
        dates = self.first is not None or self.last is not None
        if (self.nights is not None) + dates + (self.runs is not None) != 1:
            msg = "give either nights, or from and to, or runs"
            raise ValueError(msg)
        if dates and (self.first is None or self.last is None or self.first > self.last):
            msg = "from and to must both be given, from not after to"
            raise ValueError(msg)
        return self


class AlarmConfig(Section):
    """When a joint is worth a mechanic's walk."""

    nights: Count = Field(2, description="Nights with a signal that make an alarm ...")
    of: Annotated[int, Field(ge=1, le=365)] = Field(
        3, description="... among so many judged nights."
    )
    # the largest effects seen are 2 to 3: above 10 per cent were meant
    gross: Annotated[float, Field(gt=0, le=10)] = Field(
        0.9, description="One night at fault with an effect above is enough."
    )
    remind_after: Count = Field(7, description="Nights after which a standing alarm is repeated.")

    @model_validator(mode="after")
    def _can_be_reached(self) -> Self:
        if self.nights > self.of:
            msg = f"nights is {self.nights}, of is {self.of}: it could never be reached"
            raise ValueError(msg)
        return self


class KeepConfig(Section):
    """How long outputs are kept; the history is never pruned."""

    reports: Count = Field(30, description="Nights of each robot whose folder is kept.")


class LimitsConfig(Section):
    """What one robot's night may cost before it is given up."""

    seconds: Positive = Field(3600.0, description="Longest time that one robot's night may take.")
    memory_gb: Positive | None = Field(
        4.0, description="Most memory beyond that of the program itself; null: no limit."
    )


class CellConfig(Section):
    """A cell of robots."""

    runs: str = Field(description="Path of the recordings, with {robot} and maybe {night} in it.")
    robots: Literal["auto"] | dict[RobotName, RobotConfig | None] = Field(
        "auto", description="Robots by name; auto: every name that is found in place of {robot}."
    )
    set: dict[str, Any] = Field({}, description="Options of the diagnosis of every robot.")
    baseline: BaselineConfig = BaselineConfig(nights=6)
    out: Path = Field(Path("nightly"), description="Folder below which everything is written.")
    alarm: AlarmConfig = AlarmConfig()
    keep: KeepConfig = KeepConfig()
    limits: LimitsConfig = LimitsConfig()

    @field_validator("robots", mode="before")
    @classmethod
    def _are_named(cls, robots: Any) -> Any:
        if robots == "auto":
            return robots
        if not isinstance(robots, Mapping) or not robots:
            msg = "write auto, or every robot as a key: {r1: {}, r2: {axes: [1, 2]}}"
            raise ValueError(msg)
        for name in robots:
            if not isinstance(name, str):
                msg = f"the name {shown(name)} is read as a number; put it in quotes"
                raise ValueError(msg)
        return robots

    @model_validator(mode="after")
    def _names_the_robot(self) -> Self:
        for name, pattern in (("runs", self.runs), ("baseline.runs", self.baseline.runs)):
            if pattern is None:
                continue
            if ROBOT not in pattern and (name == "runs" or self.robots == "auto"):
                needed = "it needs {robot} in the place of the robot's name"
                msg = f"{name} is {shown(pattern)}; {needed}"
                raise ValueError(msg)
            unknown = set(re.findall(r"\{[^}]*\}", pattern)) - {ROBOT, NIGHT}
            if unknown:
                msg = f"{name} holds {shown(sorted(unknown)[0])}; known are {{robot}} and {{night}}"
                raise ValueError(msg)
        return self

    def axes_of(self, robot: str) -> tuple[int, ...] | None:
        """Return the joints of a robot that are watched, None for all."""
        return self._of(robot).axes

    def diagnosis_of(self, robot: str, source: str) -> Config:
        """Return the options of a robot's diagnosis.

        Raises
        ------
        ConfigError
            If a key or value is not allowed.
        """
        values: dict[str, Any] = {}
        own = self._of(robot).set
        where = f"{source}: robots.{robot}.set" if own else f"{source}: set"
        for options in (self.set, own):
            for key, value in options.items():
                _set(values, key, value, where)
        return validate(Config, values, where)

    def _of(self, robot: str) -> RobotConfig:
        named: Mapping[str, RobotConfig | None] = {} if self.robots == "auto" else self.robots
        return named.get(robot) or RobotConfig()


def load_cell(path: Path) -> CellConfig:
    """Return the cell of a YAML file, its relative paths counted from the file.

    Raises
    ------
    ConfigError
        If the file cannot be read, or a key or value is not allowed.
    """
    cell = validate(CellConfig, read_yaml(path), str(path))
    out = path.parent / cell.out
    if out.resolve() == Path(out.resolve().anchor):
        msg = f"{path}: out is {cell.out}, the root of all folders; name a folder for the results"
        raise ConfigError(msg)
    base = cell.baseline
    if base.runs is not None:
        base = base.model_copy(update={"runs": _beside(path, base.runs)})
    cell = cell.model_copy(
        update={
            "runs": _beside(path, cell.runs),
            "out": out,
            "baseline": base,
        }
    )
    for robot in ("", *(() if cell.robots == "auto" else cell.robots)):
        cell.diagnosis_of(robot, str(path))
    return cell


def _beside(path: Path, pattern: str) -> str:
    """Count a pattern's relative path from the file's folder; an address such as s3:// stays."""
    return pattern if "://" in pattern else (path.parent / pattern).as_posix()


def _set(values: dict[str, Any], key: str, value: Any, source: str) -> None:
    """Put `a.b: 1` or `a: {b: 1}` in its place."""
    if isinstance(value, Mapping):
        for name, inner in value.items():
            _set(values, f"{key}.{name}", inner, source)
        return
    *sections, last = key.split(".")
    for section in sections:
        values = values.setdefault(section, {})
        if not isinstance(values, dict):
            msg = f"{source}: {key!r} lies in no section of the configuration"
            raise ConfigError(msg)
    values[last] = value
