"""The model of a joint as its user declares it: `model.yaml`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import Field, FiniteFloat

from opamc_cli.config.files import read_values, validate
from opamc_cli.config.models import JointConfig, Section
from opamc_cli.config.shipped import shipped_file


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


class JointModelConfig(Section):
    """Content of `model.yaml`."""

    joint: JointConfig = JointConfig()
    effects: tuple[str | DeclaredEffect, ...] = Field(
        ("inertia", "gravity", "coulomb", "viscous"),
        description="What the model holds; names, or names with parameters.",
    )
    library: tuple[Path, ...] = Field(
        (), description="Python files with effects of your own, relative to this file."
    )
    without: tuple[str, ...] = Field(
        (), description="Effects of the library that the loop must not use."
    )
    closed: ClosedConfig | None = Field(None, description="Written by `opamc model close`.")

    def declared(self) -> tuple[DeclaredEffect, ...]:
        """Return the effects, each with its parameters."""
        return tuple(
            DeclaredEffect(effect=entry) if isinstance(entry, str) else entry
            for entry in self.effects
        )


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
    model = validate(JointModelConfig, values, str(path), overrides)
    folder = file.parent
    return model.model_copy(
        update={"library": tuple((folder / file).resolve() for file in model.library)}
    )
