"""The model of a joint as its user declares it: `model.yaml`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import AfterValidator, Field, FiniteFloat

from opamc_cli.arm.torques import JointPlace, KinematicChain
from opamc_cli.config.files import read_values, read_yaml, validate
from opamc_cli.config.models import JointConfig, Section
from opamc_cli.config.shipped import shipped_file
from opamc_cli.errors import ConfigError

ARM = "arm"
"""The effect that `arm:` declares."""
OF_THE_ARM = ("gravity", "coupling")
"""What an arm's torques hold: neither declared by default nor searched beside them."""


class DeclaredEffect(Section):
    """An effect with non-linear parameters, such as a ripple of a known order."""

    effect: str = Field(description="Name in the library.")
    parameters: dict[str, FiniteFloat] = Field(
        default_factory=dict, description="Non-linear parameters; found from the data if absent."
    )
    coefficients: tuple[FiniteFloat, ...] | None = Field(
        None,
        description="Of a closed model, one per regressor; `opamc model evaluate` applies them, "
        "all else estimates them anew.",
    )
    columns: tuple[Annotated[int, Field(ge=0)], ...] | None = Field(
        None, description="Regressors of the effect that are used; null: all."
    )


class ClosedConfig(Section):
    """What a closed model knows of the recordings that it was closed on."""

    axis: Annotated[int, Field(ge=1)] | None = Field(
        None, description="That it was closed on, which `opamc model evaluate` takes; null: all."
    )
    unit: Literal["A", "Nm"] = Field("A", description="Of the current, or of a torque for it.")
    rmse: Annotated[float, Field(ge=0)] = Field(0.0, description="Error on the sealed data.")
    r2: float = Field(0.0, description="Share of the sealed data's variance that it explains.")
    speed_rad_s: Annotated[float, Field(gt=0)] = Field(
        1.0, description="Speed by which regressors are measured."
    )
    temperature_c: float | None = Field(None, description="Likewise a temperature.")
    opposite_sign: bool | None = Field(
        None, description="Whether the negative of the logged current was modelled; null: find out."
    )
    regressors: tuple[tuple[FiniteFloat, ...], ...] | None = Field(
        None,
        description="Upper triangular root of the mean products of the regressors, lines left out, "
        "row by row from the diagonal on: where `opamc model evaluate` is on known ground.",
    )


Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]


def _direction(vector: Vector) -> Vector:
    if not any(vector):
        msg = "[0, 0, 0] is no direction; write one, such as [0, 0, 1]"
        raise ValueError(msg)
    return vector


Direction = Annotated[Vector, AfterValidator(_direction)]


class ArmJoint(Section):
    """A joint as in a robot's URDF: its `origin` in the frame of the joint before, and its axis."""

    xyz: Vector = Field((0.0, 0.0, 0.0), description="Origin, in m.")
    rpy: Vector = Field((0.0, 0.0, 0.0), description="Roll, pitch, yaw of the frame, in rad.")
    axis: Direction = Field((0.0, 0.0, 1.0), description="Which way it turns, in that frame.")


class ArmConfig(Section):
    """Where the joints of an arm are."""

    joints: tuple[ArmJoint, ...] = Field(
        min_length=1, description="Of axis 1, 2, ...; tool and payload belong to the last link."
    )
    up: Direction = Field(
        (0.0, 0.0, 1.0), description="In the base's frame; [0, 0, -1] hangs from the ceiling."
    )

    def chain(self) -> KinematicChain:
        """Return the same as the science takes it."""
        places = (JointPlace(one.xyz, one.rpy, one.axis) for one in self.joints)
        return KinematicChain(tuple(places), self.up)


class JointModelConfig(Section):
    """Content of `model.yaml`."""

    joint: JointConfig = JointConfig()
    effects: tuple[str | DeclaredEffect, ...] = Field(
        ("inertia", "gravity", "coulomb", "viscous"),
        description="What the model holds; names, or names with parameters.",
    )
    arm: ArmConfig | None = Field(
        None,
        description="Where the joints of the arm are, or a file whose `arm` tells: its torques "
        "are declared in place of gravity.",
    )
    library: tuple[Path, ...] = Field(
        (), description="Python files with effects of your own, relative to this file."
    )
    without: tuple[str, ...] = Field(
        (), description="Effects of the library that the loop must not use."
    )
    closed: ClosedConfig | None = Field(None, description="Written by `opamc model close`.")

    def declared(self) -> tuple[DeclaredEffect, ...]:
        """Return the effects, each with its parameters; an arm's torques are one."""
        named = tuple(
            DeclaredEffect(effect=entry) if isinstance(entry, str) else entry
            for entry in self.effects
        )
        if self.arm is None or ARM in {entry.effect for entry in named}:
            return named
        beside = (entry for entry in named if entry.effect not in OF_THE_ARM)
        return (DeclaredEffect(effect=ARM), *beside)

    def not_searched(self) -> tuple[str, ...]:
        """Return the effects that the loop must not use."""
        return self.without if self.arm is None else (*self.without, *OF_THE_ARM)


def line_naming(path: Path, name: str) -> int | None:
    """Return the line of a model's file that names an effect, counted from 1; None: no line."""
    try:
        root = yaml.compose(
            shipped_file(path, "configs").read_text("utf-8"), Loader=yaml.SafeLoader
        )
    except (OSError, UnicodeError, yaml.YAMLError):
        return None
    waiting = [root] if root else []
    while waiting:
        node = waiting.pop()
        if isinstance(node, yaml.ScalarNode) and node.value == name:
            return int(node.start_mark.line) + 1
        if isinstance(node, yaml.MappingNode):
            waiting += [part for pair in reversed(node.value) for part in reversed(pair)]
        elif isinstance(node, yaml.SequenceNode):
            waiting += reversed(node.value)
    return None


def load_joint_model(path: Path, overrides: Sequence[str] = ()) -> JointModelConfig:
    """Return the model that a YAML file, or a shipped one by its name, declares.

    Parameters
    ----------
    path
        The file.
    overrides
        Such as ``joint.gear_ratio=100``.

    Raises
    ------
    ConfigError
        If the file cannot be read, or a key or value is not allowed.
    """
    file = shipped_file(path, "configs")
    values: dict[str, Any] = read_values(file, overrides)
    folder = file.parent
    if isinstance(named := values.get(ARM), str):
        by_hand = any(override.partition("=")[0] == ARM for override in overrides)
        values[ARM] = _arm_of(Path(named) if by_hand else folder / named)
    model = validate(JointModelConfig, values, str(path), overrides)
    return model.model_copy(
        update={"library": tuple((folder / file).resolve() for file in model.library)}
    )


def _arm_of(file: Path) -> Any:
    """Return what a file says of an arm; its own `arm` must not name another file."""
    told = read_yaml(file).get(ARM)
    if not isinstance(told, dict):
        msg = f"{file}: has no `arm` that tells where the joints are; `opamc model arm` finds them"
        raise ConfigError(msg)
    return validate(ArmConfig, told, f"{file}: {ARM}").model_dump()
