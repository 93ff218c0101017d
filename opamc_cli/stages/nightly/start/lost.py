"""Says of a history that was lost what its results still tell; nothing is made from them."""

import json
from pathlib import Path

from opamc_cli.config.cell import CellConfig
from opamc_cli.stages.nightly.inputs.recordings import some
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.layout import NIGHT
from opamc_cli.storage.history.rows import THE_CELL, Event
from opamc_cli.storage.schemas import files


def say_lost(cell: CellConfig, history: History) -> None:
    """Keep as news that there are results of nights of which a new history knows nothing.

    It is asked before any file is remembered: a start that was killed at its first night has
    results without their records, and has lost nothing.
    """
    if not history.is_new():
        return
    found = sorted(
        (one.parent.name, one.parent.parent.name, one)
        for one in cell.out.glob(f"*/*/{files.VERDICT}")
        if NIGHT.fullmatch(one.parent.name)
    )
    if not found:
        return
    faulty = [f"{robot} {night}" for night, robot, path in reversed(found) if _has_fault(path)]
    with_fault = f"{len(faulty)} with a fault: {some(faulty)}" if faulty else "none with a fault"
    nights = "1 earlier night" if len(found) == 1 else f"{len(found)} earlier nights"
    text = f"no history here, but results of {nights}, {with_fault}; "
    text += (
        "alarms of before are not known, nor what was acknowledged and which baselines were begun "
        f"anew: put {files.HISTORY} back from a copy, or declare that again"
    )
    history.record_news(Event(found[-1][0], THE_CELL, None, "lost", text))


def _has_fault(path: Path) -> bool:
    """Whether a verdict tells a fault; one that cannot be read tells none."""
    try:
        axes = json.loads(path.read_bytes())["axes"]
        return any(axis["state"] == "fault" for axis in axes)
    except (OSError, ValueError, LookupError, TypeError):
        return False
