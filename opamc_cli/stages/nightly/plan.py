"""What is to be done of a robot's nights, and why: no recording is opened here."""

import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from opamc_cli import __version__
from opamc_cli.config.cell import BaselineConfig
from opamc_cli.config.models import digest
from opamc_cli.stages.nightly.inputs.baseline_name import baseline_name
from opamc_cli.stages.nightly.inputs.recordings import Recording, some
from opamc_cli.storage.history import AlarmSpan, NightRow
from opamc_cli.storage.logs import Facts

LEAST_NIGHTS = 2
"""Nights that must be left of a baseline: one says nothing of how much nights differ."""

NIGHTS_AGAIN = 6
"""Nights of a baseline that is begun anew where the first one was given by dates or files."""

MOST_ATTEMPTS = 3
"""Starts in which a night may break (time, memory, death of its worker) before it is left alone."""


MOST_GONE = 6
"""Recordings of a baseline that are gone of which every choice is tried: 64."""


@dataclass(frozen=True)
class Comparison:
    """The recordings of one program in one night, and those that they are held against."""

    program: str
    condition: str
    """With `program`: what they have in common."""
    targets: tuple[Recording, ...]
    """Recordings of the night."""
    baseline: tuple[Recording, ...] = ()
    """Recordings of the healthy state; empty while it is being recorded."""
    baseline_name: str = ""
    """Name of the baseline; the series of nights begins anew where it changes."""
    missing: str = ""
    """Why there is nothing to compare with; empty if there is."""
    members: tuple[str, ...] = ()
    """Nights of a baseline that is complete, with or without their recordings."""
    lost: bool = False
    """Whether some of these have none any more."""
    gone: tuple[Recording, ...] = ()
    """Recordings that the others once had beside those that are left."""


@dataclass(frozen=True)
class PlannedNight:
    """One robot's night."""

    robot: str
    night: str
    comparisons: tuple[Comparison, ...]
    """One for each program."""
    broken: tuple[Recording, ...]
    """Recordings that cannot be used."""
    notes: tuple[str, ...]
    """What is worth knowing besides."""
    key: str
    """Hash of everything that the result depends on."""
    why: str
    """Why it is to be done; empty if it is done."""

    @property
    def in_baseline(self) -> bool:
        """Whether nothing is judged: the night is, or will be, part of the healthy state."""
        return bool(self.comparisons) and not any(
            one.baseline or one.missing for one in self.comparisons
        )


@dataclass(frozen=True)
class Situation:
    """What is known of a robot beside its recordings."""

    baseline: BaselineConfig
    """How the cell tells the healthy state."""
    fixed: Sequence[Recording]
    """Recordings that `baseline.runs` names."""
    gone: Sequence[Recording]
    """Recordings that are there no more."""
    gone_fixed: Sequence[Recording]
    """Those that `baseline.runs` names."""
    begun: Sequence[str]
    """Nights from which a baseline was declared to begin anew, ascending."""
    pinned: Mapping[tuple[str, str, str], Sequence[str]]
    """Nights of baselines that were complete before, by program, condition and since."""
    recorded: Mapping[str, NightRow]
    """What became of the robot's nights."""
    removed: Sequence[str]
    """Nights whose results somebody has removed."""
    config_hash: str
    """Of the options of its diagnosis."""
    alarms: Sequence[AlarmSpan] = ()
    """Its alarms, by the night in which they were raised."""
    is_to_come: Callable[[str], bool] = bool
    """Whether this start will judge a night if it has to be."""


@dataclass(frozen=True)
class RobotPlan:
    """All nights of a robot, and the baselines that are complete by now."""

    nights: tuple[PlannedNight, ...]
    complete: Mapping[tuple[str, str, str], tuple[str, ...]]
    thinned: tuple[tuple[str, str], ...] = ()
    """Of baselines that lost recordings: what is gone, and a sentence."""
    gathering: tuple[tuple[str, str], ...] = ()
    """Of conditions without a baseline beside others that have one: first night, and a sentence."""
    waiting: bool = False
    """Whether there is more to do once these nights are judged and alarms are known."""

    @property
    def several_conditions(self) -> bool:
        """Whether the robot has nights of more than one program or condition."""
        all_of = (
            (one.program, one.condition) for night in self.nights for one in night.comparisons
        )
        return len(set(all_of)) > 1


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
    recordings = _without_copies(recordings)
    usable = [one for one in recordings if not one.facts.error]
    fixed = {one.sha256 for one in now.fixed}
    judged = [one for one in usable if one.sha256 not in fixed]
    series = _main_conditions(judged)
    baselines = _Baselines(now, series, usable, {one.night for one in recordings})
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
        notes: list[str] = []
        comparisons = []
        for program in sorted(programs_of.get(night, ())):
            condition, targets = series[program, night]
            comparisons.append(baselines.comparison(program, condition, night, tuple(targets)))
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
        key = _key(comparisons, broken, now.config_hash, known)
        now_there = json.loads(key)["baseline"]
        if now_there not in before:
            before[now_there] = _before(comparisons, known)
        earlier = before[now_there]
        record = now.recorded.get(night)
        why = _why(key, record, any(one.lost for one in comparisons), earlier)
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


def _without_copies(recordings: Sequence[Recording]) -> list[Recording]:
    """Have recordings of an earlier night stand for nothing: a logger that is stuck repeats one."""
    first: dict[str, Recording] = {}
    for one in sorted(recordings, key=lambda one: (one.night, one.log.path)):
        if not one.facts.error:
            first.setdefault(one.sha256, one)
    found = []
    for one in recordings:
        original = first.get(one.sha256, one)
        if original.night != one.night and not one.facts.error:
            error = f"{one.log.path}: is a copy of {original.log.path}; was that night recorded?"
            one = replace(one, facts=Facts(error=error))
        found.append(one)
    return found


Series = dict[tuple[str, str], tuple[str, list[Recording]]]
"""Condition and recordings by program and night."""


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


class _Baselines:
    """Which recordings a night is held against."""

    def __init__(
        self, now: Situation, series: Series, usable: Sequence[Recording], nights: set[str]
    ) -> None:
        self._now = now
        self._series = series
        self._usable = usable
        self._nights = nights
        self._complete_before = {
            (key[0], baseline_name(f"from {nights[0]}", key[1])): (key, nights[-1])
            for key, nights in now.pinned.items()
        }
        """Baselines and their last nights, by program and name."""
        self.complete: dict[tuple[str, str, str], tuple[str, ...]] = {}
        self._thinned: dict[tuple[str, str, str], tuple[str, str]] = {}
        self._gone: dict[str, str] = {}
        self._there: dict[tuple[str, str, str], dict[str, list[Recording]]] = {}
        self._used: dict[
            tuple[str, str, str], tuple[tuple[Recording, ...], tuple[Recording, ...]]
        ] = {}

    def comparison(
        self, program: str, condition: str, night: str, targets: tuple[Recording, ...]
    ) -> Comparison:
        since = max((begun for begun in self._now.begun if begun <= night), default="")
        rule = self._now.baseline
        if since or rule.nights is not None:
            key = (program, condition, since)
            members = self._first_nights(key)
            alarm = None if members else self._alarm_over(key, night)
            if alarm is not None:
                why = (
                    f"the alarm of {alarm.raised} stands on axis {alarm.axis}: no night under it "
                    f"becomes part of a baseline, and that of {condition} is not complete"
                )
                return Comparison(program, condition, targets, missing=why)
            inside = not members or night in members
            name = f"from {members[0]}" if members else ""
        else:
            name = "runs" if rule.runs is not None else f"{rule.first} to {rule.last}"
            key = (program, condition, rule.runs or name)
            members = sorted({*self._now.pinned.get(key, ()), *self._fixed_there(key)})
            inside = rule.runs is None and str(rule.first) <= night <= str(rule.last)
        if members:
            self.complete[key] = tuple(members)
        if inside:
            return Comparison(program, condition, targets)
        if not members:
            return Comparison(program, condition, targets, missing=self._never_there(key))
        left = [n for n in members if n in self._there[key]]
        gone = ", ".join(n for n in members if n not in left)
        there = {one.night for one in self._now.fixed} if key[2] == rule.runs else self._nights
        how = "are gone" if there.isdisjoint({*members} - {*left}) else "cannot be used any more"
        if gone and len(left) < LEAST_NIGHTS:
            why = (
                f"the recordings of the baseline's nights {gone} {how}; put them back, or begin a "
                "new baseline with `opamc nightly rebaseline`"
            )
            return Comparison(program, condition, targets, (), "", why, tuple(members), True)
        if gone:
            self._thinned[key] = (
                max(set(members) - set(left)),
                f"the recordings of the baseline's nights {gone} {how}, {len(left)} nights "
                f"are left; put them back, with fewer than {LEAST_NIGHTS} nothing is judged",
            )
        if key not in self._used:
            used = tuple(one for n in left for one in self._there[key][n])
            self._used[key] = used, tuple(self._gone_from(key, left))
        used, lost = self._used[key]
        name = baseline_name(name, condition)
        of = tuple(members)
        return Comparison(program, condition, targets, used, name, "", of, bool(gone), lost)

    def say_gone(self, recordings: Sequence[Recording]) -> None:
        """Have it said that a baseline has lost recordings that a night was judged with."""
        self._gone |= {one.name: one.log.path for one in recordings}

    def said(self) -> tuple[tuple[str, str], ...]:
        """Return what is gone of baselines, each with a sentence; of one start they are one."""
        is_gone = "is gone" if len(self._gone) == 1 else "are gone"
        text = (
            f"of the baseline {some(sorted(self._gone.values()))} {is_gone}; what was judged "
            "stays, new nights are judged by the recordings that are left"
        )
        return (*self._thinned.values(), *((name, text) for name in sorted(self._gone)))

    def gathering(self) -> Iterator[tuple[str, str]]:
        """Say of which conditions no night is judged yet, though the robot is by others.

        Nights of which none is judged are no news: that is how a robot begins, and begins anew.
        """
        last = max(self._nights, default="")
        since = max((begun for begun in self._now.begun if begun <= last), default="")
        if not since and self._now.baseline.nights is None:
            return
        wanted = self._now.baseline.nights or NIGHTS_AGAIN
        several = len({program for program, _ in self._series}) > 1
        conditions = {(program, self._series[program, n][0]) for program, n in self._series}
        keys = [(*one, since) for one in sorted(conditions)]
        if not any(key in self.complete for key in keys):
            return
        for key in keys:
            program, condition, _ = key
            nights = [n for n in self._nights_there(key) if self._alarm_over(key, n) is None]
            if nights and key not in self.complete:
                of = f" of program {program!r}" if several else ""
                yield (
                    nights[0],
                    f"nights{of} at {condition} are not judged, they have no baseline yet: "
                    f"{len(nights)} of {wanted} gathered",
                )

    def _gone_from(self, key: tuple[str, str, str], left: Sequence[str]) -> Iterator[Recording]:
        """Yield what nights of a baseline have lost; what was renamed is there."""
        told_by_files = self._now.baseline.runs is not None and key[2] == self._now.baseline.runs
        there = {one.sha256 for n in left for one in self._there[key][n]}
        for one in self._now.gone_fixed if told_by_files else self._now.gone:
            same = (one.facts.program, one.condition) == key[:2] and one.night in left
            if same and not one.facts.error and one.sha256 not in there:
                yield one

    def _first_nights(self, key: tuple[str, str, str]) -> list[str]:
        """Return the nights of a baseline that begins with the first ones; empty: too few yet."""
        wanted = self._now.baseline.nights or NIGHTS_AGAIN
        before = self._now.pinned.get(key, ())
        pinned = [n for n in before if self._alarm_over(key, n) is None]
        # the file asks for more nights than before, or some are under alarm by nights that came
        # later: those that follow, as soon as they are there
        longer = pinned + [
            n
            for n in self._nights_there(key)
            if (not before or n > before[-1]) and self._alarm_over(key, n) is None
        ]
        if len(longer) >= wanted:
            return longer[:wanted]
        return pinned if len(pinned) == len(before) else []

    def _alarm_over(self, key: tuple[str, str, str], night: str) -> AlarmSpan | None:
        """Return the alarm that keeps a night out of a baseline; None without one.

        A baseline's own nights raise alarms after it alone; of two others the one that was complete
        first judges the nights of the second.
        """
        for alarm in self._now.alarms:
            if alarm.raised <= night < alarm.cleared:
                raised_by = self._complete_before.get((alarm.program, alarm.baseline))
                if raised_by is None:
                    continue
                (*condition, since), last = raised_by
                if since == key[2] and tuple(condition) != key[:2] and last < night:
                    return alarm
        return None

    def _nights_there(self, key: tuple[str, str, str]) -> dict[str, list[Recording]]:
        """Return the nights that may belong to a baseline, the same for all its nights."""
        if key not in self._there:
            program, condition, since = key
            until = min((begun for begun in self._now.begun if begun > since), default="9999")
            self._there[key] = {
                n: recordings
                for (p, n), (c, recordings) in sorted(self._series.items(), key=lambda one: one[0])
                if p == program and c == condition and since <= n < until
            }
        return self._there[key]

    def _fixed_there(self, key: tuple[str, str, str]) -> dict[str, list[Recording]]:
        """Return what there is of a baseline that dates or files tell, by night."""
        if key not in self._there:
            self._there[key] = {}
            for one in self._told():
                if (one.facts.program, one.condition) == key[:2]:
                    self._there[key].setdefault(one.night, []).append(one)
        return self._there[key]

    def _told(self) -> list[Recording]:
        rule = self._now.baseline
        if rule.runs is not None:
            return [one for one in self._now.fixed if not one.facts.error]
        return [one for one in self._usable if str(rule.first) <= one.night <= str(rule.last)]

    def _never_there(self, key: tuple[str, str, str]) -> str:
        program, condition, _ = key
        known = sorted({one.condition for one in self._told() if one.facts.program == program})
        if not known:
            return f"the baseline has no recording of program {program!r}"
        return f"the baseline was recorded at {' and '.join(known)}, the night at {condition}"


def _key(
    comparisons: Sequence[Comparison],
    broken: Sequence[Recording],
    config_hash: str,
    known: dict[int, list[str]],
) -> str:
    """Return what a night's result depends on, so that it can be said what has changed."""
    for one in comparisons:
        if id(one.baseline) not in known:
            # the same tuple for all nights of a baseline, alive as long as the plan is made
            known[id(one.baseline)] = sorted(each.identity for each in one.baseline)
    targets = [one.identity for each in comparisons for one in each.targets]
    return json.dumps(
        {
            "version": __version__,
            "config": config_hash,
            "baseline": _baseline_digest(comparisons, known, ()),
            "members": digest({"of": [[one.program, one.members] for one in comparisons]}),
            "files": sorted([*targets, *(one.identity for one in broken)]),
        },
        sort_keys=True,
    )


def _baseline_digest(
    comparisons: Sequence[Comparison], known: Mapping[int, list[str]], gone: Sequence[Recording]
) -> str:
    """Return the hash of what nights are compared with, and recordings that are gone beside it."""
    rest = [
        [
            one.program,
            one.condition,
            one.missing,
            sorted([*known[id(one.baseline)], *(r.identity for r in one.gone if r in gone)]),
        ]
        for one in comparisons
    ]
    return digest({"of": rest})


def _before(
    comparisons: Sequence[Comparison], known: Mapping[int, list[str]]
) -> dict[str, tuple[Recording, ...]]:
    """Return what the baselines may have had before, by its hash: they lose one after the other."""
    gone = [recording for one in comparisons for recording in one.gone]
    # of many, all at once: what was judged in between is judged anew
    counts = range(1, len(gone) + 1) if len(gone) <= MOST_GONE else (len(gone),)
    return {
        _baseline_digest(comparisons, known, choice): choice
        for count in counts
        for choice in combinations(gone, count)
    }


def _why(
    key: str,
    record: NightRow | None,
    lost: bool,
    earlier: Mapping[str, object],
) -> str:
    """Say why a night is to be done; empty if its record stands."""
    if record is None:
        return "new"
    now, then = json.loads(key), json.loads(record.key)
    if now["version"] != then["version"]:
        return f"judged by version {then['version']}"
    if now["config"] != then["config"]:
        return "other options"
    # what was judged stays judged when its logs are cleared away, or some of its baseline's
    lost = lost or then["baseline"] in earlier
    kept = lost and record.status != "failed" and now["members"] == then.get("members")
    if now["baseline"] != then["baseline"] and not kept:
        return "the baseline has changed"
    added = set(now["files"]) - set(then["files"])
    if added:
        return f"{len(added)} new or changed file{'s' if len(added) > 1 else ''}"
    if record.status == "broken" and record.attempts < MOST_ATTEMPTS:
        return f"broke before ({record.why})"
    return ""
