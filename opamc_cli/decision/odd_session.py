"""A session of the baseline that is not of the healthy state that the others show."""

from collections.abc import Mapping
from dataclasses import replace

from opamc_cli.decision.judge import HEARD_FROM, Bundle, Judgement, Policy, judge

WORTH_ASKING = 4.0
"""Expected spreads from which on a session is held against the others, which takes as long as to
judge the target: of healthy joints every fifth has one, worn ones lie at 4.4 to 19."""


def odd_sessions(
    bundles: Mapping[int, Bundle],
    judgements: Mapping[int, Judgement],
    policy: Policy | None = None,
) -> dict[int, str]:
    """Find the session of each joint's baseline that differs as no healthy one does.

    A worn night among five healthy ones is what healthy nights differ by: neither its own fault
    nor another one lies beyond it.

    Parameters
    ----------
    bundles : mapping of int to Bundle
        As `judge` takes them, with the names of the baseline's sessions.
    judgements : mapping of int to Judgement
        What `judge` made of them.
    policy : Policy, optional
        Levels and limits; the level is that of all sessions together.

    Returns
    -------
    dict of int to str
        By axis, the name of the session that differs most; joints whose baseline hangs together, or
        leaves fewer than three sessions without it, are left out.

    Notes
    -----
    Each session is judged as a target of the others, its siblings beside it. Every p-value is
    multiplied by the number of sessions (Bonferroni), beside the correction for the number of
    joints.
    """
    policy = policy or Policy()
    asked = {
        (name, axis)
        for axis, bundle in bundles.items()
        if bundle.n_baseline > HEARD_FROM
        for name, far in zip(bundle.baseline_sessions, judgements[axis].apart, strict=False)
        if far > WORTH_ASKING
    }
    found: dict[int, tuple[float, str]] = {}
    for name in sorted({name for name, _ in asked}):
        held_out = {
            axis: bundle.held_out(bundle.baseline_sessions.index(name))
            for axis, bundle in bundles.items()
            if name in bundle.baseline_sessions
        }
        most = max(bundle.n_baseline + 1 for bundle in held_out.values())
        stricter = replace(policy, false_alarm_rate=policy.false_alarm_rate / most)
        for axis, judged in judge(held_out, stricter).items():
            differs = (name, axis) in asked and judged.state in ("changed", "fault")
            if differs and (judged.health_index, name) > found.get(axis, (0.0, "")):
                found[axis] = judged.health_index, name
    return {axis: name for axis, (_, name) in found.items()}
