"""`opamc config`: show the effective configuration, check a file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from opamc_cli.commands.terminal.options import ConfigFile, Json, Overrides
from opamc_cli.commands.terminal.output import Output

if TYPE_CHECKING:
    from pydantic import BaseModel

app = typer.Typer(help="Show or check the configuration.", no_args_is_help=True)


@app.command()
def show(config: ConfigFile = None, overrides: Overrides = None, as_json: Json = False) -> None:
    """Print the effective configuration, every key with what it does."""
    from opamc_cli.config import load_config
    from opamc_cli.config.yaml.document import to_yaml

    effective = load_config(config, overrides or ())
    if as_json:
        Output(as_json=True).result(effective.canonical())
    else:
        typer.echo(to_yaml(effective), nl=False)


@app.command()
def check(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="Options, a testbed, a map, a joint's model or a cell: told by its keys.",
        ),
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    as_json: Json = False,
) -> None:
    """Check a file or options; exit 2 with the first key that is wrong."""
    from opamc_cli.config import load_config
    from opamc_cli.config.files import read_values
    from opamc_cli.config.yaml.kinds import USES, kind_of
    from opamc_cli.errors import UsageError
    from opamc_cli.storage.ingest.map.axes import as_written, protect

    if file is not None and config is not None:
        msg = f"check {file} or {config}, one at a time"
        raise UsageError(msg)
    kind = "configuration"
    if file is not None:
        with as_written():
            kind = kind_of(read_values(file, overrides or (), protect)) or "configuration"
    if file is None or kind == "configuration":
        effective = load_config(file or config, overrides or ())
        values = {"valid": True, "kind": kind, "config_hash": effective.digest()}
        Output(as_json).result(values, f"valid, hash {effective.digest()}")
        return
    _checked(kind, file, overrides or [])
    Output(as_json).result({"valid": True, "kind": kind}, f"valid: {USES[kind]}")


def _checked(kind: str, file: Path, overrides: list[str]) -> "BaseModel":
    """Return a document that is not the options of the stages, or say what is wrong with it."""
    from opamc_cli.config.cell import load_cell
    from opamc_cli.config.joint_model import load_joint_model
    from opamc_cli.config.testbed import load_testbed
    from opamc_cli.storage.ingest.map.load import load_map

    if kind == "testbed":
        return load_testbed(file, overrides)
    if kind == "map":
        return load_map(file, overrides)
    if kind == "cell":
        return load_cell(file)
    return load_joint_model(file, overrides)


@app.command()
def schema(
    document: Annotated[str, typer.Argument(metavar="verdict|loop", help="Which document.")],
) -> None:
    """Print the JSON schema of verdict.json or loop.json."""
    from importlib import resources

    from opamc_cli.errors import UsageError

    name = f"{document.removesuffix('.json')}.schema.json"
    if name not in ("verdict.schema.json", "loop.schema.json"):
        msg = f"schema {document}: write verdict or loop"
        raise UsageError(msg)
    typer.echo(
        resources.files("opamc_cli.storage.schemas").joinpath(name).read_text("utf-8"), nl=False
    )
