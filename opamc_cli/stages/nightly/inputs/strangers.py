"""Recordings that lie under one robot and are another's: by their bytes, or by what they say."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import sha256

from opamc_cli.stages.nightly.inputs.recordings import Recording
from opamc_cli.storage.history.rows import NightRow
from opamc_cli.storage.logs import Facts

ByRobot = Mapping[str, Sequence[Recording]]


def without_strangers(
    by_robot: ByRobot,
    fixed: ByRobot,
    beside: ByRobot,
    recorded: Mapping[str, Mapping[str, NightRow]],
) -> dict[str, list[Recording]]:
    """Have recordings that may be another robot's stand for nothing.

    Of the robots that hold the same bytes, the one that the metadata names recorded them, else the
    one that alone was judged with them before; of two that are new nobody knows. Recordings that
    are gone do not count: who put a file into its right place has removed it from the wrong one.

    Parameters
    ----------
    by_robot
        Recordings of the robots that are looked at.
    fixed
        Those that `baseline.runs` names.
    beside
        What is known of the cell's other robots.
    recorded
        What became of the robots' nights.
    """
    every = [one for known in (by_robot, fixed, beside) for own in known.values() for one in own]
    held = _held_by_several(every)
    owners = {content: _owner(copies, recorded) for content, copies in held.items()}
    robots = {*by_robot, *beside}

    def judgeable(one: Recording) -> Recording:
        why = "" if one.facts.error else _why_not(one, held, owners, robots)
        # with another hash it is another file, once it is its robot's own
        if not why:
            return one
        return replace(one, sha256=sha256(why.encode()).hexdigest(), facts=Facts(error=why))

    return {robot: [judgeable(one) for one in own] for robot, own in by_robot.items()}


def said_of_baselines(fixed: ByRobot, own: ByRobot) -> list[tuple[str, Recording, Recording]]:
    """Return which recordings that `baseline.runs` names are copies of another robot's.

    Of its baseline's, or of those that are its own.
    """
    named = [one for baseline in fixed.values() for one in baseline]
    if not named:
        return []
    held = _held_by_several([*named, *(one for nights in own.values() for one in nights)])
    copies = [(one, held[one.sha256]) for one in named if one.sha256 in held]
    return [(one.log.robot, one, _of_another(one, others)) for one, others in copies]


def several_named(baseline: Sequence[Recording]) -> Iterator[str]:
    """Say that recordings of one baseline name several robots; one of them is a stranger."""
    named = {one.facts.robot: one.log.path for one in reversed(baseline) if one.facts.robot}
    if len(named) > 1:
        found = ", ".join(f"{path} {robot}" for robot, path in sorted(named.items()))
        yield f"its recordings name several robots ({found}); it is of one"


def _held_by_several(every: Sequence[Recording]) -> dict[str, list[Recording]]:
    """Return recordings of which several robots have the same bytes, by their hash."""
    by_hash: dict[str, list[Recording]] = {}
    for one in every:
        if not one.facts.error:
            by_hash.setdefault(one.sha256, []).append(one)
    several = {
        content: list(_of_one_robot(alike)) for content, alike in by_hash.items() if len(alike) > 1
    }
    return {
        content: copies
        for content, copies in several.items()
        if len({one.log.robot for one in copies}) > 1
    }


def _of_one_robot(alike: Sequence[Recording]) -> Iterator[Recording]:
    """Leave out files that are named as the baseline of several robots: those are no copies."""
    robots: dict[str, set[str]] = {}
    for one in alike:
        robots.setdefault(one.log.path, set()).add(one.log.robot)
    return (one for one in alike if len(robots[one.log.path]) == 1)


def _owner(
    copies: Sequence[Recording], recorded: Mapping[str, Mapping[str, NightRow]]
) -> str | None:
    named = next((one.facts.robot for one in copies if one.facts.robot), "")
    if named in {one.log.robot for one in copies}:
        return named
    before = set()
    for one in copies:
        record = recorded.get(one.log.robot, {}).get(one.night)
        if record is not None and one.identity in json.loads(record.key)["files"]:
            before.add(one.log.robot)
    return before.pop() if len(before) == 1 else None


def _why_not(
    one: Recording,
    held: Mapping[str, Sequence[Recording]],
    owners: Mapping[str, str | None],
    robots: set[str],
) -> str:
    """Return why a recording is not judged as its robot's own; empty if it is."""
    robot, path, named = one.log.robot, one.log.path, one.facts.robot
    owner = owners.get(one.sha256)
    if one.sha256 in held and owner != robot:
        other = _of_another(one, held[one.sha256], owner)
        whose = ", whose it is" if owner else "; remove it where it was not recorded"
        return f"{path}: has the same bytes as {other.log.path} of {other.log.robot}{whose}"
    if named != robot and named in robots:
        return f"{path}: is of {named} by its metadata; move it there, or correct `robot`"
    return ""


def _of_another(one: Recording, copies: Sequence[Recording], owner: str | None = None) -> Recording:
    others = [other for other in copies if other.log.robot != one.log.robot]
    return next((other for other in others if other.log.robot == owner), others[0])
