"""The decision about every joint, before its causes are known."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from opamc_cli.config import Config
from opamc_cli.config.models import ScoreConfig
from opamc_cli.decision.judge import FAR, Bundle, Judgement, Policy
from opamc_cli.decision.sessions.each_session import LoneSession, apart, each_session
from opamc_cli.decision.sessions.odd_session import judge_without_odd
from opamc_cli.errors import InputError
from opamc_cli.stages.chain.compared.side import Side, Sides
from opamc_cli.stages.recordings.sessions import BY_SESSION, Sessions, started
from opamc_cli.stages.verdict.evidence import bundles
from opamc_cli.stages.verdict.wording.reasons import is_suspect
from opamc_cli.storage.sources import RunSource

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

    def differing(self) -> list[int]:
        """Return the axes that are asked for a cause."""
        return [
            axis
            for axis, judgement in self.judgements.items()
            if judgement.state in ("changed", "fault") or is_suspect(judgement)
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


def policy_of(config: ScoreConfig) -> Policy:
    """Return the decision's limits from the configuration."""
    return Policy(
        false_alarm_rate=config.false_alarm_rate,
        minimum_effect=config.minimum_effect,
        fault_effect=config.fault_effect,
        permutations=config.permutations,
        seed=config.seed,
    )
