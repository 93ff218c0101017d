"""From a robot's history to its alarms and what is worth saying: a pure function of the nights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from opamc_cli.config.cell import AlarmConfig
from opamc_cli.decision.trend.alarm import Night, episodes
from opamc_cli.decision.trend.chart import CALM, LIMIT
from opamc_cli.stages.nightly.alarms.alarm import Watched, alarm_of
from opamc_cli.stages.nightly.alarms.course import JUDGED, chart_of, courses
from opamc_cli.stages.nightly.alarms.not_judged import (
    alone,
    excused,
    failed,
    not_judged,
    outside,
)
from opamc_cli.stages.nightly.alarms.several import said_once, together
from opamc_cli.storage.history.rows import AlarmRow, Declared, Event, NightRow, begun_anew

DIFFERS = 0.01
"""p-value up to which a night is no sign that an alarm is over: healthy nights have it in one of a
hundred. Of five worn joints that stayed as they were alarms ended after 10 to 16 nights, each later
night at 0.01 or below (docs/nightly.md)."""


@dataclass(frozen=True)
class Settled:
    """What follows from a robot's nights; see `History.settle`."""

    alarms: tuple[AlarmRow, ...]
    standing: tuple[tuple[str, int, str], ...]
    events: tuple[Event, ...]


def settle_robot(
    robot: str,
    series: Sequence[Mapping[str, Any]],
    nights: Sequence[NightRow],
    declared: Sequence[Declared],
    rule: AlarmConfig,
    fault_effect: float,
    baseline_nights: int,
) -> Settled:
    """Find a robot's alarms, and what is worth saying of it.

    Parameters
    ----------
    robot
        Its name.
    series
        Its verdicts and measures by program, axis and night, as `History.series` returns them.
    nights
        What became of its nights, in time order.
    declared
        What users declared of it.
    rule
        When nights make an alarm.
    fault_effect
        Effect from which a change is a fault.
    baseline_nights
        Nights of a baseline.
    """
    alarms: list[AlarmRow] = []
    standing: list[tuple[str, int, str]] = []
    events: list[Event] = []
    several = len({row["program"] for row in series}) > 1
    places: dict[str, list[Mapping[str, Any]]] = {}
    of_joints: list[tuple[str, Event]] = []
    for (program, axis), group in groupby(series, key=lambda row: (row["program"], row["axis"])):
        joint = list(group)
        where = f" in program {program}" if several else ""
        name = f"axis {axis}{where}"
        watched = Watched(name, declared, rule, fault_effect, baseline_nights)
        for rows, replaced in courses(joint):
            seen = _nights(rows, rule, fault_effect, baseline_nights)
            for found in episodes(seen, rule.nights, rule.of):
                raised = rows[found.raised]["night"]
                if found.cleared is not None:
                    ended = rows[found.cleared]["night"]
                else:
                    # a baseline that was declared is known before a night is judged against it
                    ended = _after_maintenance(raised, nights, declared) or replaced
                alarm, said = alarm_of(watched, rows, seen, found, ended)
                alarms.append(alarm)
                events += said
                standing += [
                    (program, axis, row["night"])
                    for row in joint
                    if raised <= row["night"] < (ended or "9999")
                ]
        under = {night for of, at, night in standing if (of, at) == (program, axis)}
        free = [row for row in joint if row["night"] not in under]
        for rows, _ in courses(joint):
            for stands, part in groupby(rows, key=lambda row: row["night"] in under):
                events += [] if stands else alone(list(part), name, rule, fault_effect)
        said = [
            *not_judged(joint, rule.remind_after),
            *excused(free, rule.remind_after),
            *outside(free, rule.remind_after),
        ]
        of_joints += [(where, one) for one in said]
        places.setdefault(where, []).extend(free)
    for where, free in places.items():
        moved, said = together(free, where, rule.remind_after)
        events += said
        of_joints = [
            (at, one)
            for at, one in of_joints
            if at != where or one.kind == "outside" or (one.axis, one.time) not in moved
        ]
    events += said_once(of_joints)
    events += failed(robot, nights, rule.remind_after)
    return Settled(tuple(alarms), tuple(dict.fromkeys(standing)), tuple(events))


def _nights(
    rows: Sequence[Mapping[str, Any]],
    rule: AlarmConfig,
    fault_effect: float,
    baseline_nights: int,
) -> list[Night]:
    averages = chart_of(rows, baseline_nights)
    found = []
    for row, average in zip(rows, averages.tolist(), strict=True):
        # a fault whose cause lies outside the joint is none of it; nights that only changed are
        # left to the chart: by chance a baseline is so even that every tenth night of it differs
        fault = row["state"] == "fault" and not row["harmless"]
        effect = row["effect"] or 0.0
        p = row["p_value"]
        found.append(
            Night(
                signal=fault or average > LIMIT,
                large=fault and effect >= fault_effect,
                gross=fault and effect > rule.gross,
                differs=p is not None and p <= DIFFERS and not row["harmless"],
                calm=not average > CALM,
                judged=row["state"] in JUDGED,
            )
        )
    return found


def _after_maintenance(
    raised: str, nights: Sequence[NightRow], declared: Sequence[Declared]
) -> str:
    """Return the first night of a baseline that was declared after an alarm; empty without one."""
    after = [night for _, night in begun_anew(declared) if night > raised]
    if not after:
        return ""
    # a date that is still to come, or was mistyped, silences nothing
    return next((row.night for row in nights if row.night >= min(after)), "")
