"""Sessions of the baseline that are not of the healthy state that the others show."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from opamc_cli.decision.judge import FAR, HEARD_FROM, Bundle, Judgement, Policy, judge, one_of_many

WORTH_ASKING = 4.0
"""Expected spreads from which on a session is held against the others, which takes as long as to
judge the target: of healthy joints every fifth has one, worn ones lie at 4.4 to 19."""

WORN_TOGETHER = (3, 2)
"""How many of the last sessions may hide each other: none of them is odd beside the others. Each
number asked takes as long as to judge the target."""

WEARS_ON = 0.1
"""Corrected p-value of those before the last one: at 1 % wear that grows is found less often (bumps
in 9 of 20 baselines, in 11 at 10 % and 15 if they are not asked), and unasked 7 of 258 healthy
baselines lose their end, by 1 and by 10 % three (docs/decision.md)."""

UNHEALTHY = ("changed", "fault")


def judge_without_odd(
    bundles: Mapping[int, Bundle], policy: Policy | None = None, in_time: Sequence[str] = ()
) -> tuple[dict[int, Bundle], dict[int, Judgement], dict[int, tuple[str, ...]]]:
    """Judge a robot's joints, each without the sessions of its baseline that no healthy ones are.

    Returns
    -------
    tuple
        Bundles without these sessions, what `judge` makes of them, and the sessions, by axis.

    Notes
    -----
    Which sessions are left out was chosen, and the others agree the better for it: beside them a
    target has to differ as the sessions had to, with its p-value times the number of sessions
    there were. Of 670 healthy robots of four files a night 8 alarm, 10 would without this and 7 if
    nothing were left out; of 232 faults in worn baselines one is lost (docs/decision.md).
    """
    policy = policy or Policy()
    judgements = judge(bundles, policy)
    odd = odd_sessions(bundles, judgements, policy, in_time)
    if not odd:
        return dict(bundles), judgements, odd
    kept = dict(bundles) | {axis: bundles[axis].without(names) for axis, names in odd.items()}
    judgements = judge(kept, policy)
    chosen = {axis: one_of_many(judgements[axis], bundles[axis].n_baseline, policy) for axis in odd}
    return kept, judgements | chosen, odd


def odd_sessions(
    bundles: Mapping[int, Bundle],
    judgements: Mapping[int, Judgement],
    policy: Policy | None = None,
    in_time: Sequence[str] = (),
) -> dict[int, tuple[str, ...]]:
    """Find the sessions of each joint's baseline that differ as no healthy ones do.

    A worn night among five healthy ones is what healthy nights differ by: neither its own fault
    nor another one lies beyond it. Of a joint that began to wear while its baseline was recorded
    the last nights hide each other as well.

    Parameters
    ----------
    bundles : mapping of int to Bundle
        As `judge` takes them, with the names of the baseline's sessions.
    judgements : mapping of int to Judgement
        What `judge` made of them.
    policy : Policy, optional
        Levels and limits; the level is that of all sessions together.
    in_time : sequence of str, optional
        Names of the baseline's sessions, the oldest first; by default in the order of the bundles.

    Returns
    -------
    dict of int to tuple of str
        By axis, the names of the last sessions that differ together, else of the one that differs
        most; joints whose baseline hangs together, or leaves fewer than three sessions without
        them, are left out.

    Notes
    -----
    Each session is judged as a target of the others, its siblings beside it. Every p-value is
    multiplied by the number of sessions (Bonferroni), beside the correction for the number of
    joints. Of the last two or three, half of the sessions at most, each is judged as a target of
    those before all of them: the last one has to differ with its p-value multiplied so, the others
    on its way there by `WEARS_ON`.
    """
    policy = policy or Policy()
    return _odd_one(bundles, judgements, policy) | _worn_end(bundles, policy, in_time)


def _odd_one(
    bundles: Mapping[int, Bundle], judgements: Mapping[int, Judgement], policy: Policy
) -> dict[int, tuple[str, ...]]:
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
        for axis, judged in judge(held_out, _stricter(policy, bundles), sized=False).items():
            # what moves all joints so far excuses none of them
            differs = judged.state in UNHEALTHY or judged.health_index > FAR
            farther = (judged.health_index, name) > found.get(axis, (0.0, ""))
            if (name, axis) in asked and differs and farther:
                found[axis] = judged.health_index, name
    return {axis: (name,) for axis, (_, name) in found.items()}


def _worn_end(
    bundles: Mapping[int, Bundle], policy: Policy, in_time: Sequence[str]
) -> dict[int, tuple[str, ...]]:
    orders = {axis: _in_time(bundle, in_time) for axis, bundle in bundles.items()}
    found: dict[int, tuple[str, ...]] = {}
    for number in WORN_TOGETHER:
        enough = max(2 * number, number + HEARD_FROM)
        long = {axis: order for axis, order in orders.items() if len(order) >= enough}
        differ = set(long)
        for back in range(1, number + 1):  # the last one first: it is worn most
            if not differ:
                break
            held_out = {
                axis: bundles[axis].of_sessions(order[:-number], [order[-back]])
                for axis, order in long.items()
            }
            judged = judge(held_out, _stricter(policy, bundles), sized=False)
            differ = {axis for axis in differ if _worn(judged[axis], last=back == 1)}
        for axis in differ - found.keys():
            names = bundles[axis].baseline_sessions
            found[axis] = tuple(names[i] for i in long[axis][-number:])
    return found


def _worn(judged: Judgement, *, last: bool) -> bool:
    if last:
        return judged.state in UNHEALTHY
    return max(judged.p_adjusted, judged.p_alone) <= WEARS_ON


def _in_time(bundle: Bundle, in_time: Sequence[str]) -> list[int]:
    """Return the numbers of a joint's sessions, the oldest first."""
    names = bundle.baseline_sessions
    place = {name: at for at, name in enumerate(in_time or names)}
    return sorted(
        (i for i, name in enumerate(names) if name in place), key=lambda i: place[names[i]]
    )


def _stricter(policy: Policy, bundles: Mapping[int, Bundle]) -> Policy:
    """Return the policy for one of so many sessions as the longest baseline has."""
    most = max(bundle.n_baseline for bundle in bundles.values())
    return replace(policy, false_alarm_rate=policy.false_alarm_rate / most)
