"""Which robots have no file of nights of which others have."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import date, timedelta
from itertools import accumulate
from operator import or_

from opamc_cli.stages.nightly.alarms.commands import ACKNOWLEDGE
from opamc_cli.stages.nightly.alarms.not_judged import said_in
from opamc_cli.stages.nightly.inputs.recordings import some
from opamc_cli.storage.history.rows import Event, NightRow

REST_WEEKS = 4
"""Weeks in a row after which a weekday without files, such as Sunday, is the robot's habit."""

HOW_TO_END = f"if they are to have none: {ACKNOWLEDGE}"
"""What ends that a robot counts as missing, beside its files."""


def missing(
    by_robot: Mapping[str, Sequence[NightRow]],
    gone: Mapping[str, str],
    remind_after: int,
    may_begin: Callable[[str, str], bool] = lambda robot, night: False,
) -> Iterator[Event]:
    """Say which robots have no file of nights of which others have, and again while they lack.

    Of nights in which `may_begin` says that a robot may record yet nothing is said.

    A robot of which somebody has said that it is gone is not reminded of until it has files again;
    nor is it said of weekdays on which it rests, as long as it has files again after them.
    """
    nights = sorted({night for rows in by_robot.values() for night in _recorded(rows)})
    for robot in sorted(by_robot):
        own = {row.night for row in by_robot[robot] if row.night}
        if not own and by_robot[robot]:
            continue  # all its files tell no night, which is said
        if not own:
            if robot not in gone:
                first, text = min(nights, default=""), f"no file at all; {HOW_TO_END}"
                yield Event(first, robot, None, "missing", text)
            continue
        watched = [n for n in nights if n > min(own) and (n in own or not may_begin(robot, n))]
        lacking = {*watched} - own
        gap: list[str] = []
        for night in [*watched, ""]:
            if night in lacking:
                gap.append(night)
            elif gap:
                span = gap[0] if len(gap) == 1 else f"{gap[0]} to {gap[-1]}"
                text = f"no file of {span}; others have some"
                weeks = min(_weeks_before(one, lacking, own) for one in gap)
                if weeks == REST_WEEKS - 1:
                    text += f", as in the {weeks} weeks before; this weekday is not said again"
                # Of a robot that had recorded for a year there would be other nights about it.
                days = {one[5:] for one in gap}
                first = min((one for one in own if one[5:] not in days), default=gap[0])
                if years := sorted(one for one in own if one[5:] in days and one < first):
                    text += f"; it has files of {some(years)}: is its clock a year off?"
                if not night:
                    text += f"; {HOW_TO_END}"
                # a free Saturday is no news that the robot is dead on Monday, too
                reach = accumulate((_records_on(n, gap[0], lacking, own) for n in gap), or_)
                for index in said_in(gap, [str(one) for one in reach], remind_after):
                    known = gap[0] <= gone.get(robot, "") <= gap[index]
                    if not known and weeks < REST_WEEKS:
                        yield Event(gap[index], robot, None, "missing", text)
                gap = []


def _records_on(night: str, begin: str, lacking: set[str], own: set[str]) -> bool:
    """Return whether a robot has recorded on a night's weekday in the weeks before a gap begins.

    And lacked none of these. A weekday that it has not had yet may be free; within a week comes
    one that it has had.
    """
    day = date.fromisoformat(night)
    weeks = {(day - timedelta(7 * n)).isoformat() for n in range(1, REST_WEEKS + 1)}
    before = {one for one in weeks if one < begin}
    return not own.isdisjoint(before) and lacking.isdisjoint(before)


def _weeks_before(night: str, lacking: set[str], own: set[str]) -> int:
    """Return for how many weeks in a row a robot has rested on a night's weekday until then.

    Weeks in which it has no file at all are none of rest. At most `REST_WEEKS` are counted.
    """
    day = date.fromisoformat(night)
    for n in range(REST_WEEKS):
        week = [(day - timedelta(7 * n + k)).isoformat() for k in range(1, 8)]
        if week[-1] not in lacking or own.isdisjoint(week):
            return n
    return REST_WEEKS


def _recorded(rows: Sequence[NightRow]) -> Iterator[str]:
    """Yield a robot's nights but those that are copies of earlier ones: nobody knows of these."""
    known: set[str] = set()
    for row in rows:
        contents = {one.rpartition(" ")[2] for one in json.loads(row.key)["files"]}
        if row.night and not contents <= known:
            yield row.night
        known |= contents
