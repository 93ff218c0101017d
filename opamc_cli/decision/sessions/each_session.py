"""Each of several target sessions by itself: what one night shows must not be diluted by others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from opamc_cli.decision.judge import Bundle, Judgement, Policy, judge

LONE_SHARE = 1 / 30
"""Of the level: what all sessions together may raise alarms by is spent on them together.

Tails of single nights are heavier than they are taken for (three or four baseline nights do not
know all conditions): at the whole level 1.7 % of 2000 healthy folders alarm by one night alone, at
a 30th 0.2 %.
"""

APART = 2.0
"""Times as far from the baseline as the farthest of the others: where all eight files of a night
have the same fault the farthest lies 1.5 times as far as the nearest, where half of them have one
the nearest of those lies five times as far as the others (docs/decision.md)."""


@dataclass(frozen=True)
class LoneSession:
    """One joint by one of the target's sessions."""

    session: str
    """Its name."""
    bundle: Bundle
    judgement: Judgement
    """With `bundle`: what is known of the joint by it, and the decision."""


def each_session(
    bundles: Mapping[int, Bundle], policy: Policy | None = None
) -> dict[int, list[LoneSession]]:
    """Decide about every joint by each target session alone.

    Parameters
    ----------
    bundles : mapping of int to Bundle
        As `judge` takes them, with the names of the target's sessions.
    policy : Policy, optional
        Levels and limits; the level is that of all sessions together.

    Returns
    -------
    dict of int to list of LoneSession
        By axis, sessions in the order of their names; nothing where there is but one of all axes.

    Notes
    -----
    Every p-value is multiplied by the number of sessions (Bonferroni), beside the correction for
    the number of joints. A session alone makes a fault or nothing: it has to pass the limit of
    effects that are one, at `LONE_SHARE` of the level.
    """
    policy = policy or Policy()
    names = sorted({name for bundle in bundles.values() for name in bundle.target_sessions})
    found: dict[int, list[LoneSession]] = {axis: [] for axis in bundles}
    if len(names) < 2:
        return found
    stricter = replace(
        policy,
        false_alarm_rate=LONE_SHARE * policy.false_alarm_rate / len(names),
        minimum_effect=max(policy.minimum_effect, policy.fault_effect),
    )
    for name in names:
        own = {
            axis: bundle.of_target(list(bundle.target_sessions).index(name))
            for axis, bundle in bundles.items()
            if name in bundle.target_sessions
        }
        for axis, judged in judge(own, stricter).items():
            corrected = replace(
                judged,
                p_value=min(len(names) * judged.p_value, 1.0),
                p_adjusted=min(len(names) * judged.p_adjusted, 1.0),
                p_alone=min(len(names) * judged.p_alone, 1.0),
            )
            found[axis].append(LoneSession(name, own[axis], corrected))
    return found


def apart(each: Sequence[LoneSession]) -> list[LoneSession]:
    """Return those of one joint's sessions, or recordings, that differ from the others.

    Parameters
    ----------
    each : sequence of LoneSession
        As `each_session` judges them.

    Returns
    -------
    list of LoneSession
        Those at fault by themselves, if they lie `APART` times as far out as all others, in their
        order; none where all are, or what separates them is only how sure each is.
    """
    far = [one for one in each if one.judgement.state in ("changed", "fault")]
    near = [one.judgement.distance_ratio for one in each if one not in far]
    if not far or not near:
        return []
    nearest = min(one.judgement.distance_ratio for one in far)
    return far if nearest >= APART * max(near) else []
