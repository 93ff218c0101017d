"""S(t) over one cycle of the baseline with its segments (thesis Figure 3-3)."""

from opamc_cli.stages.report.figure import Figure
from opamc_cli.stages.report.focus import Focus
from opamc_cli.stages.report.inputs import NothingToDrawError, ReportInputs


def figure(inputs: ReportInputs, focus: Focus) -> Figure:
    """Draw the current and its motion signal, segments shaded."""
    msg = "not yet"
    raise NothingToDrawError(msg)
