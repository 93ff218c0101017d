"""What to say of nights of which no alarm tells: not every night the same."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

from opamc_cli.config.cell import AlarmConfig
from opamc_cli.decision.trend.alarm import LATELY, recurring
from opamc_cli.stages.nightly.alarms.commands import REBASELINE
from opamc_cli.stages.nightly.alarms.course import JUDGED, day
from opamc_cli.stages.nightly.alarms.together import kind
from opamc_cli.storage.history.rows import EXCUSED, UNJUDGED, Event, NightRow, told_by

NO_AXIS = "no axis can be judged"
"""As a diagnosis of another speed, program, unit or log ends."""

LASTS = 3
"""Nights after which what keeps a joint from being judged may have been done to it on purpose."""


def not_judged(rows: Sequence[Mapping[str, Any]], remind_after: int) -> Iterator[Event]:
    """Say of a joint which of its nights were not judged, and why."""
    for unjudged, part in groupby(rows, key=lambda row: row["state"] not in JUDGED):
        streak = list(part)
        if unjudged:
            first, last = streak[0], streak[-1]
            when = f"since {first['night']}"
            if last is not rows[-1]:  # it was judged again
                when = f"from {first['night']} to {last['night']}"
                when = first["night"] if first is last else when
            nights, reasons = ([row[of] for row in streak] for of in ("night", "reason"))
            row = f" ({len(streak)} nights in a row)" if len(streak) > 1 else ""
            text = f"not judged {when}{row}: {_in_one(nights, reasons)}"
            if last is rows[-1] and len(streak) >= LASTS:
                again = REBASELINE.replace("DATE", first["night"])
                looked = "if that is meant to stay, and the joint was looked at"
                text = f"{text.removesuffix('.')}; {looked}: {again}"
            for index in said_in(nights, reasons, remind_after):
                yield Event(nights[index], first["robot"], first["axis"], "not-judged", text)


def alone(
    rows: Sequence[Mapping[str, Any]], name: str, rule: AlarmConfig, fault_effect: float
) -> Iterator[Event]:
    """Say of a joint in which nights it was at fault without an alarm.

    Each time that it comes back after other nights, and how often it did within a month. Nights
    that only changed are left to the chart: of ten healthy robots every second night has one.
    """
    needs = (
        f"an alarm needs {rule.nights} of {rule.of} nights at fault, {recurring(rule.nights)} of "
        f"{LATELY} that changed by {fault_effect:.0%}, or a change that lasts"
    )
    for times in _coming_back(rows):
        nights = [row for run in times for row in run]
        last = nights[-1]
        which = ", the last" if len(nights) > 1 else " alone,"
        size = "" if last["effect"] is None else f"{which} changed by {last['effect']:.0%}"
        of = span([row["night"] for row in nights])
        text = f"{name}: at fault in {of}{size}: {needs}{do_first(last)}"
        for run in times:
            dates = [row["night"] for row in run]
            kinds = [str(row["cause"]) for row in run]
            for index in said_in(dates, kinds, rule.remind_after):
                row = run[index]
                yield Event(row["night"], row["robot"], row["axis"], "fault", text)


def _coming_back(
    rows: Sequence[Mapping[str, Any]],
) -> Iterator[list[list[Mapping[str, Any]]]]:
    """Yield nights at fault, as runs without another, those within a month together."""
    judged = [row for row in rows if row["state"] in JUDGED]
    times: list[list[Mapping[str, Any]]] = []
    for fault, run in groupby(judged, key=is_own_fault):
        nights = list(run) if fault else []
        if nights and times and day(nights[0]["night"]) - day(times[-1][-1]["night"]) > LATELY:
            yield times
            times = []
        times += [nights] if nights else []
    if times:
        yield times


def do_first(row: Mapping[str, Any]) -> str:
    """Tell what is to be done first about a joint at fault, or changed; nothing of any other."""
    told = told_by(row["reason"])
    if row["state"] not in ("fault", "changed") or not told.text:
        return ""
    first = "" if told.first is None else f"see to axis {told.first}, which may shake it; then: "
    return f"; do first: {first}{told.text.rstrip('.')}"


def is_own_fault(row: Mapping[str, Any]) -> bool:
    """Return whether a night is at fault by what is the joint's own."""
    return row["state"] == "fault" and not row["harmless"]


def excused(rows: Sequence[Mapping[str, Any]], remind_after: int) -> Iterator[Event]:
    """Say of a joint in which nights it differed, but no more than conditions may move it.

    Nights between that are plainly healthy begin nothing anew: the weather comes and goes.
    """
    found = [row for row in rows if row["reason"].startswith(EXCUSED)]
    nights = [row["night"] for row in found]
    for index in said_in(nights, [""] * len(nights), remind_after):
        last = found[-1]
        text = f"not told from unusual conditions in {span(nights)}"
        if last["p_value"] is not None and last["distance"] is not None:
            far = f"{math.exp(last['distance']):.2g} times as far as a healthy session"
            text += f" (p {last['p_value']:.2g}, {far})"
        text += ": a fault that looks alike would not be told"
        yield Event(nights[index], last["robot"], last["axis"], "excused", text)


def span(nights: Sequence[str]) -> str:
    """Return nights in words: how many, the first and the last."""
    several = f"{len(nights)} nights from {nights[0]} to {nights[-1]}"
    return several if len(nights) > 1 else nights[0]


def outside(rows: Sequence[Mapping[str, Any]], remind_after: int) -> Iterator[Event]:
    """Say of a joint in which nights it changed by what is no fault of it: payload, sensor, grease.

    No alarm comes of them, and a fault beside it might not be told.
    """
    found = [row for row in rows if row["state"] == "changed" and row["harmless"]]
    nights, causes = ([row[of] for row in found] for of in ("night", "cause"))
    again = REBASELINE.replace("DATE", nights[0]) if nights else ""
    for index in said_in(nights, causes, remind_after):
        said = {row["cause"]: told_by(row["reason"]).text for row in found}
        text = (
            f"changed in {span(nights)} by what lies outside the joint: {' '.join(said.values())} "
            f"A fault that looks alike would not be told; if it is meant to stay: {again}"
        )
        yield Event(nights[index], found[-1]["robot"], found[-1]["axis"], "outside", text)


def failed(robot: str, nights: Sequence[NightRow], remind_after: int) -> Iterator[Event]:
    """Say of a robot which of its nights failed, in whole or in part, and why."""
    for row in nights:
        if row.why and not row.night:  # files that do not say of which night they are
            yield Event("", robot, None, "failed", row.why)
    dated = [row for row in nights if row.night]
    for failing, part in groupby(dated, key=lambda row: bool(row.why)):
        streak = list(part) if failing else []
        for of in ("partial", "failed"):
            rows = [row for row in streak if (row.status in UNJUDGED) == (of == "failed")]
            if not rows:
                continue
            dates, reasons = [row.night for row in rows], [row.why for row in rows]
            when = dates[0]
            if len(dates) > 1:
                in_a_row = " in a row" if len(rows) == len(streak) else ""
                when = f"{dates[0]} to {dates[-1]} ({len(dates)} nights{in_a_row})"
            if of == "partial":
                judged = any(row.status != "baseline" for row in rows)
                when += f": in part not {'judged' if judged else 'used'}"
            text = f"{when}: {_in_one(dates, reasons)}"
            lasts = len(rows) >= LASTS and rows[-1] is dated[-1]
            if lasts and all(NO_AXIS in reason for reason in reasons):
                again = REBASELINE.replace("DATE", dates[0])
                text = f"{text.removesuffix('.')}; if that is meant to stay: {again}"
            for index in said_in(dates, reasons, remind_after):
                yield Event(dates[index], robot, None, of, text)


def said_in(nights: Sequence[str], reasons: Sequence[str], remind_after: int) -> list[int]:
    """Return in which of the nights that something lasts it is said.

    In the first, in those with a reason that was not said yet, and after some nights again.
    """
    said: list[int] = []
    known: set[str] = set()
    for index, (night, reason) in enumerate(zip(nights, reasons, strict=True)):
        new = _kinds(reason) - known
        if new or day(night) - day(nights[said[-1]]) >= remind_after:
            said.append(index)
        known |= new
    return said


def _in_one(nights: Sequence[str], reasons: Sequence[str]) -> str:
    """Return the last night's reason, and what else was said of the others, each sentence once.

    It is the same whenever it is said: who hears of it late hears it once.
    """
    text = reasons[-1]
    known = _kinds(text)
    for night, reason in zip(nights, reasons, strict=True):
        new = {kind(one): one for one in reason.split("; ") if kind(one) not in known}
        if new:
            text += f"; {night}: {'; '.join(new.values())}"
            known |= new.keys()
    return text


def _kinds(reason: str) -> set[str]:
    """Return what kinds of sentence a reason has."""
    return {kind(one) for one in reason.split("; ")}
