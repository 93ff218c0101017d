"""Stage `report`: tables and verdict in, one HTML file out."""

from opamc_cli.stages.report.assemble import ReportOutcome, render, run

__all__ = ["ReportOutcome", "render", "run"]
