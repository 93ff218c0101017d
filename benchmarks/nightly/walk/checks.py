"""What must be so after a start, whatever was done before."""

import json
import re
import shutil
import signal
import sqlite3
from collections.abc import Sequence
from typing import Any

import nightly_kills
from cell_logs import night

from opamc_cli.errors import ExitCode
from walk.cell import ROBOTS, TO_COME, Said, World, demand


def start(world: World, *asked: Any, kill: int | None = None) -> None:
    """Start, and hold what it says against what is."""
    flags = [night(max(0, world.last + one + 1)) if isinstance(one, int) else one for one in asked]
    robots = {flags[1]} if flags[:1] == ["--robot"] else set(ROBOTS)
    told = world.rows("SELECT robot, kind, time FROM told") if world.history() else []
    world.starts += 1
    planned: set[tuple[str, str]] = set()
    if world.starts % 3 == 0 and kill is None:
        planned = check_dry_run(world, [one for one in flags if one != "--quiet"])
    said = world.call("nightly", world.cell, *flags, kill=kill)
    if said.code in (-signal.SIGKILL, ExitCode.USAGE, ExitCode.BAD_INPUT):
        return
    nights = {row[:2]: row[2:] for row in world.rows("SELECT robot, night, status, why FROM night")}
    demand(planned <= nights.keys(), f"planned but no record: {planned - nights.keys()}")
    asked_for = world.watched() & robots
    check_alarms(world, said, asked_for, robots)
    check_metrics(world)
    check_robots(world, said, asked_for, nights, told)
    if set(flags) <= {"--quiet"}:
        world.heard.rebased.clear()
        check_files(world, said, nights)
        if all(status != "broken" for status, _ in nights.values()):
            check_again(world, said)


def check_dry_run(world: World, flags: Sequence[str]) -> set[tuple[str, str]]:
    """Return what would be done."""
    before = world.history()
    dry = world.call("nightly", world.cell, *flags, "--dry-run", "--json")
    demand(not before or world.history() == before, "a dry run changes the history")
    if dry.code in (ExitCode.USAGE, ExitCode.BAD_INPUT):
        return set()
    demand(dry.code == 0, f"a dry run ends with {dry.code}")
    return {(one["robot"], one["night"]) for one in json.loads(dry.out)["nights"] if one["night"]}


def check_alarms(world: World, said: Said, asked_for: set[str], robots: set[str]) -> None:
    heard = world.heard.alarms
    now = {place: of for place, of in world.standing().items() if place[0] in asked_for}
    ended = "SELECT robot, program, axis, raised FROM alarm WHERE cleared IS NOT NULL"
    over = {row[:3]: row[3] for row in world.rows(ended)}
    for place, (raised, _) in list(heard.items()):
        robot, _, axis = place
        if robot not in robots:
            continue
        if place not in now:
            told = said.names(robot, axis, "is over|stands no more")
            demand(told or robot in world.heard.rebased, f"{place} of {raised} ends silently")
            del heard[place]
        elif over.get(place) == raised and robot not in world.heard.rebased:
            told = said.names(robot, axis, f"the alarm of {raised} is over")
            demand(told, f"{place} of {raised} ends silently, that of {now[place][0]} stands")
    for place, (raised, known) in now.items():
        is_new = place not in heard or heard[place][1] is not None
        told = said.names(place[0], place[2], "ALARM")
        demand(known is not None or not is_new or told, f"{place} of {raised} is not told")
    alarms = any(known is None for _, known in now.values())
    demand(alarms == (said.code == 1), f"code {said.code} with alarms {now}")
    heard.update(now)


def check_metrics(world: World) -> None:
    failed, alarms = world.metrics()
    if world.robots != "auto":
        demand(set(failed) == set(world.robots), f"metrics are of {failed.keys()}")
    standing = world.standing().items()
    own = world.watched()
    history = {place: 1 if of[1] is None else 2 for place, of in standing if place[0] in own}
    demand(history == alarms, f"metrics say {alarms}, the history {history}")


def check_robots(
    world: World,
    said: Said,
    asked_for: set[str],
    nights: dict[tuple[str, str], tuple[str, str]],
    told: Sequence[tuple[str, str, str]],
) -> None:
    """Check that a robot, or a joint, of which less is known than before is named."""
    heard = world.heard
    failed, _ = world.metrics()
    failing = {robot for robot in asked_for if failed.get(robot)}
    demand(not failing or said.code != 0, f"code 0, not judged: {failing}")
    for robot in asked_for:
        before = heard.failed.pop(robot, None)
        if robot not in failing:
            continue
        last = last_of(robot, nights)
        whys = [nights.get((robot, of), ("", ""))[1] for of in {last, ""}]
        why = {word for text in whys for word in text.split() if not re.search(r"[\d/]", word)}
        heard.failed[robot] = why
        said_before = not why and any(
            of == robot and (kind == "not-judged" or (kind == "missing" and since > last))
            for of, kind, since in told
        )
        known = said_before or (before is not None and why <= before)
        demand(known or said.names(robot), f"{robot} is newly not judged: {sorted(why)}")
    # Of the last night of which any joint is known: one that failed ends no row of nights, and what
    # was said of a night is known, though a later one has been lost since.
    query = (
        "SELECT robot, program, axis, night, (SELECT max(night) FROM verdict b WHERE "
        "(b.robot, b.program, b.axis) = (v.robot, v.program, v.axis) AND b.night < v.night AND "
        "b.state <> 'insufficient-data') FROM verdict v "
        "WHERE state = 'insufficient-data' AND "
        "night = (SELECT max(night) FROM verdict n WHERE n.robot = v.robot)"
    )
    for *place, last, judged in world.rows(query):
        if place[0] not in asked_for:
            continue
        known = any([*of] == place and (judged or "") < night for *of, night in heard.unjudged)
        demand(known or said.names(place[0]), f"{place} is newly not judged")
        heard.unjudged.add((*place, last))


def last_of(robot: str, nights: dict[tuple[str, str], tuple[str, str]]) -> str:
    return max((of for name, of in nights if name == robot), default="")


def check_files(world: World, said: Said, nights: dict[tuple[str, str], tuple[str, str]]) -> None:
    own = world.watched()
    for robot in own:
        for folder in world.nights(robot):
            known = folder.name == TO_COME or (robot, folder.name) in nights
            demand(known, f"files of {robot} {folder.name} and no record")
    gone = {robot for (robot,) in world.rows("SELECT robot FROM declared WHERE kind = 'gone'")}
    if said.code == 0:
        latest = max(last_of(robot, nights) for robot in own)
        for robot in own - gone:
            last = last_of(robot, nights)
            status, why = nights.get((robot, last), ("", ""))
            healthy = status in ("done", "baseline") and not why and last == latest
            demand(healthy, f"code 0, and {robot} {last}: {status} {why}")


def check_again(world: World, said: Said) -> None:
    """Check that another start changes nothing, and that all it writes tells the same."""
    before = nightly_kills.end_state(world.out)
    again = world.call("nightly", world.cell, "--quiet")
    after = nightly_kills.end_state(world.out)
    changed = [key for key in before.keys() | after.keys() if before.get(key) != after.get(key)]
    demand(not changed, f"another start changes {changed}")
    lines = [one for one in again.out.splitlines() if "fits this pattern any more" not in one]
    demand(not lines, f"another start says {lines}")
    once = said.code == ExitCode.PARTIAL and again.code == 0
    demand(again.code == said.code or (once and said.out), f"codes {said.code}, {again.code}")
    if world.starts % 3 == 1:
        return
    _, alarms = world.metrics()
    told = json.loads(world.call("nightly", world.cell, "--json").out)["robots"]
    of_json = {
        (robot, one["program"], one["axis"]): 2 if one["acknowledged"] else 1
        for robot, of in told.items()
        for one in of["alarms"]
    }
    demand(of_json == alarms, f"--json says {of_json}, metrics {alarms}")
    html = (world.out / "index.html").read_text()
    found = re.search(r'<script[^>]*type="application/json"[^>]*>(.*?)</script>', html, re.S)
    if not found:
        return
    shown = json.loads(found[1])
    demand({robot for robot, _ in shown["robots"]} == told.keys(), "page and --json differ")
    names = [one[0] for one in shown["states"]]
    for robot, joints in shown["robots"]:
        for axis, state, *_ in joints:
            of = [n for place, n in alarms.items() if (place[0], place[2]) == (robot, axis)]
            is_alarm = names[state] == "alarm"
            # of a joint in several programs each has a row
            several = sum(one == axis for one, *_ in joints) > 1
            fits = 1 in of if is_alarm else 1 not in of or several
            demand(fits, f"page says {names[state]} of {robot} axis {axis}, metrics {of}")


DERIVED = (
    "SELECT robot, program, axis, night, state, alarm, n_runs FROM verdict",
    "SELECT robot, program, axis, night, baseline, distance, reason FROM measure",
    "SELECT * FROM alarm",
    "SELECT robot, night, status, why FROM night",
    "SELECT robot, time, axis, kind, text FROM event WHERE kind IN ('alarm', 'cleared', "
    "'fault', 'not-judged', 'together', 'excused', 'failed', 'partial', 'missing')",
)
"""What follows from files and what was declared."""


def check_afresh(world: World) -> None:
    """Check that one start over all files ends as the walk has."""

    def state() -> list[list[tuple[Any, ...]]]:
        own = world.watched()
        found = [sorted((r for r in world.rows(q) if r[0] in own), key=repr) for q in DERIVED]
        return [*found, [((world.out / "metrics.prom").read_text(),)]]

    walked, declared = state(), world.rows("SELECT * FROM declared")
    aside = world.out.rename(world.folder / "walked")
    world.call("nightly", world.cell, "--dry-run")
    with sqlite3.connect(world.out / "history.sqlite") as db:
        db.executemany("INSERT INTO declared VALUES (?, ?, ?, ?, ?, ?)", declared)
    db.close()
    world.call("nightly", world.cell, "--quiet")
    for before, after in zip(walked, state(), strict=True):
        more = (
            [one for one in before if one not in after],
            [one for one in after if one not in before],
        )
        demand(before == after, "walked {}, afresh {}".format(*more))
    shutil.rmtree(world.out)
    aside.rename(world.out)
