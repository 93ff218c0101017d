"""Which axes cannot be judged, and the true reason: what no verdict may be silent about."""

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from opamc_cli.errors import InputError, NotEnoughDataError, OpamcError
from opamc_cli.signal.cycles.changed import OneOff, one_off
from opamc_cli.signal.cycles.features import MatchRule
from opamc_cli.stages.chain.compared.side import Sides
from opamc_cli.stages.chain.compared.speeds import of_another_speed
from opamc_cli.stages.chain.cycles.axis import segment_features
from opamc_cli.stages.verdict.agreement.findings import Finding
from opamc_cli.stages.verdict.agreement.measured import Measured
from opamc_cli.stages.verdict.evidence import session_names
from opamc_cli.stages.verdict.wording.brief import with_shaken
from opamc_cli.storage.schemas.channels import axes_phrase

MUCH_SHORTER = 0.5
"""Of the baseline's shortest recording: what lasts less may hold no whole cycle, and that is said
before anything else."""


@dataclass(frozen=True)
class Side:
    """Baseline or target, as far as the comparison needs it."""

    role: str
    """"baseline" or "target"."""
    measured: Sequence[Measured]
    """Every axis of every run."""
    findings: Sequence[Finding]
    """What is left out of the comparison."""
    motions: pa.Table
    """Rows of the motion table."""
    slowness: Mapping[str, float] = field(default_factory=dict)
    """By run of another speed, how many times as long as the baseline's its motions last."""
    rule: MatchRule = field(default_factory=MatchRule)
    """When segments are a cycle."""
    two_speeds: Collection[str] = ()
    """Runs of which some cycles are left out, as is said: they are of another speed."""
    missing: Mapping[tuple[str, int], int] = field(default_factory=dict)
    """Samples of a current, position or speed that are lost, by run and axis."""

    def moving_axes(self) -> set[int]:
        """Return the axes that move in any run, whether they are compared or not."""
        return {own.axis for own in self.measured if own.moves}

    def rows(self, axis: int, run: str) -> pa.Table:
        """Return the motion table's rows of one axis of one run."""
        mask = pc.and_(pc.equal(self.motions["axis"], axis), pc.equal(self.motions["run"], run))
        return self.motions.filter(mask)


@dataclass(frozen=True)
class Unjudged:
    """What is left out, and why."""

    axes: Mapping[int, tuple[str, ...]]
    """Sentences for each axis of which nothing is left on one side."""
    errors: tuple[OpamcError, ...]
    """One for each run of the target of which axes were left out while others serve."""
    of_baseline: tuple[OpamcError, ...] = ()
    """The same of the baseline's runs: the target is judged by the others."""
    at_rest: Mapping[int, Mapping[str, InputError]] = field(default_factory=dict)
    """By axis and run of the target, why it has none, which is usual where axes move in turn."""
    unrecorded: Mapping[int, Collection[str]] = field(default_factory=dict)
    """By axis that other runs have, runs of the baseline that have no current of it."""
    foreign: frozenset[int] = frozenset()
    """Axes whose target is of another program or log, by motions that fit nothing or its sign."""

    def sessions_without(self, sides: Sides) -> list[InputError]:
        """Return one for each axis of which the baseline's sessions, but few, have a current."""
        told = sides.sessions[0]
        found = []
        for axis, runs in self.unrecorded.items():
            has = {session for run, session in told.of_run.items() if run not in runs}
            lacking = sorted({*told.of_run.values()} - has)
            if 0 < len(lacking) < len(has):
                of = ", ".join(told.named(session) for session in lacking)
                verb = "has" if len(lacking) == 1 else "have"
                found.append(
                    InputError(
                        f"{of} of the baseline {verb} no current of axis {axis}", axes=[axis]
                    )
                )
        return found

    def sessions_at_rest(self, sides: Sides) -> list[InputError]:
        """Return one for each axis that rests in all of a target session, if in no other.

        Of several target sessions one may lack what all of the baseline have: a sensor that died.
        """
        of_run = sides.sessions[1].of_run
        found = []
        for axis, runs in self.at_rest.items():
            own, other = session_names(axis, *sides.rows)
            if not other or len(own) < len(sides.sessions[0]):
                continue
            lacking = sorted({*of_run.values()} - {*other})
            for session in lacking:
                found += [why for run, why in runs.items() if of_run.get(run) == session][:1]
        return found


def unjudged(baseline: Side, target: Side) -> Unjudged:
    """Find the axes that move on either side but cannot be compared."""
    axes: dict[int, tuple[str, ...]] = {}
    dropped: dict[tuple[Path, str], dict[int, str]] = {}
    n_lost: Counter[Path] = Counter()
    at_rest: dict[int, dict[str, InputError]] = {}
    foreign: set[int] = set()
    unrecorded: dict[int, set[str]] = {}
    for axis in sorted(baseline.moving_axes() | target.moving_axes()):
        for side in (target, baseline):
            lost = _lost(axis, side, baseline)
            idle = _idle(axis, side)
            paths = {own.run: own.path for own in side.measured}
            if side is baseline:
                unrecorded[axis] = {*paths} - {o.run for o in side.measured if o.axis == axis}
            n_lost.update(paths[run] for run in lost)
            if paths.keys() <= lost.keys() | idle.keys():
                whys = {_but_numbers(why): why for why in (lost or idle).values()}
                said = tuple(sentence(side.role, why) for why in whys.values())
                axes[axis] = axes.get(axis, ()) + said
                if side is baseline:  # each night finds that so
                    foreign.discard(axis)
                elif lost and not lost.keys() & _of_sensors(axis, side):
                    foreign.add(axis)
                continue
            for run, why in lost.items():
                # what is wrong with all of a recording is said once
                dropped.setdefault((paths[run], _but_numbers(why)), {})[axis] = why
            if side is target:
                at_rest[axis] = {
                    run: InputError(f"{paths[run]}: {idle[run]}", axes=[axis]) for run in idle
                }
    n_axes = Counter(own.path for side in (baseline, target) for own in side.measured)
    of_side: dict[str, list[OpamcError]] = {}
    roles = {own.path: side.role for side in (target, baseline) for own in side.measured}
    for (path, _), lacking in dropped.items():
        (first, why), *others = lacking.items()
        which = "Only axis" if n_lost[path] == 1 < n_axes[path] else "Axis"
        left_out = f" {which} {first} of this recording is left out"
        if others and len(set(lacking.values())) > 1:
            rest = ", ".join(str(axis) for axis, _ in others)
            why += f" (ax{'i' if len(others) == 1 else 'e'}s {rest} likewise)"
        error = InputError(f"{path}: {_ended(why)}{left_out * (not others)}", axes=lacking)
        of_side.setdefault(roles[path], []).append(error)
    errors, of_baseline = (tuple(of_side.get(side.role, ())) for side in (target, baseline))
    return Unjudged(axes, errors, of_baseline, at_rest, unrecorded, frozenset(foreign))


def _but_numbers(why: str) -> str:
    """Return a reason without what differs from one axis or recording to the next."""
    return re.sub(r"\d[\d.]*", "#", why)


def refuse_all(axes: Mapping[int, Sequence[str]], unlike: str = "") -> None:
    """Refuse a diagnosis of which no axis is left; `unlike` tells of declared conditions.

    Raises
    ------
    NotEnoughDataError
        With the reason of the first axis.
    """
    axis, whys = next(iter(axes.items()))
    others = f"; {len(axes) - 1} more axes likewise" if len(axes) > 1 else ""
    others += f"; {unlike}" if unlike else ""
    msg = f"no axis can be judged; axis {axis}: {' '.join(whys).rstrip('.')}{others}"
    raise NotEnoughDataError(msg)


def with_reasons(
    verdict: Mapping[str, Any], left_out: Mapping[int, Sequence[str]]
) -> dict[str, Any]:
    """Return a verdict that names every axis that could not be judged, with its true reason."""
    named: dict[int, dict[str, Any]] = {entry["axis"]: dict(entry) for entry in verdict["axes"]}
    for axis, why in left_out.items():
        entry = named.get(axis, {"axis": axis, **_EMPTY})
        named[axis] = {**entry, **_UNKNOWN, "reasons": list(why)}
    return {**verdict, "axes": with_shaken([named[axis] for axis in sorted(named)])}


_UNKNOWN: Mapping[str, Any] = {
    "state": "insufficient-data",
    "excused": False,
    "health_index": None,
    "p_value": None,
    "p_adjusted": None,
    "cause": None,
    "brief": None,
}
_EMPTY: Mapping[str, Any] = {
    "features": {"delta_mu": None, "delta_var": None, "ks": None},
    "motions": [],
}


def sentence(role: str, why: str) -> str:
    """Return a clause about one side as a sentence."""
    return f"The {role}: {_ended(why)}"


def _ended(why: str) -> str:
    return why if why.endswith("?") else f"{why}."


def _lost(axis: int, side: Side, baseline: Side) -> dict[str, str]:
    """Return, by run, what is wrong with an axis."""
    own = [f for f in side.findings if f.axis == axis]
    lost = {finding.run: finding.why for finding in own if not finding.at_rest}
    for measured in side.measured:
        if measured.axis != axis or not measured.moves or measured.run in lost:
            continue
        rows = side.rows(axis, measured.run)
        if not rows.num_rows:
            lost[measured.run] = f"the motions of axis {axis} could not be identified"
        elif pc.max(rows["cycle"]).as_py() < 0:
            ratio = side.slowness.get(measured.run)
            lost[measured.run] = (
                _unfitting(axis, rows, baseline, _fitting_beside(axis, measured.run, side))
                if ratio is None
                else of_another_speed(ratio)
            )
    return lost


def _fitting_beside(axis: int, run: str, side: Side) -> list[int]:
    """Return the other axes whose cycles are found in a run."""
    of_run = side.motions.filter(pc.equal(side.motions["run"], run))
    fitting = of_run.filter(pc.greater_equal(of_run["cycle"], 0))["axis"]
    return sorted(set(fitting.to_pylist()) - {axis})


def _of_sensors(axis: int, side: Side) -> set[str]:
    """Return the runs in which a channel of an axis is bad, whatever the others are."""
    own = [f for f in side.findings if f.axis == axis]
    return {finding.run for finding in own if not (finding.at_rest or finding.of_log)}


def _idle(axis: int, side: Side) -> dict[str, str]:
    """Return, by run, that an axis rests or is not recorded."""
    idle = {f.run: f.why for f in side.findings if f.axis == axis and f.at_rest}
    recorded = {measured.run for measured in side.measured if measured.axis == axis}
    for measured in side.measured:
        if measured.run not in recorded:
            idle[measured.run] = f"it has no current of axis {axis}"
        elif measured.axis == axis and not measured.moves:
            idle.setdefault(measured.run, f"axis {axis} does not move")
    return idle


def _unfitting(axis: int, rows: pa.Table, baseline: Side, beside: Sequence[int]) -> str:
    usual = _shortest(axis, baseline)
    count = f"all {rows.num_rows} segments" if rows.num_rows > 1 else "the only segment"
    unknown = f"{count} of axis {axis} fit no motion of the baseline's cycle"
    lasts = _lasts(rows)
    if lasts < MUCH_SHORTER * usual:
        return (
            f"the recording is much shorter than the baseline's, or the joint stops: its motions "
            f"of axis {axis} last {lasts / usual:.0%} as long as those of the shortest one, and "
            f"{unknown}; record a whole cycle, or look why the joint stands"
        )
    differs = _one_off(axis, rows, baseline)
    if differs is not None:
        lasts_s = f"which lasts {differs.duration_s:.2g} s"
        what = (
            f"one motion more than the baseline's, its number {differs.motion}, {lasts_s}"
            if differs.gained
            else f"one motion less: the baseline's motion {differs.motion}, {lasts_s}, is not there"
        )
        return (
            f"{unknown}: each of its cycles has {what}; all others fit. Only if the program was "
            "changed on purpose, record a new baseline; else look at the joint, a gross fault "
            "breaks motions up"
        )
    if beside:  # neither is the program another, nor its speed
        return (
            f"{unknown}, though those of {axes_phrase(beside)} do: look at the joint, a gross "
            "fault changes the motion itself; else another joint's channels, or this joint's "
            "motions alone were edited"
        )
    return (
        f"{unknown}: another program or speed, another joint's channels, no cycle that repeats, or "
        "a fault that changes the motion itself"
    )


def _one_off(axis: int, rows: pa.Table, baseline: Side) -> OneOff | None:
    cycles = baseline.motions.filter(baseline.motions["reference"])
    reference = cycles.filter(pc.equal(cycles["axis"], axis))
    whole = rows.filter(pc.invert(rows["edge"]))
    if not reference.num_rows or not whole.num_rows:
        return None
    return one_off(segment_features(reference), segment_features(whole), baseline.rule)


def _shortest(axis: int, side: Side) -> int:
    """Return how many samples an axis's motions last in the shortest run of which any fits."""
    tables = [side.rows(axis, own.run) for own in side.measured if own.axis == axis]
    fitting = [rows for rows in tables if rows.num_rows and pc.max(rows["cycle"]).as_py() >= 0]
    return min(map(_lasts, fitting), default=0)


def _lasts(rows: pa.Table) -> int:
    return int(pc.max(rows["stop"]).as_py() - pc.min(rows["start"]).as_py())
