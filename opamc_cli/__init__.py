"""Health of robot-arm joints with strain wave gearing, told from motor current.

For notebooks: ``from opamc_cli import diagnose, close_loop, read_run, …``; see docs/method.md.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from opamc_cli.api import (
        close_loop,
        diagnose,
        identify,
        patterns,
        read_run,
        read_table,
        score,
        segment,
    )

__version__ = "0.3.0"
__all__ = [
    "close_loop",
    "diagnose",
    "identify",
    "patterns",
    "read_run",
    "read_table",
    "score",
    "segment",
]


def __getattr__(name: str) -> Any:
    """Load a function when it is asked for: the command starts without numpy."""
    if name not in __all__:
        msg = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(msg)
    from opamc_cli import api

    return getattr(api, name)
