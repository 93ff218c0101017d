"""Which recordings a night is held against."""

from collections.abc import Iterator, Sequence

from opamc_cli.stages.nightly.alarms.commands import REBASELINE
from opamc_cli.stages.nightly.inputs.baseline_name import baseline_name
from opamc_cli.stages.nightly.inputs.recordings import Recording, some
from opamc_cli.stages.nightly.plan.planned import Comparison, Situation
from opamc_cli.storage.history.rows import AlarmSpan
from opamc_cli.storage.logs import Facts

LEAST_NIGHTS = 2
"""Nights that must be left of a baseline: one says nothing of how much nights differ."""

NIGHTS_AGAIN = 6
"""Nights of a baseline that is begun anew where the first one was given by dates or files."""
Series = dict[tuple[str, str], tuple[str, list[Recording]]]
"""Condition and recordings by program and night."""


class Baselines:
    """Which recordings a night is held against."""

    def __init__(
        self, now: Situation, series: Series, usable: Sequence[Recording], nights: set[str]
    ) -> None:
        self._now = now
        self._series = series
        self._usable = usable
        self._nights = nights
        self._programs: dict[str, set[str]] = {}
        for program, night in series:
            self._programs.setdefault(night, set()).add(program)
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
        """Say what a night's recordings of a program and condition are held against."""
        since = max((begun for begun in self._now.begun if begun <= night), default="")
        rule = self._now.baseline
        if since or rule.nights is not None:
            key = (program, condition, since)
            members = self._first_nights(key)
            alarm = None if members else self._alarm_over(key, night)
            if alarm is not None:
                why = (
                    f"the alarm of {alarm.raised} stands on axis {alarm.axis}: no night under it "
                    f"becomes part of a baseline, and that of {condition} is not complete; after "
                    f"a repair, or if it is meant to stay: {REBASELINE}"
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
        picked = key[2] == rule.runs
        there = {one.night for one in self._now.fixed} if picked else self._nights
        how = "are gone" if there.isdisjoint({*members} - {*left}) else "cannot be used any more"
        if gone and len(left) < LEAST_NIGHTS:
            why = (
                f"the recordings of the baseline's nights {gone} {how}; put them back, or begin a "
                f"new baseline: {REBASELINE}"
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
        each = set.intersection(*(self._programs.get(n, set()) for n in members))
        absent = () if picked else tuple(sorted(each - self._programs[night]))
        return Comparison(
            program, condition, targets, used, name, "", of, bool(gone), lost, picked, absent
        )

    def say_gone(self, recordings: Sequence[Recording]) -> None:
        """Have it said that a baseline has lost recordings that a night was judged with."""
        self._gone |= {one.name: one.log.path for one in recordings}

    def said(self) -> tuple[tuple[str, str], ...]:
        """Return what is gone of baselines, each with a sentence; of one start they are one."""
        text = (
            f"its baseline has lost {some(sorted(self._gone.values()))}; what was judged "
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
                    f"{len(nights)} of {wanted} gathered{self._newly_said(key)}",
                )

    def _newly_said(self, key: tuple[str, str, str]) -> str:
        """Say what metadata alone may have made a condition: a logger that was updated."""
        now = self._told_by(key)
        for other in self.complete:
            then = self._told_by(other)
            if other[::2] == key[::2] and then < now and self._there[other]:
                return f"; its metadata now say {', '.join(sorted(now - then))}"
        return ""

    def _told_by(self, key: tuple[str, str, str]) -> set[str]:
        """Return speed and payload of a condition, as far as its metadata say them."""
        of = next((night[0].facts for night in self._nights_there(key).values()), Facts())
        told = (("speed", of.speed_percent, "%"), ("payload", of.payload_kg, "kg"))
        return {f"{name} {value:g} {unit}" for name, value, unit in told if value is not None}

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
        there = self._nights_there(key)  # also for who looks it up under the key hereafter
        pinned = [n for n in before if self._alarm_over(key, n) is None]
        if len(pinned) >= wanted:
            return pinned[:wanted]  # asked for each night, over all nights: a tenth of a start
        # the file asks for more nights than before, or some are under alarm by nights that came
        # later: those that follow, as soon as they are there
        longer = pinned + [
            n for n in there if (not before or n > before[-1]) and self._alarm_over(key, n) is None
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
