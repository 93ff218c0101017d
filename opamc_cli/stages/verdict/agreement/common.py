"""Joints that are far from the baseline together: common, but neither healthy nor at fault."""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from opamc_cli.config.models import ScoreConfig
from opamc_cli.decision.judge import FAR
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.stages.verdict.wording.brief import shaken_by
from opamc_cli.stages.verdict.wording.reasons import excuses_little, lies_outside, logged
from opamc_cli.storage.schemas.channels import axes_phrase

NEARLY = 3.0
"""Times as far as the farthest of the others: parts of another weight on a stranger's robots 0.7 to
1.7, worn joints of three others beside as many that moved 4.1 and more."""


def not_sure(
    verdict: Mapping[str, Any], limits: ScoreConfig, foreign: Collection[int]
) -> dict[int, tuple[str, ...]]:
    """Return the axes that are neither healthy nor at fault for sure, since others moved as far.

    Parameters
    ----------
    verdict
        Content of verdict.json.
    limits
        Those by which its axes were judged.
    foreign
        Axes that cannot be compared at all, since their target is of another program or log.
    """
    far = far_together(verdict, limits)
    # what the others tell of conditions has been taken off those already
    alone = {
        one["axis"]
        for one in verdict["axes"]
        if "relative_change_of_others" in (one["cause"] or {}).get("evidence", ())
    }
    left = left_alone(verdict, far, foreign) | under_payload(verdict)
    left = carried(verdict, limits, far) | left
    left = {axis: why for axis, why in left.items() if axis not in alone}
    return far_together(verdict, limits, left) | left


def far_together(
    verdict: Mapping[str, Any], limits: ScoreConfig, left: Collection[int] = ()
) -> dict[int, tuple[str, ...]]:
    """Return the axes that are called healthy though far from the baseline, with the reason.

    `limits` are those by which they were judged; `left`, axes that are no sure fault.
    """
    far = {entry["axis"] for entry in verdict["axes"] if _is_far(entry)}
    sure = [entry for entry in verdict["axes"] if entry["axis"] in far.difference(left)]
    faults = [
        one for one in sure if one["state"] == "fault" and not lies_outside(one["cause"] or {})
    ]
    shakes = shaken_by(sure)
    named = " or ".join(str(one["axis"]) for one in ([shakes] if shakes else faults))
    together = _SHAKEN.format(named) if named else _COMMON
    return {
        entry["axis"]: (
            f"{_where(entry)} lies {entry['health_index']:.3g} of the baseline's own spreads from "
            f"the baseline{logged(entry.get('warmer_c'))}, "
            + (together if len(far) > 1 else _alone(entry, verdict["axes"], limits)),
        )
        for entry in verdict["axes"]
        if entry["state"] == "healthy" and entry["axis"] in far
    }


def left_alone(
    verdict: Mapping[str, Any], far: Collection[int], foreign: Collection[int]
) -> dict[int, tuple[str, ...]]:
    """Return the unhealthy axes that are no surer a fault than most others are, with the reason.

    What another program or log does to most joints it does to all, whether or not each shows it;
    with half of them gone, too few siblings are left to excuse what is not far out.

    `far` are those of `far_together`, `foreign` as in `not_sure`.
    """
    index = {entry["axis"]: entry["health_index"] or 0.0 for entry in verdict["axes"]}
    others = {*far, *foreign}
    beyond_half = 2 * len(others) - len({*index, *foreign})
    if beyond_half < 0 or (beyond_half == 0 and not foreign):
        return {}
    reach = max(index[axis] for axis in far) if not foreign else math.inf if beyond_half else FAR
    return {
        entry["axis"]: (_LEFT_ALONE.format(", ".join(map(str, sorted(others)))),)
        for entry in verdict["axes"]
        if entry["state"] in ("changed", "fault")
        and entry["axis"] not in others
        and index[entry["axis"]] <= reach
    }


def under_payload(verdict: Mapping[str, Any]) -> dict[int, tuple[str, ...]]:
    """Return the unhealthy axes that a payload, which another axis tells for sure, may have moved.

    Those no farther out than that one: the tool is carried by all joints before it.
    """
    index = {entry["axis"]: entry["health_index"] or 0.0 for entry in verdict["axes"]}
    unhealthy = [entry for entry in verdict["axes"] if entry["state"] in ("changed", "fault")]
    loaded = {
        entry["axis"]
        for entry in unhealthy
        if (cause := entry["cause"] or {}).get("effect") == "payload_change"
        and not (cause["ties"] or excuses_little(cause))
    }
    reach = max((index[axis] for axis in loaded), default=0.0)
    return {
        entry["axis"]: (_UNDER_PAYLOAD.format(axes_phrase(sorted(loaded))),)
        for entry in unhealthy
        if index[entry["axis"]] <= reach and not lies_outside(entry["cause"] or {})
    }


def carried(
    verdict: Mapping[str, Any], limits: ScoreConfig, far: Collection[int]
) -> dict[int, tuple[str, ...]]:
    """Return the axes at fault by what a part of another weight may look like, with the reason.

    One that a program carries in some of its motions is no constant load: a joint that feels it
    seems to have less friction, a spring or a hysteresis. But most others, two at least, move, too,
    and one of them nearly as far. Friction that grows, what is at one place, what a gear does fast,
    or what has no name, is no part.

    `far` are those of `far_together`.
    """
    axes = verdict["axes"]
    moved = [one for one in axes if _moved(one, limits, far)]
    if any(_unhealthy(one) and not _may_be_load(one["cause"], slow=True) for one in moved):
        return {}
    found: dict[int, tuple[str, ...]] = {}
    for entry in moved:
        others = [one for one in moved if one is not entry]
        if entry["state"] != "fault" or not _may_be_load(entry["cause"]):
            continue
        most = len(others) >= 2 and 2 * len(others) >= len(axes)
        if most and _ratio(entry) < NEARLY * max(map(_ratio, others)):
            found[entry["axis"]] = (_CARRIED.format(axes_phrase([one["axis"] for one in others])),)
    return found


def _is_far(entry: Mapping[str, Any]) -> bool:
    """Whether a joint is too far out to be called healthy; not where no witness shows any effect.

    Patterns of a hundred files beside a baseline of single ones lay 20 to 33 spreads away, all of
    which was chance.
    """
    unchanged = (entry.get("distance") or {}).get("effect") == 0.0
    return (entry["health_index"] or 0.0) > FAR and not unchanged


def _unhealthy(entry: Mapping[str, Any]) -> bool:
    return entry["state"] in ("changed", "fault")


def _moved(entry: Mapping[str, Any], limits: ScoreConfig, far: Collection[int]) -> bool:
    """Whether a joint differs for sure, however little, in all of the target."""
    p_value = entry.get("p_adjusted")
    sure = p_value is not None and p_value <= limits.false_alarm_rate
    differs = sure or entry.get("excused") or entry["axis"] in far or _unhealthy(entry)
    return bool(differs) and "session" not in entry


def _may_be_load(cause: Mapping[str, Any] | None, *, slow: bool = False) -> bool:
    """Whether a load may look like a cause; `slow`: or it is slow at least."""
    known = built_in_library().get((cause or {}).get("effect", ""))
    if cause is None or known is None or known.fast:
        return False
    fell = (cause["evidence"].get("relative_change") or 0.0) < 0
    grew = known.resists and known.domain != "joint-angle" and not fell
    return slow or not (known.at_a_place or grew or lies_outside(cause))


def _ratio(entry: Mapping[str, Any]) -> float:
    return float(entry["distance"]["ratio"] or 0.0)


def _where(entry: Mapping[str, Any]) -> str:
    return f"In {entry['session']} alone it" if "session" in entry else "It"


def _alone(entry: Mapping[str, Any], axes: Sequence[Mapping[str, Any]], limits: ScoreConfig) -> str:
    """Say why a joint that is far out by itself was not called changed."""
    moved = sum(bool(one.get("excused")) for one in axes)
    if moved and 2 * moved >= len(axes) - 1:  # as a part of another weight does
        return _MOST_MOVED
    effect = (entry.get("distance") or {}).get("effect")
    certain = (entry.get("p_adjusted") or 0.0) <= limits.false_alarm_rate
    if certain and effect is not None and effect < limits.minimum_effect:
        return _SMALL.format(effect, limits.minimum_effect)
    return _ALONE


_COMMON = (
    "and other joints lie as far: what moves several so far is no fault of one, but would hide it; "
    "check temperature, payload, program, speed, unit, sensors and clock, and record again, or a "
    "new baseline."
)
_MOST_MOVED = (
    "and other joints have moved, too, if not as far: what moves several is no fault of one, but "
    "would hide it; check payload, temperature, program and the currents' scale, and record again, "
    "or a new baseline."
)
_SHAKEN = (
    "and a joint at fault, axis {0}, may have shaken it, which would hide a fault of this one; see "
    "to axis {0} first, and record again."
)
_CARRIED = (
    "It differs from the baseline, and {} do, too, nearly as far: a part or tool of another weight "
    "in some of the motions does that, and would hide a fault; check what is carried, and record "
    "again as for the baseline, or a new baseline."
)
_LEFT_ALONE = (
    "It differs from the baseline, but axes {}, half of the robot or more, cannot be compared or "
    "lie as far: another program, payload or way of logging changes a joint as a fault does; "
    "record again as for the baseline, or a new baseline."
)
_UNDER_PAYLOAD = (
    "It differs from the baseline, but another payload, told by {}, moves it, too, and would "
    "hide a fault; check the tool, and record again as for the baseline, or a new baseline."
)
_ALONE = (
    "too far to be called healthy, though what was compared does not suffice to call it changed; "
    "check its sensor, and record again, or more for the baseline."
)
_SMALL = (
    "too far to be called healthy, but what changed for certain is {:.1%}, less than "
    "score.minimum_effect ({:.1%}); check its friction, its sensor's gain and its payload, and "
    "lower that limit to have it called changed, or record a new baseline if it is meant to stay."
)
