"""One pydantic model per stage, read from YAML."""

from opamc_cli.config.files import load_config
from opamc_cli.config.models import Config

__all__ = ["Config", "load_config"]
