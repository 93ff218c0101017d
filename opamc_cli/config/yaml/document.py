"""A configuration as YAML, each key under the comment that explains it."""

import textwrap
from typing import Any

from pydantic import BaseModel

from opamc_cli.config.yaml.values import yaml_of


def to_yaml(model: BaseModel) -> str:
    """Return a configuration as YAML with a comment above every key."""
    lines: list[str] = []
    for name, field in type(model).model_fields.items():
        section = getattr(model, name)
        if isinstance(section, BaseModel):
            lines += ["", f"# {(type(section).__doc__ or '').strip().splitlines()[0]}", f"{name}:"]
            lines += textwrap.indent(to_yaml(section), "  ").splitlines()
        else:
            lines += textwrap.wrap(
                field.description or "", 90, initial_indent="# ", subsequent_indent="# "
            )
            lines.append(f"{name}: {_flow(section)}")
    return "\n".join(lines).lstrip("\n") + "\n"


def _flow(value: Any) -> str:
    plain = list(value) if isinstance(value, tuple) else value
    text = yaml_of(plain, default_flow_style=True, width=10_000)
    return text.removesuffix("...\n").strip()
