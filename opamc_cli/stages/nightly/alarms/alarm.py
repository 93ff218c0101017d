"""One alarm of a joint: since when, what is said of it, and how it ends."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from opamc_cli.config.cell import AlarmConfig
from opamc_cli.decision.trend.alarm import LATELY, Episode, Night, episodes, nights_to_go
from opamc_cli.decision.trend.onset import onset
from opamc_cli.stages.nightly.alarms.course import JUDGED, days, distances, measured
from opamc_cli.stages.nightly.alarms.not_judged import do_first, is_own_fault, said_in
from opamc_cli.stages.nightly.alarms.trend import FALLEN, trend_of, trend_phrase
from opamc_cli.storage.history.rows import AlarmRow, Declared, Event, begun_anew

MOST_NIGHTS = 365
"""Nights that the beginning of a change is sought in."""


@dataclass(frozen=True)
class Watched:
    """A joint whose nights are watched, and by which rules."""

    name: str
    """As it is told: its axis, and the program where there are several."""
    declared: Sequence[Declared]
    """What users declared of its robot."""
    rule: AlarmConfig
    fault_effect: float
    baseline_nights: int
    """With `rule`, `fault_effect`: as of `settle_robot`."""


def alarm_of(
    joint: Watched,
    rows: Sequence[Mapping[str, Any]],
    nights: Sequence[Night],
    found: Episode,
    ended: str,
) -> tuple[AlarmRow, list[Event]]:
    """Tell an episode of a joint's nights, what is said of it night by night included.

    It is over in the night `ended`, which is empty where it is not.
    """
    first = rows[found.raised]
    robot, axis = first["robot"], first["axis"]
    until = ended or "9999"
    last = sum(row["night"] < until for row in rows)
    own = _own(nights, found, joint.rule.of)
    signal = own[0]
    since = str(rows[signal]["night"])
    if not found.returns:  # of what comes and goes no curve tells when it began
        since = _since(rows[max(0, found.raised + 1 - MOST_NIGHTS) : found.raised + 1], since)

    def told(night: int) -> tuple[dict[str, Any], str]:
        """Return the trend by what was known in a night, and the words of it."""
        lately = measured(rows[max(0, night + 1 - MOST_NIGHTS) : night + 1])
        trend = trend_of(lately, since, joint.fault_effect, joint.baseline_nights)
        limit, effect = joint.fault_effect, rows[night]["effect"] or 0.0
        judged_low = rows[night]["state"] in JUDGED and effect < FALLEN * limit
        words = trend_phrase(trend, limit, effect >= limit, judged_low)
        differed = any(row["state"] in ("changed", "fault") for row in rows[signal:night])
        parts = [_state_phrase(rows[night], differed), words]
        if found.returns:
            parts.insert(1, f"comes and goes, in {len(own)} nights until {first['night']}")
        if rows[night]["state"] == "healthy":
            parts.append(_end_phrase(nights[: night + 1], found, joint.rule))
        return trend, "; ".join(parts) + do_first(rows[night])

    trend, text = told(last - 1)
    known = _acknowledged(joint.declared, axis, first["night"], until)
    spans = [(found.raised, last, "")]
    if known is not None:
        after = sum(row["night"] <= known.night for row in rows)
        spans = [(found.raised, after, "")]
        anew = _raised_anew(rows[:last], nights, own[0], after, joint.rule)
        if anew is not None:
            effects = [row["effect"] or 0.0 for row in rows[:after] if row["state"] in JUDGED]
            then = f"then changed by {effects[-1]:.0%}"
            how = f"acknowledged on {known.time[:10]}, {then}, and at fault"
            spans.append((anew, last, f"{how} since {rows[anew]['night']}; "))
            known, text = None, spans[-1][-1] + text
    # later nights do not change what was said in earlier ones
    events = []
    for begin, stop, why in spans:
        said = f"{joint.name}: {why}{told(begin)[1]}"
        events.append(Event(rows[begin]["night"], robot, axis, "alarm", said))
        dates = [row["night"] for row in rows[begin:stop]]
        for index in said_in(dates, [""] * len(dates), joint.rule.remind_after)[1:]:
            said = f"{joint.name}: alarm since {since}; {why}{told(begin + index)[1]}"
            events.append(Event(dates[index], robot, axis, "reminder", said))
    if ended:
        how = f"no sign of it in {joint.rule.of} judged nights"
        if found.cleared is None:
            how = "by a new baseline"
        text_of_end = f"{joint.name}: the alarm of {first['night']} is over, {how}"
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


def _acknowledged(
    declared: Sequence[Declared], axis: int, raised: str, until: str
) -> Declared | None:
    """Return what silences an alarm: of another baseline it is another alarm."""

    def in_force(said: Sequence[Declared]) -> str:
        return max((night for _, night in begun_anew(said) if night <= raised), default="")

    return next(
        (
            one
            for n, one in reversed([*enumerate(declared)])
            if (one.kind, one.axis) == ("acknowledged", axis)
            and raised <= one.night < until
            and in_force(declared[:n]) == in_force(declared)
        ),
        None,
    )


def _raised_anew(
    rows: Sequence[Mapping[str, Any]],
    nights: Sequence[Night],
    begin: int,
    after: int,
    rule: AlarmConfig,
) -> int | None:
    """Return the night that raises an acknowledged alarm once more; None without one.

    Nights at fault alone do, by the same rule, and only if none that was acknowledged, from `begin`
    until `after`, was at fault: else they are what was there.
    """
    fault = [is_own_fault(row) for row in rows]
    if any(fault[begin:after]):
        return None
    later = [replace(nights[index], signal=fault[index]) for index in range(after, len(rows))]
    found = episodes(later, rule.nights, rule.of)
    return after + found[0].raised if found else None


def _own(nights: Sequence[Night], found: Episode, among: int) -> list[int]:
    """Return the nights that raised an alarm."""
    judged = [index for index in range(found.raised + 1) if nights[index].judged]
    if found.returns:
        return [index for index in judged[-LATELY:] if nights[index].large]
    return [index for index in judged[-among:] if nights[index].signal]


def _end_phrase(nights: Sequence[Night], found: Episode, rule: AlarmConfig) -> str:
    """Tell what a joint's alarm waits for, now that its last night is healthy."""
    judged = [one for one in nights if one.judged]
    more = nights_to_go(judged, rule.nights, rule.of, returns=found.returns)
    text = f"over after {more} more {'night' if more == 1 else 'nights'} without a sign of it"
    if judged[-1].signal or not judged[-1].calm:
        text += " (its distance of late still is one)"
    elif judged[-1].differs:
        text += " (a p-value of 0.01 or below is one)"
    return text


def _since(until_raised: Sequence[Mapping[str, Any]], signal: str) -> str:
    """Return the night in which a change began; `signal` is the first that raised its alarm.

    How it goes on after the alarm does not say: a distance grows ever faster, and then slower.
    """
    seen = measured(until_raised)
    if not seen:
        return signal
    begun = onset(days(seen), distances(seen))
    # what was there from the first night on has no before
    return min(str(seen[begun]["night"]), signal) if begun else signal


def _state_phrase(row: Mapping[str, Any], differed: bool) -> str:
    """Tell a night; `differed` says that one before it did so by itself."""
    phrase = {
        "fault": "at fault",
        "changed": "changed",
        "healthy": "healthy in the last night"
        if differed
        else "each night for itself healthy, all together not",
        "insufficient-data": "not judged in the last night",
    }.get(row["state"], row["state"])
    if row["effect"] is None or row["state"] not in JUDGED:
        return str(phrase)
    size = f"changed by {row['effect']:.0%}"
    return size if row["state"] == "changed" else f"{phrase}, {size}"
