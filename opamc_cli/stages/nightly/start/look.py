"""Looks at what there is of a cell, in the light of what is known: what is to be done now."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime

from opamc_cli.config.cell import CellConfig
from opamc_cli.stages.nightly.inputs.hours import Hours, usual_hours
from opamc_cli.stages.nightly.inputs.one_rate import at_named_rates, named_rates
from opamc_cli.stages.nightly.inputs.recordings import (
    CellRecordings,
    Recording,
    find_recordings,
    said_of_strays,
    said_of_unnamed,
    some,
)
from opamc_cli.stages.nightly.inputs.strangers import said_of_baselines, without_strangers
from opamc_cli.stages.nightly.plan.planned import PlannedNight, RobotPlan, Situation
from opamc_cli.stages.nightly.plan.reason import has_other_recordings
from opamc_cli.stages.nightly.plan.robot import plan_robot
from opamc_cli.stages.nightly.start.jobs import COPIES
from opamc_cli.stages.nightly.start.lost import say_lost
from opamc_cli.stages.nightly.start.outcome import CellOutcome, Wanted
from opamc_cli.stages.nightly.start.past import Past
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import UNJUDGED, Event


@dataclass(frozen=True)
class Scene:
    """What a start looks at; it stays as it is until its end."""

    cell: CellConfig
    source: str
    """Name of the cell's file, for errors."""
    wanted: Wanted
    recordings: CellRecordings
    """All that are there, but those that may be another robot's."""
    hours: Mapping[str, Hours]
    """At which each robot usually records."""
    now: datetime
    """As the start began."""

    def may_begin(self, robot: str, night: str) -> bool:
        """Whether a robot may record of a night yet."""
        return self.hours.get(robot, Hours()).may_begin(night, self.now)


@dataclass
class Look:
    """What one look at some robots found."""

    to_judge: list[PlannedNight] = field(default_factory=list)
    """The newest night first: it is what the morning asks for."""
    unjudged: list[PlannedNight] = field(default_factory=list)
    """New nights that have nothing to be compared with, or no recording that can be used."""
    waiting: set[str] = field(default_factory=set)
    """Robots of which more is to be done once these nights are judged."""
    several: set[str] = field(default_factory=set)
    """Robots with nights of more than one condition."""


def arrive(
    cell: CellConfig, source: str, history: History, wanted: Wanted
) -> tuple[Scene, Past, CellOutcome]:
    """Find all recordings and what is known, and say what is odd about them."""
    say_lost(cell, history)
    found = find_recordings(cell, history, wanted.robots, cell.out / COPIES)
    past = Past(cell, history)
    own = without_strangers(found.by_robot, found.baseline_by_robot, found.beside, past.recorded)
    hours = {robot: usual_hours(recordings) for robot, recordings in own.items()}
    scene = Scene(cell, source, wanted, replace(found, by_robot=own), hours, datetime.now(UTC))
    outcome = CellOutcome(robots=tuple(sorted(own)))
    outcome.strays = [
        Event(path, robot, None, "stray", said_of_strays([path])) for robot, path in found.strays
    ]
    outcome.unnamed = [
        Event(path, robot, None, "unnamed", said_of_unnamed({robot: path}))
        for robot, path in found.unnamed
    ]
    outcome.thinned = [
        Event(
            one.night,
            robot,
            None,
            "lacking",
            f"its baseline: {one.log.path} has the same bytes as {other.log.path} of "
            f"{other.log.robot}",
        )
        for robot, one, other in said_of_baselines(found.baseline_by_robot, own)
    ]
    _look_for_absent(scene, past, outcome)
    return scene, past, outcome


def look_at(
    robots: Sequence[str],
    scene: Scene,
    past: Past,
    history: History,
    tried: set[tuple[str, str, str]],
    outcome: CellOutcome,
    *,
    has_news: bool,
) -> Look:
    """Find what is to be done of some robots, and remember their baselines.

    Parameters
    ----------
    robots
        Names.
    scene, past, history
        What there is and what is known.
    tried
        Robot, night and key of the nights that this start has done; those that are found now are
        added.
    outcome
        Takes what is worth saying.
    has_news
        Whether the last look found anything to do: else there is nothing to wait for.
    """
    done = {key[:2] for key in tried} if has_news else None
    look = Look()
    for robot in robots:
        planned = plan_of(robot, scene, past, done)
        if planned.waiting:
            look.waiting.add(robot)
        if planned.several_conditions:
            look.several.add(robot)
        _keep_baselines(history, past, scene.recordings.by_robot[robot], robot, planned, outcome)
        known = past.recorded.get(robot, {})
        others = [n for n in planned.nights if has_other_recordings(n, known.get(n.night))]
        if others and (robot, others[0].night, others[0].key) not in tried:
            history.record_news(_of_other_recordings(robot, others))
        for night in planned.nights:
            place = (robot, night.night, night.key)
            if not scene.wanted.has(night.night) or place in tried:
                continue
            outcome.plan(night)
            if night.why:
                tried.add(place)
                compared = any(one.baseline for one in night.comparisons)
                (look.to_judge if compared else look.unjudged).append(night)
    look.to_judge.sort(key=lambda night: (night.night, night.robot), reverse=True)
    return look


def _of_other_recordings(robot: str, nights: Sequence[PlannedNight]) -> Event:
    """Say that nights are judged anew: who drops a file into an old folder moves all verdicts."""
    held = {one.log.path for night in nights for each in night.comparisons for one in each.baseline}
    of = nights[0].night if len(nights) == 1 else f"{len(nights)} nights"
    text = (
        f"its baseline, now of {len(held)} recordings: one is new or has changed; {of} judged anew"
    )
    return Event(nights[0].night, robot, None, "lacking", text)


def plan_of(robot: str, scene: Scene, past: Past, done: set[tuple[str, str]] | None) -> RobotPlan:
    """Say what is to be done of a robot; `done`: nights that this start did, None: await none."""
    cell, recordings = scene.cell, scene.recordings
    config = cell.diagnosis_of(robot, scene.source)
    axes = cell.axes_of(robot)
    pinned = past.pinned.get(robot, {})
    fixed, own = recordings.baseline_by_robot[robot], recordings.by_robot[robot]
    older = sorted(pinned, key=lambda key: (pinned[key][0], key))
    rates = named_rates((condition for _, condition, _ in older), [*fixed, *own])
    situation = Situation(
        baseline=cell.baseline,
        fixed=at_named_rates(fixed, rates),
        gone=at_named_rates(recordings.gone_by_robot[robot], rates),
        gone_fixed=at_named_rates(recordings.gone_of_baseline[robot], rates),
        begun=past.begun.get(robot, ()),
        pinned=pinned,
        recorded=past.recorded.get(robot, {}),
        removed=past.removed.get(robot, ()),
        config_hash=config.digest() + ("" if axes is None else f" axes {axes}"),
        alarms=past.alarms.get(robot, ()),
        is_to_come=lambda night: (
            done is not None and scene.wanted.has(night) and (robot, night) not in done
        ),
        is_running=lambda night: scene.hours[robot].may_go_on(night, scene.now),
    )
    return plan_robot(robot, at_named_rates(own, rates), situation)


def _keep_baselines(
    history: History,
    past: Past,
    own: Sequence[Recording],
    robot: str,
    planned: RobotPlan,
    outcome: CellOutcome,
) -> None:
    """Remember the baselines that are complete, and forget what there is nothing of any more."""
    for key, members in planned.complete.items():
        if past.pinned.get(robot, {}).get(key) != list(members):
            history.pin_baseline((robot, *key), members)
    if not planned.waiting:
        _forget(history, past, robot, own, planned)
    said = [Event(night, robot, None, "thinned", text) for night, text in planned.thinned]
    outcome.thinned += [one for one in said if one not in outcome.thinned]
    outcome.gathering[robot] = [
        Event(night, robot, None, "gathering", text) for night, text in planned.gathering
    ]


def _forget(
    history: History, past: Past, robot: str, own: Sequence[Recording], planned: RobotPlan
) -> None:
    """Forget what became of nights that there is nothing of, and reports that are gone for good."""
    there = {one.night for one in own}
    # older ones are cleared away by age, and their logs may be out of reach all together
    last = max(there, default="9999")
    lost = [
        night
        for night, row in past.recorded.get(robot, {}).items()
        if night not in there and (not night or (night > last and row.status in UNJUDGED))
    ]
    if lost:
        history.forget_nights(robot, lost)
    to_do = {night.night for night in planned.nights if night.why}
    gone = [night for night in past.removed.get(robot, ()) if night not in to_do]
    if gone:
        text = f"the results of {some(gone)} are gone, and not all that they were made from is left"
        history.forget_reports(robot, gone, [Event(gone[-1], robot, None, "lacking", text)])


def _look_for_absent(scene: Scene, past: Past, outcome: CellOutcome) -> None:
    """Say where there is nothing of what was asked for: it may be mistyped, or out of reach."""
    cell, wanted, by_robot = scene.cell, scene.wanted, scene.recordings.by_robot
    if not any(by_robot.values()):
        named = wanted.robots or (None if cell.robots == "auto" else tuple(cell.robots))
        names = "" if named is None else f" of {some(named)}"
        outcome.absent.append(
            f"{cell.runs}: no file{names} fits this pattern any more; is its folder there?"
        )
        return
    if wanted.night is None and wanted.since is None:
        return
    what = f"of {wanted.night}" if wanted.night else f"since {wanted.since}"
    without = [
        robot
        for robot, own in by_robot.items()
        if not any(map(wanted.has, {*(one.night for one in own), *past.recorded.get(robot, ())}))
    ]
    # robots that rest are no news to who asks for all nights since one
    if without and (wanted.night or len(without) == len(by_robot)):
        outcome.absent.append(f"no recording {what} of {some(without)}")
        night = wanted.night or wanted.since or ""
        outcome.failed += [(robot, night, f"no recording {what}") for robot in without]
