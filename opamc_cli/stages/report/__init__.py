"""Stage `report`: tables and verdict in, one HTML file out."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from opamc_cli.stages.report.assemble import ReportOutcome, render, run

__all__ = ["ReportOutcome", "render", "run"]


def __getattr__(name: str) -> Any:
    """Load the figures only for who draws them: matplotlib takes a second."""
    if name not in __all__:
        msg = f"module {__name__!r} has no attribute {name!r}"
        raise AttributeError(msg)
    from opamc_cli.stages.report import assemble

    return getattr(assemble, name)
