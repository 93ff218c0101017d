"""What several joints of a robot show alike: said once, whichever they are."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from opamc_cli.stages.nightly.alarms.commands import REBASELINE
from opamc_cli.stages.nightly.alarms.course import JUDGED
from opamc_cli.stages.nightly.alarms.not_judged import said_in, span
from opamc_cli.storage.history.rows import EXCUSED, Event
from opamc_cli.storage.schemas.channels import axes_phrase

NUMBER = re.compile(r"(?<![\w.-])(?<!axis )\d+(?:\.\d+)?(?:e[-+]\d+)?(?![\w-])")
"""Of a sentence; of dates, names and joints the numbers are none."""

Row = Mapping[str, Any]


def said_once(told: Iterable[tuple[str, Event]]) -> Iterator[Event]:
    """Name the joints that have the same to say of a night, in the one text of them all.

    Parameters
    ----------
    told
        Where it is said of (the program, if there are several), and what, without the joint.
    """
    groups: dict[tuple[str, ...], list[tuple[str, Event]]] = {}
    for where, event in told:
        said = re.sub(rf"\baxis {event.axis}\b", "each axis", event.text)
        key = (where, event.time, event.kind, NUMBER.sub("#", said))
        groups.setdefault(key, []).append((said, event))
    for (where, *_), group in groups.items():
        events = [event for _, event in group]
        text = alike([said for said, _ in group]) if len(group) > 1 else events[0].text
        name = axes_phrase([one.axis or 0 for one in events])
        yield from (replace(one, text=f"{name}{where}: {text}") for one in events)


def alike(texts: Sequence[str]) -> str:
    """Return what texts say that differ in numbers alone, with what these reach from and to.

    Examples
    --------
    >>> alike(["p 1e-9, 4.3 times as far", "p 3e-7, 10 times as far", "p 3e-7, 9 times as far"])
    'p 1e-9 to 3e-7, 4.3 to 10 times as far'
    """
    columns = zip(*(NUMBER.findall(text) for text in texts), strict=True)

    def reach(_: re.Match[str]) -> str:
        numbers = sorted(next(columns), key=float)
        return " to ".join(dict.fromkeys((numbers[0], numbers[-1])))

    return NUMBER.sub(reach, texts[0])


def moved_together(joints: Sequence[Row]) -> list[Row]:
    """Return the joints that lie far from the baseline together in a night of one program.

    Those that the others excuse, and those that lie as far and could not be judged; none if it is
    one alone.
    """
    excused = [row["distance"] or 0.0 for row in joints if _is_excused(row)]
    found = [
        row
        for row in joints
        if _is_excused(row)
        or (
            row["state"] not in JUDGED
            and row["distance"] is not None
            and row["distance"] >= min(excused, default=math.inf)
        )
    ]
    return found if len(found) > 1 else []


def _is_excused(row: Row) -> bool:
    return str(row["reason"]).startswith(EXCUSED)


def together(
    rows: Sequence[Row], where: str, remind_after: int
) -> tuple[set[tuple[int, str]], list[Event]]:
    """Return which joints moved together with others in which nights, and what is said of it.

    Parameters
    ----------
    rows
        Nights of a robot's joints in one program, but those under an alarm.
    where
        The program, if there are several.
    remind_after
        Nights after which it is said again.
    """
    nights: dict[str, dict[str, list[Row]]] = {}
    for row in rows:
        nights.setdefault(row["baseline"], {}).setdefault(row["night"], []).append(row)
    by_baseline = [[joints for _, joints in sorted(of.items())] for of in nights.values()]
    moved = {
        (row["axis"], row["night"])
        for of in by_baseline
        for joints in of
        for row in moved_together(joints)
    }
    return moved, [one for of in by_baseline for one in _at_once(of, where, remind_after)]


def _at_once(nights: Sequence[Sequence[Row]], where: str, remind_after: int) -> Iterator[Event]:
    """Say in which nights joints moved together, once for all of them."""
    found = [moved for joints in nights if (moved := moved_together(joints))]
    dates = [moved[0]["night"] for moved in found]
    whys = ["; ".join(row["reason"] for row in of if not _is_excused(row)) for of in found]
    for index in said_in(dates, whys, remind_after):
        last = found[-1]
        total = next(len(joints) for joints in nights if joints[0]["night"] == dates[-1])
        ratios = sorted(math.exp(row["distance"] or 0.0) for row in last)
        of = {"not told from unusual conditions": True, "not judged": False}
        which = {
            how: [row["axis"] for row in last if _is_excused(row) == excused]
            for how, excused in of.items()
        }
        text = (
            f"{len(last)} of {total} joints moved together{where} in {span(dates)}, "
            f"{ratios[0]:.2g} to {ratios[-1]:.2g} times as far as in a healthy session: check "
            "payload, tool, temperature and the currents' scale; "
            + ", ".join(f"{axes_phrase(axes)} {how}" for how, axes in which.items() if axes)
            + ": a fault that looks alike would not be told"
        )
        if dates[-1] == nights[-1][0]["night"]:
            text += f"; if that is meant to stay: {REBASELINE.replace('DATE', _begun(nights))}"
        yield Event(dates[index], last[0]["robot"], None, "together", text)


OVER = 3
"""Nights in a row in which joints did not move together, before which it was another shift. After
one such night the command of a stranger's cell left eight shifted ones out of the new baseline."""


def _begun(nights: Sequence[Sequence[Row]]) -> str:
    """Return since which night joints move together, but for less than OVER nights in a row."""
    begun, calm = "", 0
    for joints in reversed(nights):
        if moved_together(joints):
            begun, calm = joints[0]["night"], 0
        elif (calm := calm + 1) == OVER:
            break
    return begun
