"""The model of a joint as its user declares it: `model.yaml`."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from opamc_cli.config.files import read_values, validate
from opamc_cli.config.models import JointConfig, Section
from opamc_cli.config.shipped import shipped_file


class DeclaredEffect(Section):
    """An effect with non-linear parameters, such as a ripple of a known order."""

    effect: str = Field(description="Name in the library.")
    parameters: dict[str, float] = Field(
        default_factory=dict, description="Non-linear parameters; found from the data if absent."
    )
    columns: tuple[Annotated[int, Field(ge=0)], ...] | None = Field(
        None, description="Regressors of the effect that are used; null: all."
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

    def declared(self) -> tuple[DeclaredEffect, ...]:
        """Return the effects, each with its parameters."""
        return tuple(
            DeclaredEffect(effect=entry) if isinstance(entry, str) else entry
            for entry in self.effects
        )


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
    model = validate(JointModelConfig, values, str(path))
    folder = file.parent
    return model.model_copy(
        update={"library": tuple((folder / file).resolve() for file in model.library)}
    )
