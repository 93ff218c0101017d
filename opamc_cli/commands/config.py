"""`opamc config`: show the effective configuration, check a file."""

import typer

from opamc_cli.commands.options import ConfigFile, Json, Overrides
from opamc_cli.commands.output import Output

app = typer.Typer(help="Show or check the configuration.", no_args_is_help=True)


@app.command()
def show(config: ConfigFile = None, overrides: Overrides = None, as_json: Json = False) -> None:
    """Print the effective configuration, every key with what it does."""
    from opamc_cli.config import load_config
    from opamc_cli.config.document import to_yaml

    effective = load_config(config, overrides or ())
    if as_json:
        Output(as_json=True).result(effective.canonical())
    else:
        typer.echo(to_yaml(effective), nl=False)


@app.command()
def check(config: ConfigFile = None, overrides: Overrides = None, as_json: Json = False) -> None:
    """Check a configuration; exit 2 with the first key that is wrong."""
    from opamc_cli.config import load_config

    effective = load_config(config, overrides or ())
    Output(as_json=as_json).result(
        {"valid": True, "config_hash": effective.digest()}, f"valid, hash {effective.digest()}"
    )
