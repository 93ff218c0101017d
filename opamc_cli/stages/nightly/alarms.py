"""From a robot's history to its alarms and what is worth saying: a pure function of the nights."""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from opamc_cli.config.cell import AlarmConfig
from opamc_cli.decision.trend.alarm import Episode, Night, episodes
from opamc_cli.decision.trend.chart import CALM, LIMIT, control_chart, usual_nights
from opamc_cli.decision.trend.onset import onset
from opamc_cli.decision.trend.slope import Slope, nights_until, robust_slope, slope_of_spread
from opamc_cli.decision.trend.temperature import without_temperature
from opamc_cli.stages.nightly.inputs.baseline_name import condition_in
from opamc_cli.storage.history import (
    UNJUDGED,
    AlarmRow,
    Declared,
    Event,
    NightRow,
    begun_anew,
)

MOST_NIGHTS = 365
"""Nights that the beginning of a change is sought in."""

JUDGED = ("healthy", "changed", "fault")


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
    for (program, axis), group in groupby(series, key=lambda row: (row["program"], row["axis"])):
        joint = list(group)
        name = f"axis {axis}" + (f" in program {program}" if several else "")
        for rows, replaced in _courses(joint):
            seen = _nights(rows, rule, baseline_nights)
            for found in episodes(seen, rule.nights, rule.of):
                raised = rows[found.raised]["night"]
                if found.cleared is not None:
                    ended = rows[found.cleared]["night"]
                else:
                    # a baseline that was declared is known before a night is judged against it
                    ended = _after_maintenance(raised, nights, declared) or replaced
                signal = _first_signal(seen, found.raised, rule.of)
                alarm, said = _alarm(
                    rows,
                    found,
                    ended,
                    signal,
                    name,
                    declared,
                    rule,
                    fault_effect,
                    baseline_nights,
                )
                alarms.append(alarm)
                events += said
                standing += [
                    (program, axis, row["night"])
                    for row in joint
                    if raised <= row["night"] < (ended or "9999")
                ]
        events += _not_judged(joint, name, rule.remind_after)
    events += _failed(robot, nights, rule.remind_after)
    return Settled(tuple(alarms), tuple(dict.fromkeys(standing)), tuple(events))


def chart_of(rows: Sequence[Mapping[str, Any]], baseline_nights: int) -> NDArray[np.float64]:
    """Return the chart's average of each night of a joint, in its own standard deviations."""
    values = [
        row["distance"] - (row["common"] or 0.0)
        if row["state"] in JUDGED and not row["harmless"] and row["distance"] is not None
        else math.nan
        for row in rows
    ]
    healthy = np.array([row["state"] == "healthy" for row in rows], dtype=np.bool_)
    return control_chart(np.array(values, dtype=np.float64), healthy, baseline_nights)


def _nights(
    rows: Sequence[Mapping[str, Any]], rule: AlarmConfig, baseline_nights: int
) -> list[Night]:
    averages = chart_of(rows, baseline_nights)
    found = []
    for row, average in zip(rows, averages.tolist(), strict=True):
        # a fault whose cause lies outside the joint is none of it; nights that only changed are
        # left to the chart: by chance a baseline is so even that every tenth night of it differs
        fault = row["state"] == "fault" and not row["harmless"]
        gross = fault and (row["effect"] or 0.0) > rule.gross
        signal, calm = fault or average > LIMIT, not average > CALM
        found.append(Night(signal, gross, calm, judged=row["state"] in JUDGED))
    return found


def _first_signal(nights: Sequence[Night], raised: int, among: int) -> int:
    """Return the first of the nights that raised an alarm."""
    judged = [index for index in range(raised + 1) if nights[index].judged][-among:]
    return next(index for index in judged if nights[index].signal)


def _alarm(
    rows: Sequence[Mapping[str, Any]],
    found: Episode,
    ended: str,
    signal: int,
    name: str,
    declared: Sequence[Declared],
    rule: AlarmConfig,
    fault_effect: float,
    baseline_nights: int,
) -> tuple[AlarmRow, list[Event]]:
    first = rows[found.raised]
    robot, axis = first["robot"], first["axis"]
    until = ended or "9999"
    last = sum(row["night"] < until for row in rows)
    since = _since(rows[max(0, found.raised + 1 - MOST_NIGHTS) : found.raised + 1], rows[signal])

    def told(night: int) -> tuple[dict[str, Any], str]:
        """Return the trend by what was known in a night, and the words of it."""
        lately = _measured(rows[max(0, night + 1 - MOST_NIGHTS) : night + 1])
        trend = _trend(lately, since, fault_effect, baseline_nights)
        return trend, f"{_state_phrase(rows[night])}; {_trend_phrase(trend, fault_effect)}"

    trend, text = told(last - 1)
    known = _acknowledged(declared, axis, first["night"], until)
    # later nights do not change what was said in earlier ones
    said = told(found.raised)[1]
    events = [Event(first["night"], robot, axis, "alarm", f"{name}: {said}")]
    nights = [row["night"] for row in rows[found.raised : last]]
    for index in said_in(nights, [""] * len(nights), rule.remind_after)[1:]:
        if known is None or nights[index] < known.night:
            said = f"{name}: alarm since {since}; {told(found.raised + index)[1]}"
            events.append(Event(nights[index], robot, axis, "reminder", said))
    if ended:
        how = f"no sign of it in {rule.of} judged nights"
        if found.cleared is None:
            how = "by a new baseline"
        text_of_end = f"{name}: the alarm of {first['night']} is over, {how}"
        events.append(Event(ended, robot, axis, "cleared", text_of_end))
    alarm = AlarmRow(
        robot=robot,
        program=first["program"],
        axis=axis,
        raised=first["night"],
        since=since,
        cleared=ended or None,
        acknowledged=None if known is None else known.why,
        text=text,
        trend=json.dumps(trend, sort_keys=True),
    )
    return alarm, events


def _trend(
    rows: Sequence[Mapping[str, Any]], since: str, fault_effect: float, baseline_nights: int
) -> dict[str, Any]:
    """Return how fast a joint's effect and distance grow since a night, and when it is at fault.

    Whether it grows is the distance's to say: the effect is the largest of what several witnesses
    see, and moves with each of them. Empty with too few nights.
    """
    changed = np.array([row["night"] >= since for row in rows], dtype=np.bool_)
    healthy = np.array([row["state"] == "healthy" for row in rows], dtype=np.bool_)
    warmth = np.array([row["temperature_c"] for row in rows], dtype=np.float64)
    logged = warmth[np.isfinite(warmth)]
    usual = float(np.median(logged)) if logged.size else math.nan
    effects, distances = np.array([row["effect"] or 0.0 for row in rows]), _distances(rows)
    nights = _days(rows)[changed]
    effect, distance = (
        robust_slope(nights, without_temperature(nights, course[changed], warmth[changed], usual))
        for course in (effects, distances)
    )
    if effect is None or distance is None or not math.isfinite(effect.low + distance.low):
        _, spread = usual_nights(distances[healthy & ~changed], baseline_nights)
        few = slope_of_spread(nights, distances[changed], spread)
        if few is None or not few.clear:
            return {}
        reached = float(np.median(effects[changed][-3:])) >= fault_effect
        return {"distance": _rounded(few), "reach": [0, 0] if reached else None}
    reach = nights_until(effect, fault_effect)
    return {
        "per_night": round(effect.per_night, 6),
        "low": round(effect.low, 6),
        "high": round(effect.high, 6),
        "level": round(effect.level, 6),
        "distance": _rounded(distance),
        "reach": None if reach is None else [math.floor(reach[0]), math.ceil(reach[1])],
    }


def _rounded(slope: Slope) -> list[float]:
    return [round(one, 6) for one in (slope.per_night, slope.low, slope.high)]


def _acknowledged(
    declared: Sequence[Declared], axis: int, raised: str, until: str
) -> Declared | None:
    """Return what silences an alarm: of another baseline it is another alarm."""

    def in_force(said: Sequence[Declared]) -> str:
        return max((night for _, night in begun_anew(said) if night <= raised), default="")

    return next(
        (
            one
            for n, one in enumerate(declared)
            if (one.kind, one.axis) == ("acknowledged", axis)
            and raised <= one.night < until
            and in_force(declared[:n]) == in_force(declared)
        ),
        None,
    )


def _since(until_raised: Sequence[Mapping[str, Any]], signal: Mapping[str, Any]) -> str:
    """Return the night in which a change began.

    How it goes on after the alarm does not say: a distance grows ever faster, and then slower.
    """
    seen = _measured(until_raised)
    if not seen:
        return str(signal["night"])
    begun = onset(_days(seen), _distances(seen))
    # a change that was there from the first night on has no before
    return str(min(seen[begun]["night"], signal["night"]))


def _measured(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    return [row for row in rows if row["state"] in JUDGED and row["distance"] is not None]


def _distances(rows: Sequence[Mapping[str, Any]]) -> NDArray[np.float64]:
    return np.array([row["distance"] - (row["common"] or 0.0) for row in rows], dtype=np.float64)


def _days(rows: Sequence[Mapping[str, Any]]) -> NDArray[np.float64]:
    return np.array([_day(row["night"]) for row in rows], dtype=np.float64)


def _courses(
    joint: Sequence[Mapping[str, Any]],
) -> Iterator[tuple[list[Mapping[str, Any]], str]]:
    """Yield a joint's nights by the baseline that they were compared with.

    Nights of another condition say nothing of what this one's have shown: neither do they clear
    its alarms, nor does its chart begin anew after them.

    Yields
    ------
    rows : list
        Nights of one condition, one baseline after the other.
    replaced : str
        First night of the condition's next baseline; empty without one.
    """
    by_condition: dict[str, list[Mapping[str, Any]]] = {}
    for row in joint:
        by_condition.setdefault(condition_in(row["baseline"]), []).append(row)
    for rows in by_condition.values():
        parts = [list(part) for _, part in groupby(rows, key=lambda row: row["baseline"])]
        begins = [*(part[0]["night"] for part in parts[1:]), ""]
        yield from zip(parts, begins, strict=True)


def _after_maintenance(
    raised: str, nights: Sequence[NightRow], declared: Sequence[Declared]
) -> str:
    """Return the first night of a baseline that was declared after an alarm; empty without one."""
    after = [night for _, night in begun_anew(declared) if night > raised]
    if not after:
        return ""
    # a date that is still to come, or was mistyped, silences nothing
    return next((row.night for row in nights if row.night >= min(after)), "")


def _not_judged(rows: Sequence[Mapping[str, Any]], name: str, remind_after: int) -> Iterator[Event]:
    for unjudged, part in groupby(rows, key=lambda row: row["state"] not in JUDGED):
        streak = list(part)
        if unjudged:
            first, last = streak[0], streak[-1]
            span = f"since {first['night']}"
            if last is not rows[-1]:  # it was judged again
                span = f"from {first['night']} to {last['night']}"
                span = first["night"] if first is last else span
            nights, reasons = ([row[of] for row in streak] for of in ("night", "reason"))
            row = f" ({len(streak)} nights in a row)" if len(streak) > 1 else ""
            text = f"{name}: not judged {span}{row}: {_in_one(nights, reasons)}"
            for index in said_in(nights, reasons, remind_after):
                yield Event(nights[index], first["robot"], first["axis"], "not-judged", text)


def _failed(robot: str, nights: Sequence[NightRow], remind_after: int) -> Iterator[Event]:
    for row in nights:
        if row.why and not row.night:  # files that do not say of which night they are
            yield Event("", robot, None, "failed", row.why)
    dated = [row for row in nights if row.night]
    for failing, part in groupby(dated, key=lambda row: bool(row.why)):
        streak = list(part) if failing else []
        for kind in ("partial", "failed"):
            rows = [row for row in streak if (row.status in UNJUDGED) == (kind == "failed")]
            if not rows:
                continue
            dates, reasons = [row.night for row in rows], [row.why for row in rows]
            span = dates[0]
            if len(dates) > 1:
                in_a_row = " in a row" if len(rows) == len(streak) else ""
                span = f"{dates[0]} to {dates[-1]} ({len(dates)} nights{in_a_row})"
            if kind == "partial":
                judged = any(row.status != "baseline" for row in rows)
                span += f": in part not {'judged' if judged else 'used'}"
            text = f"{span}: {_in_one(dates, reasons)}"
            for index in said_in(dates, reasons, remind_after):
                yield Event(dates[index], robot, None, kind, text)


def _in_one(nights: Sequence[str], reasons: Sequence[str]) -> str:
    """Return the last night's reason, and since when there were others.

    It is the same whenever it is said: who hears of it late hears it once.
    """
    text = reasons[-1]
    known = _kinds(text)
    for night, reason in zip(nights, reasons, strict=True):
        if not _kinds(reason) <= known:
            text += f"; {night}: {reason}"
            known |= _kinds(reason)
    return text


def said_in(nights: Sequence[str], reasons: Sequence[str], remind_after: int) -> list[int]:
    """Return in which of the nights that something lasts it is said.

    In the first, in those with a reason that was not said yet, and after some nights again.
    """
    said: list[int] = []
    known: set[str] = set()
    for index, (night, reason) in enumerate(zip(nights, reasons, strict=True)):
        new = _kinds(reason) - known
        if new or _day(night) - _day(nights[said[-1]]) >= remind_after:
            said.append(index)
        known |= new
    return said


def _kinds(reason: str) -> set[str]:
    """Return a reason's sentences without what differs from night to night: paths and numbers."""
    return {
        " ".join(word for word in one.split() if not re.search(r"[\d/]", word))
        for one in reason.split("; ")
    }


def _day(night: str) -> int:
    return date.fromisoformat(night).toordinal()


def _state_phrase(row: Mapping[str, Any]) -> str:
    phrase = {
        "fault": "at fault",
        "changed": "changed",
        "healthy": "each night for itself healthy, all together not",
        "insufficient-data": "not judged in the last night",
    }.get(row["state"], row["state"])
    if row["effect"] is not None and row["state"] in JUDGED:
        phrase += f", effect {row['effect']:.2f}"
    if row["cause"]:
        phrase += f", looks like {row['cause']}"
    return str(phrase)


def _trend_phrase(trend: Mapping[str, Any], limit: float) -> str:
    """Say where a joint is heading: its effect may move with the weather, its distance less."""
    if not trend:
        return "too few nights for a trend"
    reach, level = trend["reach"], f"fault level ({limit:g})"
    farther = "no trend"
    if trend["distance"][1] > 0:
        usual, least, most = (_percent(one) for one in trend["distance"])
        farther = f"distance from the baseline grows by {usual} % ({least} to {most}) a night"
    if reach == [0, 0]:
        grows = farther
        if trend.get("low", 0) > 0:
            grows = f"grows by {trend['per_night']:.3f} a night"
        return f"at {level}, {grows}"
    if reach is None:
        why = "the effect too unevenly" if "level" in trend else "too few nights"
        unsure = f", {why} to say when it reaches {level}"
        return farther + (unsure if trend["distance"][1] > 0 else "")
    return (
        f"effect grows by {trend['per_night']:.3f} ({trend['low']:.3f} to {trend['high']:.3f}) a "
        f"night, reaches {level} in {reach[0]} to {reach[1]} nights"
    )


def _percent(log_ratio: float) -> str:
    percent = 100 * math.expm1(log_ratio)
    return f"{percent:.{1 if abs(percent) < 10 else 0}f}"
