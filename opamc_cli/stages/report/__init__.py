"""Stage `report`: tables and verdict in, one HTML file out."""

from opamc_cli.stages.report.assemble import FILE_NAME, ReportOutcome, render, run

__all__ = ["FILE_NAME", "ReportOutcome", "render", "run"]
