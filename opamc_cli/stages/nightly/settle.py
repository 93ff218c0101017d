"""What follows from the history: alarms, what is worth saying, old folders, pages and metrics."""

from collections.abc import Iterator, Mapping, Sequence

from opamc_cli.config.cell import CellConfig
from opamc_cli.config.models import digest
from opamc_cli.stages.nightly.alarms import LIMIT, said_in, settle_robot
from opamc_cli.stages.nightly.plan import NIGHTS_AGAIN
from opamc_cli.stages.nightly.publish.metrics import write_metrics
from opamc_cli.stages.nightly.publish.page import write_page
from opamc_cli.stages.nightly.summary import Summary, summarise
from opamc_cli.storage.files.folders import remove_folder
from opamc_cli.storage.history import Event, History, NightRow
from opamc_cli.storage.schemas import files

OF_NIGHT = frozenset({files.VERDICT, files.REPORT})
"""All that a night's folder holds."""


def settle_cell(
    cell: CellConfig, source: str, history: History, robots: Sequence[str], *, whole: bool = False
) -> Summary:
    """Bring everything that follows from the nights up to date.

    Parameters
    ----------
    cell
        What is looked after.
    source
        Name of its file, for errors.
    history
        Of the cell.
    robots
        Those that were looked at.
    whole
        Whether all nights of all robots were: only then a night that is not known is missing.

    Returns
    -------
    Summary
        How all robots of the cell stand now.
    """
    history.apply_rule(digest({**cell.alarm.model_dump(), "limit": LIMIT}))
    by_robot: dict[str, list[NightRow]] = {}
    for row in sorted(history.nights().values(), key=lambda row: (row.robot, row.night)):
        by_robot.setdefault(row.robot, []).append(row)
    for robot in history.stale():
        config = cell.diagnosis_of(robot, source)
        settled = settle_robot(
            robot,
            history.series(robot),
            by_robot.get(robot, []),
            history.declared(robot),
            cell.alarm,
            config.score.fault_effect,
            cell.baseline.nights or NIGHTS_AGAIN,
        )
        history.settle(robot, settled.alarms, settled.standing, settled.events)
    if whole:
        history.replace_missing(_missing(by_robot, set(robots), cell.alarm.remind_after))
    _prune(cell, history)
    summary = summarise(history, robots)
    if cell.robots != "auto":  # what left the cell is no concern of its page
        summary = summary.only(tuple(cell.robots))
    write_page(cell, history, summary)
    write_metrics(cell, summary)
    return summary


def _missing(
    by_robot: Mapping[str, Sequence[NightRow]], robots: set[str], remind_after: int
) -> Iterator[Event]:
    """Say which robots have no file of nights of which others have, and again while they lack."""
    nights = sorted({row.night for rows in by_robot.values() for row in rows})
    for robot in sorted(robots | set(by_robot)):
        own = {row.night for row in by_robot.get(robot, ())}
        if not own:
            yield Event(nights[0] if nights else "", robot, None, "missing", "no file at all")
            continue
        gap: list[str] = []
        for night in [*(n for n in nights if n > min(own)), ""]:
            if night and night not in own:
                gap.append(night)
            elif gap:
                span = gap[0] if len(gap) == 1 else f"{gap[0]} to {gap[-1]}"
                text = f"no file of {span}; others have some"
                for index in said_in(gap, [""] * len(gap), remind_after):
                    yield Event(gap[index], robot, None, "missing", text)
                gap = []


def _prune(cell: CellConfig, history: History) -> None:
    """Remove the folders of all but a robot's last nights; the history keeps what they said."""
    kept: dict[str, list[str]] = {}
    query = "SELECT DISTINCT robot, night FROM verdict WHERE report IS NOT NULL ORDER BY night"
    for row in history.rows(query):
        kept.setdefault(row["robot"], []).append(row["night"])
    for robot, nights in kept.items():
        old = nights[: -cell.keep.reports]
        for night in old:
            remove_folder(cell.out / robot / night, of=OF_NIGHT)
        if old:  # only then: a start that was killed finds them again
            history.forget_reports(robot, old)
