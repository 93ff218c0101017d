"""Stage `verdict`: both sides' tables and their scores in, verdict.json out."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from opamc_cli.config import Config
from opamc_cli.config.models import ScoreConfig
from opamc_cli.decision.each_session import LoneSession, apart, each_session
from opamc_cli.decision.judge import FAR, Bundle, Judgement, Policy
from opamc_cli.decision.odd_session import judge_without_odd
from opamc_cli.errors import ExitCode, InputError
from opamc_cli.joint.change.search import SCALE, SMALLEST_WARMTH_C
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.stages.chain.compared.pattern_rows import Key, PatternRows
from opamc_cli.stages.chain.compared.side import Side, Sides
from opamc_cli.stages.chain.score import ALL_MOTIONS, ScoreOutcome
from opamc_cli.stages.recordings.sessions import BY_SESSION, Sessions, started
from opamc_cli.stages.verdict.agreement.common import not_sure
from opamc_cli.stages.verdict.agreement.exchanged_joints import exchanged_joints
from opamc_cli.stages.verdict.agreement.unjudged import with_reasons
from opamc_cli.stages.verdict.brief import brief
from opamc_cli.stages.verdict.cause import meaning
from opamc_cli.stages.verdict.evidence import bundles
from opamc_cli.stages.verdict.findings import NOTHING_FOUND, Findings
from opamc_cli.stages.verdict.reasons import OF_SENSORS, is_excused, is_small, logged, reasons
from opamc_cli.storage.files.atomic import write_text
from opamc_cli.storage.schemas import files
from opamc_cli.storage.sources import RunSource, current_unit, other_conditions

MAIN_SHARE = 0.5
"""Share of the change from which causes decide between changed and fault."""

MUCH_FRICTION = 0.2
"""By which a joint's friction has grown that matters however little of its current it is, as that
of a load that is moved fast. Brakes that dragged by 26 and 21 % were "too small" (25.6 and 20.3 %
were found); friction or scale of the five other such joints with a cause had grown by 16 % at most,
and none of a healthy robot was asked."""

AS_SURE = 2.0
"""Grease is no excuse where the logarithm of the spectrum's p is more than so many times that of
course and size: 15 degrees that those knew by 1e-10 left an arm's spectra at 0.1 or above, a
cracked flexspline beside 8 degrees took one to 1e-110 (docs/decision.md, The cause)."""

STILL = 2.0
"""Health index, in spreads of a healthy session, below which a joint has not moved. Beside weak
magnets, a stiff hose and worn grease the others had 1.4 at most; a payload moved one by 3.9."""

MOST_STILL = 2 / 3
"""Of the other joints: grease that has grown stiffer in one alone is no cold hall's though a joint
at fault shakes a neighbour. Of 35 joints of strangers' pairs read as grease it moves two, both of
lost lubricant."""

LONE_SENSOR = 0.5
"""Of a joint's own logged difference: where half of the others' lie below, it is its alone."""

LONE_SENSOR_TOO = "; check its temperature sensor, too, which alone has moved{}"

ALIKE = {
    "payload_change": (SCALE.name, "spring"),
    "thermal_viscous": ("viscous", "sublinear_friction", "quadratic_friction"),
}
"""What moves other joints, too, and what looks like it in one of them alone, likeliest first."""

UNLIKELY = {
    "payload_change": "Another payload is unlikely: all other joints, which carry the same tool, "
    "are healthy.",
    "thermal_viscous": "Another temperature is unlikely: most other joints have not moved.",
}

MOST_FILES = 16
"""Of the target, the last ones: to judge one by itself takes a tenth of a second a joint."""

ODD_ONE = (
    "differs from the others on {} as no healthy one does, and is left out there; look at it, and "
    "take it out of the baseline if it was not healthy"
)
WORN_END = (
    "differ from those before them on {} as no healthy ones do, and are left out there; look at "
    "them, and take them out of the baseline if the joint had begun to wear"
)


@dataclass(frozen=True)
class VerdictOutcome:
    """What `write` did."""

    path: Path
    """The file that was written."""
    verdict: dict[str, Any]
    """Its content."""
    exit_code: ExitCode
    """What it ends with."""


@dataclass(frozen=True)
class Decided:
    """The decision about every joint, before its causes are known."""

    sides: Sides
    """What was compared."""
    bundles: Mapping[int, Bundle]
    judgements: Mapping[int, Judgement]
    """With `bundles`: what is known of each axis, and what was made of it."""
    each: Mapping[int, Sequence[LoneSession]] = field(default_factory=dict)
    """The same by each of several target sessions alone."""
    alone: Mapping[int, LoneSession] = field(default_factory=dict)
    """Those by which an axis is judged, since they are worse than all together."""
    odd: Mapping[int, Sequence[str]] = field(default_factory=dict)
    """Sessions of the baseline without which an axis is judged: no healthy ones differ as much."""
    by_file: Mapping[int, Sequence[LoneSession]] = field(default_factory=dict)
    """Axes that differ, by each recording of target sessions that have several."""

    def differing(self, config: ScoreConfig) -> list[int]:
        """Return the axes whose change asks for a cause."""
        return [
            axis
            for axis, judgement in self.judgements.items()
            if judgement.state in ("changed", "fault") or is_small(judgement, config)
        ]

    def target_sources(self, axis: int) -> Sequence[RunSource]:
        """Return the target's recordings by which an axis is judged."""
        sources = self.sides.target.sources
        if axis not in self.alone:
            return sources
        of_run = self.sides.sessions[1].of_run
        return [s for s in sources if of_run[s.name] == self.alone[axis].session]

    def baseline_sources(self, axis: int) -> Sequence[RunSource]:
        """Return the baseline's recordings that an axis is held against."""
        of_run = self.sides.sessions[0].of_run
        odd = self.odd.get(axis, ())
        return [s for s in self.sides.baseline.sources if of_run[s.name] not in odd]

    def odd_ones(self) -> list[InputError]:
        """Say which sessions of the baseline were left out."""
        by_sessions: dict[Sequence[str], list[int]] = {}
        for axis, sessions in sorted(self.odd.items()):
            by_sessions.setdefault(sessions, []).append(axis)
        of_baseline = self.sides.sessions[0]
        return [
            InputError(
                f"{_and([of_baseline.named(session) for session in sessions])} of the baseline "
                + (ODD_ONE if len(sessions) == 1 else WORN_END).format(_axes_named(axes))
            )
            for sessions, axes in by_sessions.items()
        ]

    def target_runs(self) -> dict[int, list[str]]:
        """Return the names of the target's recordings by which each axis is judged."""
        return {axis: [s.name for s in self.target_sources(axis)] for axis in self.judgements}

    def named(self, axis: int) -> str:
        """Return the session by which alone an axis is judged."""
        return self.sides.sessions[1].named(self.alone[axis].session)

    def sessions_at_fault(self, axis: int) -> str | None:
        """Say which of the target's sessions are at fault by themselves; None if all or none."""
        each = self.each.get(axis, ())
        bad = [one.session for one in each if one.judgement.state in ("changed", "fault")]
        if not 0 < len(bad) < len(each):
            return None
        shown = ", ".join(self.sides.sessions[1].named(session) for session in bad)
        shows = "shows it by itself" if len(bad) == 1 else "show it by themselves"
        return f"Of {len(each)} target sessions only {shown} {shows}."

    def files_apart(self, axis: int) -> str | None:
        """Say which of the target's files differ from the others; None if none or all do."""
        each = self.by_file.get(axis, ())
        odd = apart(each)
        if not odd:
            return None
        far = [one.judgement.distance_ratio for one in odd]
        near = [one.judgement.distance_ratio for one in each if one not in odd]
        return (
            f"Of {len(each)} target files only {_and([one.session for one in odd])} "
            f"differ{'' if len(odd) > 1 else 's'} ({_times(min(far))} times as far from the "
            f"baseline as a healthy session, or more; the others {_times(max(near))} times at "
            "most): another program or tool, or a fault that comes and goes?"
        )

    def with_files(self, why: Mapping[int, Sequence[str]]) -> dict[int, Sequence[str]]:
        """Add to reasons, by axis, which of the target's files differ from the others."""
        told = {axis: self.files_apart(axis) for axis in why}
        return {axis: (*own, *filter(None, [told[axis]])) for axis, own in why.items()}

    def notes(self) -> list[str]:
        """Say which axes were judged without some of the witnesses."""
        lacking = {
            axis: [name for name, p in judgement.witnesses.items() if math.isnan(p)]
            for axis, judgement in self.judgements.items()
            if math.isfinite(judgement.p_value)
        }
        return [
            f"axis {axis}: judged without its {' and '.join(names)}: some session has no motion "
            "whose samples are all known"
            for axis, names in lacking.items()
            if names
        ]

    def blind(self, config: ScoreConfig) -> list[str]:
        """Say on which healthy axes a fault would not have been told from one baseline session."""
        least = {
            axis: one.least_effect
            for axis, one in self.judgements.items()
            if one.state == "healthy" and one.least_effect > config.fault_effect
        }
        if not least:
            return []
        shares = dict.fromkeys(f"{of(least.values()):.0%}" for of in (min, max))
        return [
            f"{_axes_named([*least])}: with one baseline session patterns that changed by less "
            f"than {' to '.join(shares)} would not have been called changed, and "
            f"{config.fault_effect:.0%} is a fault; record more of the baseline, on other days"
        ]


def _and(names: Sequence[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def _times(ratio: float) -> str:
    """Return a distance over a healthy session's; how far beyond a hundred says nothing."""
    return f"{ratio:.2g}" if ratio < 100 else "more than 100"


def _axes_named(axes: Sequence[int]) -> str:
    return f"{'axis' if len(axes) == 1 else 'axes'} {', '.join(map(str, axes))}"


def decide(sides: Sides, config: Config) -> Decided:
    """Decide about every joint, by all target sessions together and by each of them alone.

    Of the options those of section `score` are used.
    """
    policy = policy_of(config.score)
    known, judgements, odd = judge_without_odd(
        bundles(sides), policy, in_time(sides.baseline, sides.sessions[0])
    )
    each, alone = each_session(known, policy), {}
    for axis, by_session in each.items():
        worst = max(by_session, key=lambda one: _concern(one.judgement), default=None)
        if worst is not None and _concern(worst.judgement)[0] > _concern(judgements[axis])[0]:
            alone[axis] = worst
            known[axis], judgements[axis] = worst.bundle, worst.judgement
    decided = Decided(sides, known, judgements, each, alone, odd)
    return replace(decided, by_file=_each_file(decided, policy))


def _each_file(decided: Decided, policy: Policy) -> dict[int, Sequence[LoneSession]]:
    """Judge axes that differ by each recording of their target sessions, where those have more."""
    judgements = decided.judgements
    asked = {
        axis: names
        for axis, judgement in judgements.items()
        if _concern(judgement)[0] > 0  # or too far out to be called healthy
        and len(names := {source.name for source in decided.target_sources(axis)})
        > judgement.n_target_sessions
    }
    if not asked:
        return {}
    known = bundles(replace(decided.sides, target_by_file=True))
    looked = {name for names in asked.values() for name in sorted(names)[-MOST_FILES:]}
    parts = {
        axis: bundle.without(decided.odd.get(axis, ())).of_targets(
            [k for k, name in enumerate(bundle.target_sessions) if name in looked]
        )
        for axis, bundle in known.items()
        if looked & set(bundle.target_sessions)
    }
    each = each_session(parts, policy)
    return {
        axis: [one for one in each.get(axis, ()) if one.session in names]
        for axis, names in asked.items()
    }


def in_time(side: Side, sessions: Sessions) -> list[str]:
    """Return a side's sessions, the oldest first: nights are named by it, and files often are."""
    times = {source.name: started(source.info.started_at) for source in side.sources}
    if sessions.told_by != (BY_SESSION,) or None in times.values():
        return sorted(set(sessions.of_run.values()))
    by_time = sorted((t, sessions.of_run[name]) for name, t in times.items() if t is not None)
    return list(dict.fromkeys(session for _, session in by_time))


def _concern(judgement: Judgement) -> tuple[int, float]:
    """Rank judgements of one joint: unhealthy, doubtful, healthy, then by how improbable."""
    if judgement.state in ("changed", "fault"):
        return 2, -judgement.p_adjusted
    if math.isnan(judgement.p_adjusted):
        return -1, 0.0
    doubtful = judgement.state == "insufficient-data" or judgement.health_index > FAR
    return int(doubtful), -judgement.p_adjusted


def write(
    decided: Decided,
    scored: ScoreOutcome,
    config: Config,
    out: Path,
    found: Findings = NOTHING_FOUND,
    head: Mapping[str, Any] | None = None,
) -> VerdictOutcome:
    """Write the verdict.

    Parameters
    ----------
    decided
        The decision.
    scored
        Divergences and features of the same tables.
    config
        The verdict carries the hash of the whole.
    out
        Folder of verdict.json.
    found
        From the recordings: causes, empty where one was sought in vain, and joints that cannot be
        judged.
    head
        What the verdict says besides its axes; see `header`.
    """
    judged = content(decided, scored, config, found.causes)
    unsure = decided.with_files(not_sure(judged, config.score, found.foreign))
    crossed = exchanged_joints(decided.sides, decided.target_runs(), judged)
    verdict = with_reasons(judged, {**unsure, **crossed, **found.unjudged}) | dict(head or {})
    path = out / files.VERDICT
    write_text(path, json.dumps(verdict, indent=2, allow_nan=False) + "\n")
    return VerdictOutcome(path, verdict, exit_code(verdict))


def exit_code(verdict: Mapping[str, Any]) -> ExitCode:
    """Return the exit code of a verdict: an unhealthy joint makes it 1, else a doubtful one 5."""
    states = {axis["state"] for axis in verdict["axes"]}
    if states & {"changed", "fault"}:
        return ExitCode.UNHEALTHY
    excused = any(axis["excused"] for axis in verdict["axes"])
    sure = states == {"healthy"} and not excused
    return ExitCode.DONE if sure else ExitCode.NOT_ENOUGH_DATA


def content(
    decided: Decided,
    scored: ScoreOutcome,
    config: Config,
    causes: Mapping[int, Mapping[str, Any]],
) -> dict[str, Any]:
    """Return the content of verdict.json."""
    jsd = _divergences(scored.scores)
    pooled = _pooled_features(scored.features)
    sides = (decided.sides.baseline, decided.sides.target)
    unit = current_unit([source for side in sides for source in side.sources])
    unlike = other_conditions(*(side.sources for side in sides))
    warmer = {axis: _warmer_c(axis, *decided.sides.rows) for axis in decided.judgements}
    axes = []
    for axis, judgement in decided.judgements.items():
        in_vain = causes.get(axis) == {}
        cause = believed(judgement, causes.get(axis) or None, config.score)
        cause = among_siblings(axis, cause, decided.judgements, warmer)
        final = with_cause(judgement, cause, config.score)
        if final.state == "healthy":
            cause = None
        if final.state == "insufficient-data":
            final = replace(final, health_index=math.nan, p_value=math.nan, p_adjusted=math.nan)
        bundle = decided.bundles[axis]
        motions = [
            {
                "motion": cell.motion,
                "order": cell.order,
                "tau": cell.tau,
                "jsd_baseline": jsd.get(("baseline", axis, cell.motion, cell.order, cell.tau), []),
                "jsd_target": jsd.get(("target", axis, cell.motion, cell.order, cell.tau), []),
            }
            for cell in bundle.cells
        ]
        runs = {
            role: [source for source in sources if source.name in _runs_of(axis, rows)]
            for role, sources, rows in zip(
                ("baseline", "target"),
                (decided.baseline_sources(axis), decided.target_sources(axis)),
                decided.sides.rows,
                strict=True,
            )
        }
        lacking = _not_compared(axis, decided)
        which = decided.sessions_at_fault(axis)
        excused = is_excused(final, config.score)
        others = sum(math.isfinite(one.p_value) for one in decided.judgements.values()) - 1
        said = reasons(
            *(final, bundle, motions, runs, cause, config.score),
            in_vain=in_vain, siblings=others, warmer_c=warmer[axis],
        )  # fmt: skip
        files = decided.files_apart(axis)
        for told in (files, which):  # after what the state does not tell
            if told:
                said.insert(int(excused), told)
        axes.append(
            {
                "axis": axis,
                "state": final.state,
                "excused": excused,
                **({"session": decided.named(axis)} if axis in decided.alone else {}),
                **({"not_compared": lacking} if lacking else {}),
                **({"warmer_c": warmer[axis]} if warmer[axis] else {}),
                "health_index": _finite(final.health_index),
                "p_value": _finite(final.p_value),
                "p_adjusted": _finite(final.p_adjusted),
                "witnesses": {name: _finite(p) for name, p in final.witnesses.items()},
                "distance": {
                    "ratio": _finite(final.distance_ratio),
                    "common": _finite(math.exp(final.common_log_ratio)),
                    "allowed": _finite(math.exp(final.allowed_log_ratio)),
                    "effect": _finite(final.effect),
                },
                "features": pooled.get(axis, {"delta_mu": None, "delta_var": None, "ks": None}),
                "motions": motions,
                "cause": None if cause is None else dict(cause),
                "brief": brief(
                    *(final, bundle, cause, unit, which or files), in_vain=in_vain, unlike=unlike
                ),
                "reasons": said,
            }
        )
    return {
        "axes": axes,
        **{
            role: _summary(side, sessions)
            for role, side, sessions in zip(
                ("baseline", "target"), sides, decided.sides.sessions, strict=True
            )
        },
        "base": config.score.base,
        "config_hash": config.digest(),
    }


def _summary(side: Side, sessions: Sessions) -> dict[str, Any]:
    """Say which runs a side is of, how many sessions they make, and from when to when."""
    times = sorted(t for s in side.sources if (t := started(s.info.started_at)) is not None)
    return {
        "runs": [source.name for source in side.sources],
        "sessions": len(sessions),
        "sessions_by": list(sessions.told_by),
        "from": times[0].isoformat() if times else None,
        "to": times[-1].isoformat() if times else None,
    }


def policy_of(config: ScoreConfig) -> Policy:
    """Return the decision's limits from the configuration."""
    return Policy(
        false_alarm_rate=config.false_alarm_rate,
        minimum_effect=config.minimum_effect,
        fault_effect=config.fault_effect,
        permutations=config.permutations,
        seed=config.seed,
    )


def among_siblings(
    axis: int,
    cause: Mapping[str, Any] | None,
    judgements: Mapping[int, Judgement],
    warmer_c: Mapping[int, float | None],
) -> Mapping[str, Any] | None:
    """Put what looks alike in one joint before what would move others, too, where they are still.

    All joints carry the same tool, though the last one, counted from the base, may be all that
    lifts it: what looks like a spring there is a hose. Grease of another temperature is that of all
    joints, and seen in more than a third of the others, unless one joint's sensor alone tells of
    it; but a joint runs in by itself, and less friction is left to be that.

    Parameters
    ----------
    axis, cause
        The joint, and what was found to have changed in it, if anything.
    judgements
        Of all joints, by axis.
    warmer_c
        By how much each was warmer than ever in its baseline by the log; None where nothing tells.
    """
    others = {other: one for other, one in judgements.items() if other != axis}
    effect = cause["effect"] if cause else ""
    least = max(2, (MOST_STILL if effect == "thermal_viscous" else 1) * len(others))
    if cause is None or effect not in ALIKE or sum(map(_still, others.values())) < least:
        return cause
    ties, change = cause["ties"], cause["evidence"].get("relative_change")
    name = next((one for one in ALIKE[effect] if one in ties), None)
    sensor = ""
    if effect == "payload_change":
        unlikely = name == "spring" or max(others) > axis
    else:
        unlikely = (change or 0.0) > 0
        own = cause["parameters"].get("warmer_c")
        if own is not None:
            theirs = [warmer for other in others if (warmer := warmer_c.get(other)) is not None]
            unlikely &= bool(theirs) and float(np.median(theirs)) / own < LONE_SENSOR
            sensor = LONE_SENSOR_TOO.format(logged(own))
    if name is None or not unlikely:
        return cause
    known = {SCALE.name: SCALE, **built_in_library()}[name]
    ties = [effect, *(tie for tie in ties if tie != name)]
    return {
        **cause,
        "effect": name,
        "domain": known.domain,
        "parameters": {},
        "origin": known.origin,
        "harmless": False,
        "interpretation": meaning(name, known.meaning, ties, change) + sensor,
        "ties": ties,
        "why": [*cause["why"], UNLIKELY[effect]],
    }


def _still(judgement: Judgement) -> bool:
    return judgement.state == "healthy" and judgement.health_index < STILL


def believed(
    judgement: Judgement, cause: Mapping[str, Any] | None, config: ScoreConfig
) -> Mapping[str, Any] | None:
    """Drop a harmless cause, or a sensor's noise, of what it does not move.

    Noise or hum that is there at rest has no course: where that has changed, the spectrum must know
    noise far better; a line of the mains is told by its frequency. Grease,
    payload and offsets act slowly: they do not excuse what the spectrum alone has found. Nor does
    grease, where it did move the course, what the spectrum shows far more clearly.
    """
    noise = cause is not None and not OF_SENSORS.isdisjoint(cause.get("evidence", ()))
    if cause is None or not (noise or cause.get("harmless")):
        return cause
    heard = judgement.witnesses
    course_p, spectrum_p = heard.get("profile", 0.0), heard.get("spectrum", 1.0)
    if noise:
        own = course_p > config.false_alarm_rate or spectrum_p < course_p**AS_SURE
        return cause if own or cause.get("harmless") else None
    if course_p > config.false_alarm_rate:
        return None
    slow_p = min(course_p, heard.get("amplitude", 1.0))
    sharp = spectrum_p <= config.false_alarm_rate and spectrum_p < slow_p**AS_SURE
    return None if sharp and cause.get("origin") == "environment" else cause


def with_cause(
    judgement: Judgement, cause: Mapping[str, Any] | None, config: ScoreConfig
) -> Judgement:
    """Call a change of known cause a fault only if that cause harms the joint.

    One too small to act on is `changed` by MUCH_FRICTION of the joint itself: such a cause is found
    at a level below 1 % beside what healthy sessions' friction differs by.
    """
    if cause is None:
        return judgement
    small = is_small(judgement, config)
    if not small and judgement.state not in ("changed", "fault"):
        return judgement
    if float(cause.get("explained", cause.get("share", 1.0))) < MAIN_SHARE:
        return judgement
    # A fault is named first if there is one.
    at_fault = cause.get("origin", "joint") == "joint"
    if small:
        much = (cause["evidence"].get("relative_change") or 0.0) >= MUCH_FRICTION
        return replace(judgement, state="changed") if at_fault and much else judgement
    if cause.get("harmless"):
        return replace(judgement, state="changed")
    return replace(judgement, state="fault") if at_fault else judgement


def _runs_of(axis: int, part: Mapping[Key, PatternRows]) -> set[str]:
    return {str(run) for key, rows in part.items() if key[0] == axis for run in rows.runs}


def _warmer_c(
    axis: int, before: Mapping[Key, PatternRows], after: Mapping[Key, PatternRows]
) -> float | None:
    """Return how much warmer a joint was than ever in its baseline; None where nothing tells."""
    usual, now = (
        np.concatenate(
            [[], *(one.rows["temperature_c"] for key, one in part.items() if key[0] == axis)]
        ).astype(float)
        for part in (before, after)
    )
    usual, now = usual[np.isfinite(usual)], now[np.isfinite(now)]
    if not usual.size or not now.size:
        return None
    warmer = float(np.mean(now) - np.mean(usual))
    usual_too = usual.min() <= np.mean(now) <= usual.max() or abs(warmer) < SMALLEST_WARMTH_C
    return 0.0 if usual_too else warmer


def _not_compared(axis: int, decided: Decided) -> dict[str, list[str]]:
    """Return, by role, the runs of a side that have no part in what is said of an axis."""
    found, sides = {}, decided.sides
    held = {source.name for source in (*decided.baseline_sources(axis), *sides.target.sources)}
    for role, side, rows in zip(
        ("baseline", "target"), (sides.baseline, sides.target), sides.rows, strict=True
    ):
        there = _runs_of(axis, rows) & held
        found[role] = [source.name for source in side.sources if source.name not in there]
    return {role: names for role, names in found.items() if names}


def _divergences(scores: pa.Table) -> dict[tuple[str, int, int, int, int], list[float]]:
    found: dict[tuple[str, int, int, int, int], list[float]] = {}
    names = ["role", "axis", "motion", "order", "tau", "jsd"]
    for row in scores.select(names).to_pylist():
        if row["jsd"] is not None and math.isfinite(row["jsd"]):
            key = (row["role"], row["axis"], row["motion"], row["order"], row["tau"])
            found.setdefault(key, []).append(row["jsd"])
    return found


def _pooled_features(features: pa.Table) -> dict[int, dict[str, float | None]]:
    """Pick the features over all motions of the highest order, the thesis's better one (5.2)."""
    pooled = [row for row in features.to_pylist() if row["motion"] == ALL_MOTIONS]
    best = {row["axis"]: row for row in sorted(pooled, key=lambda row: row["order"])}
    return {
        axis: {name: _finite(row[name]) for name in ("delta_mu", "delta_var", "ks")}
        for axis, row in best.items()
    }


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None
