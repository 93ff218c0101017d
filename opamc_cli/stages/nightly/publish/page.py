"""index.html: the whole cell on one page, one row per robot and joint, without a network.

Thousands of rows travel as one compact JSON object and are drawn as they are looked at: 2000 robots
of six joints are some 1.3 MB. What needs a look stands in the page itself, without a script.
"""

from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

from opamc_cli.config.cell import CellConfig
from opamc_cli.stages.nightly.summary import SEVERITY, Summary
from opamc_cli.stages.report.figures.palette import custom_properties, state_role, state_sign
from opamc_cli.stages.report.templates import environment
from opamc_cli.storage.files.atomic import write_text
from opamc_cli.storage.history.history import History
from opamc_cli.storage.schemas import files

NIGHTS_SHOWN = 30
"""Width of a sparkline: a month."""

MOST_CARDS = 50
"""Robots whose alarms stand above the table; more are found by its filter."""

DIGITS = "0123456789abcdefghijklmnopqrstuvwxyz"
PER_UNIT, LOWEST = 10, -0.5
"""A sparkline's scale: a tenth of a log distance per digit, from half below healthy nights."""

MORE_STATES = {
    "alarm": ("!", "fault"),
    "known": ("!", "changed"),
    "failed": ("–", "unknown"),
    "missing": ("–", "unknown"),
    "gathering": ("…", "unknown"),
    "partial": ("–", "unknown"),
    "gone": ("–", "unknown"),
    "baseline": ("…", "baseline"),
    "excused": ("?", "unknown"),
}
"""Sign and colour of what a verdict knows nothing of."""


def write_page(cell: CellConfig, history: History, summary: Summary) -> None:
    """Write the cell's page, unless it is as it was."""
    path = cell.out / files.PAGE
    page = render(history, summary)
    if not path.is_file() or path.read_text(encoding="utf-8") != page:
        write_text(path, page)


def render(history: History, summary: Summary) -> str:
    """Return the page of a cell."""
    nights = [
        row["night"]
        for row in history.rows(
            "SELECT DISTINCT night FROM night ORDER BY night DESC LIMIT ?", (NIGHTS_SHOWN,)
        )
    ][::-1]
    template = environment(_resource).get_template("index.html.j2")
    return template.render(
        styles=custom_properties() + "\n" + _resource("index.css"),
        script=_resource("index.js"),
        headline=summary.headline(),
        until=nights[-1] if nights else "",
        cards=summary.needing()[:MOST_CARDS],
        lately=[(robot.name, one) for robot in summary.robots for one in robot.lately][:MOST_CARDS],
        more=max(0, len(summary.needing()) - MOST_CARDS),
        data=_data(history, summary, nights),
    )


def _data(history: History, summary: Summary, nights: Sequence[str]) -> dict[str, Any]:
    """Return what the page's script draws: robots, and of each its rows."""
    sparks = _sparks(history, nights)
    robots = []
    for robot in summary.robots:
        rows = [
            [
                joint.axis,
                SEVERITY.index(robot.shown_of(joint)),
                joint.since,
                joint.night,
                joint.report,
                sparks.get((robot.name, joint.program, joint.axis), ""),
                joint.program if robot.several_programs else "",
            ]
            for joint in robot.joints
        ]
        if not rows:
            rows = [[0, SEVERITY.index(robot.shown), "", robot.last_night, "", "", ""]]
        robots.append([robot.name, rows])
    return {
        "nights": list(nights),
        "states": [
            [name, *MORE_STATES.get(name, (state_sign(name), state_role(name)))]
            for name in SEVERITY
        ],
        "robots": robots,
        "scale": [PER_UNIT, LOWEST],
    }


def _sparks(history: History, nights: Sequence[str]) -> Mapping[tuple[str, str, int], str]:
    """Return each joint's log distances as one digit per night; a dot where there is none."""
    if not nights:
        return {}
    place = {night: index for index, night in enumerate(nights)}
    found: dict[tuple[str, str, int], list[str]] = {}
    query = "SELECT robot, program, axis, night, distance FROM measure WHERE night >= ?"
    for row in history.rows(query, (nights[0],)):
        key = (row["robot"], row["program"], row["axis"])
        line = found.setdefault(key, ["."] * len(nights))
        # a measure that somebody moved to another night stands nowhere
        if row["distance"] is not None and row["night"] in place:
            level = round((row["distance"] - LOWEST) * PER_UNIT)
            line[place[row["night"]]] = DIGITS[min(max(level, 0), len(DIGITS) - 1)]
    return {key: "".join(line) for key, line in found.items()}


def _resource(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
