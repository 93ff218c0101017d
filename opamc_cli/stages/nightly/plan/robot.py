"""The plan of one robot: its nights, each with what it is held against."""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from opamc_cli.stages.nightly.inputs.copies import twins, without_copies
from opamc_cli.stages.nightly.inputs.recordings import Recording
from opamc_cli.stages.nightly.plan.baselines import Baselines, Series
from opamc_cli.stages.nightly.plan.planned import PlannedNight, RobotPlan, Situation
from opamc_cli.stages.nightly.plan.reason import hashes_before, key_of, reason_of


def plan_robot(robot: str, recordings: Sequence[Recording], now: Situation) -> RobotPlan:
    """Say what is to be done of each night of a robot.

    Parameters
    ----------
    robot
        Its name.
    recordings
        All its recordings that are there.
    now
        What is known besides.
    """
    recordings = without_copies(recordings)
    twin_of = {one.log.path: (one, first) for one, first in twins(recordings)}
    recordings = [one for one in recordings if one.log.path not in twin_of]
    usable = [one for one in recordings if not one.facts.error]
    fixed = {one.sha256 for one in now.fixed}
    judged = [one for one in usable if one.sha256 not in fixed]
    series = _main_conditions(judged)
    baselines = Baselines(now, series, usable, {one.night for one in recordings})
    nights = []
    known: dict[int, list[str]] = {}
    before: dict[str, dict[str, tuple[Recording, ...]]] = {}
    broken_of: dict[str, list[Recording]] = {}
    judged_of: dict[str, list[Recording]] = {}
    programs_of: dict[str, list[str]] = {}
    for one in recordings:
        if one.facts.error:
            broken_of.setdefault(one.night, []).append(one)
    for one in judged:
        judged_of.setdefault(one.night, []).append(one)
    for program, night in series:
        programs_of.setdefault(night, []).append(program)
    for night in sorted({one.night for one in recordings}):
        broken = tuple(broken_of.get(night, ()))
        notes = [
            f"left out: {one.log.path} is the same recording as {first.log.path}; nothing is "
            "missing by it"
            for one, first in twin_of.values()
            if one.night == night
        ]
        comparisons = []
        for program in sorted(programs_of.get(night, ())):
            condition, targets = series[program, night]
            compared = baselines.comparison(program, condition, night, tuple(targets))
            comparisons.append(replace(compared, running=now.is_running(night)))
            left = [
                one
                for one in judged_of[night]
                if one.facts.program == program and one.condition != condition
            ]
            if left:
                notes.append(
                    f"{len(left)} of {len(left) + len(targets)} runs left out: the night is judged "
                    f"at {condition}, they were recorded at "
                    f"{'; '.join(sorted({one.condition for one in left}))}"
                )
        if not comparisons and not broken:
            continue  # all its recordings belong to the fixed baseline
        key = key_of(comparisons, broken, now.config_hash, known)
        now_there = json.loads(key)["baseline"]
        if now_there not in before:
            before[now_there] = hashes_before(comparisons, known)
        earlier = before[now_there]
        record = now.recorded.get(night)
        why = reason_of(key, record, any(one.lost for one in comparisons), earlier)
        if not why and record is not None and night in now.removed and key == record.key:
            why = "its results were removed"
        if record is not None and earlier and not why:
            baselines.say_gone(earlier.get(json.loads(record.key)["baseline"], ()))
        nights.append(
            PlannedNight(robot, night, tuple(comparisons), broken, tuple(notes), key, why)
        )
    gathering = tuple(baselines.gathering())
    plan = RobotPlan(tuple(nights), baselines.complete, baselines.said(), gathering)
    return _without_waiting(plan, now)


def _without_waiting(plan: RobotPlan, now: Situation) -> RobotPlan:
    """Put off baselines whose nights may turn out to be under alarm by another condition's nights.

    So that one start over a year finds what a start each morning does.
    """
    to_do = [
        (night.night, (one.program, one.condition))
        for night in plan.nights
        if night.why and now.is_to_come(night.night)
        for one in night.comparisons
        if one.baseline
    ]
    waits = {
        key: members
        for key, members in plan.complete.items()
        if key not in now.pinned
        and any(night <= members[-1] and of != key[:2] for night, of in to_do)
    }
    if not waits:
        return plan
    put_off = {(*key[:2], members) for key, members in waits.items()}
    nights = tuple(
        night
        for night in plan.nights
        if not any(
            one.baseline and (one.program, one.condition, one.members) in put_off
            for one in night.comparisons
        )
    )
    complete = {key: members for key, members in plan.complete.items() if key not in waits}
    return replace(plan, nights=nights, complete=complete, waiting=True)


def _main_conditions(recordings: Sequence[Recording]) -> Series:
    """Take of each program and night the condition under which most of it was recorded."""
    usual = Counter((one.facts.program, one.condition) for one in recordings)
    by_place: dict[tuple[str, str], dict[str, list[Recording]]] = {}
    for one in recordings:
        place = by_place.setdefault((one.facts.program, one.night), {})
        place.setdefault(one.condition, []).append(one)
    series: Series = {}
    for (program, night), conditions in by_place.items():
        # ties go to what the robot does on most nights
        chosen = max(conditions, key=lambda c: (len(conditions[c]), usual[program, c], c))
        series[program, night] = (chosen, conditions[chosen])
    return series
