"""What a cause makes of a joint's state: changed, at fault, or no cause at all."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from opamc_cli.config.models import ScoreConfig
from opamc_cli.decision.judge import Judgement
from opamc_cli.joint.change.search import SCALE
from opamc_cli.joint.change.slow import FRICTION_SPREAD
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.stages.verdict.wording.causes import ANY_FRICTION, meaning
from opamc_cli.stages.verdict.wording.reasons import OF_SENSORS, TAUGHT, is_suspect, logged

MAIN_SHARE = 0.5
"""Share of the change from which causes decide between changed and fault."""

DRY = ("coulomb", "position_drag")
"""Friction that makes a joint `changed` though its distance leaves it healthy; a cold hall moves
what grows with the speed. Of 232 joints of healthy robots, 14 degrees off at most, none has such a
cause to a level of 1 % for all joints of a robot, seven have other friction (docs/decision.md)."""

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

LESS_FRICTION_THAN_OTHERS = "less friction than the others' tells: a lost preload, or wear-in"

LONE_SENSOR_TOO = "; check its temperature sensor, too, which alone has moved{}"

AT_MOST = 3.0
"""Times as much as its siblings' friction, as a logarithm, that a joint's may have moved by another
temperature: of healthy joints 15 degrees off 2.5 at most. Where it moved the other way, or by more,
and by `score.fault_effect` more or less than theirs, something else did."""

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


def own_friction(friction: Mapping[int, float], least: float) -> dict[int, tuple[float, float]]:
    """Return the joints whose friction moved as no condition moves it, with the others' median.

    Both are relative changes; `least` is the one beside the others' from which it counts. Where
    theirs has not moved it is no weather that excuses, but a load, which a fit takes for friction
    (of a wrist that has hardly any 64 % more, under a quarter more payload).
    """
    logs = {axis: float(np.log(max(1 + one, 1e-3))) for axis, one in friction.items()}
    found = {}
    for axis, own in logs.items():
        others = [one for other, one in logs.items() if other != axis]
        usual = float(np.median(others)) if len(others) > 1 else 0.0
        if abs(usual) < FRICTION_SPREAD:
            continue
        within = min(0.0, AT_MOST * usual) <= own <= max(0.0, AT_MOST * usual)
        if not within and abs(own - usual) >= np.log1p(least):
            found[axis] = (friction[axis], float(np.expm1(usual)))
    return found


def of_friction(own: float, others: float, p_value: float) -> Mapping[str, Any]:
    """Return the cause of verdict.json where a joint's friction alone moved so."""
    amount = (
        f"the joint's friction has {_moved_by(own)}, that of the others has {_moved_by(others)}"
    )
    kind = ANY_FRICTION if own > others else LESS_FRICTION_THAN_OTHERS
    return {
        "effect": "coulomb",
        "domain": "velocity",
        "parameters": {},
        "interpretation": f"{kind}; {amount}",
        "share": 1.0,
        "p_value": p_value,
        "ties": ["viscous"],
        "harmless": False,
        "origin": "joint",
        "explained": 1.0,
        "clear": False,
        "evidence": {"relative_change": own, "relative_change_of_others": others},
        "why": [f"{amount[0].upper()}{amount[1:]}: no condition moves one joint's so."],
        "others": [],
    }


def _moved_by(change: float) -> str:
    return f"{'grown' if change >= 0 else 'fallen'} by {abs(change):.0%}"


def believed(
    judgement: Judgement, cause: Mapping[str, Any] | None, config: ScoreConfig
) -> Mapping[str, Any] | None:
    """Drop a harmless cause, or a sensor's noise, of what it does not move.

    Noise or hum that is there at rest has no course: where that has changed, the spectrum must know
    noise far better; a line of the mains is told by its frequency. Grease,
    payload and offsets act slowly: they do not excuse what the spectrum alone has found. Nor does
    grease, where it did move the course, what the spectrum shows far more clearly. Of points that
    were taught anew all moves.
    """
    noise = cause is not None and not OF_SENSORS.isdisjoint(cause.get("evidence", ()))
    if cause is None or not (noise or cause.get("harmless")) or cause["effect"] == TAUGHT:
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
    judgement: Judgement, cause: Mapping[str, Any] | None, config: ScoreConfig, joints: int = 1
) -> Judgement:
    """Call a change of known cause a fault only if that cause harms the joint.

    One of so many joints that is healthy by its distance is `changed` where its dry friction has
    grown by what matters, as that of healthy sessions does of none of them.
    """
    if cause is None or float(cause.get("explained", cause.get("share", 1.0))) < MAIN_SHARE:
        return judgement
    # A fault is named first if there is one.
    at_fault = cause.get("origin", "joint") == "joint"
    if is_suspect(judgement):
        if cause["effect"] not in DRY:
            return judgement
        # of friction at one place no amount is known
        everywhere = cause["evidence"].get("relative_change") or 0.0
        amount = everywhere if cause["effect"] == "coulomb" else judgement.effect
        p_value = float(cause["p_value"])
        p_adjusted = min(joints * p_value, 1.0)
        if not amount >= config.minimum_effect or p_adjusted > config.false_alarm_rate:
            return judgement
        return replace(
            judgement, state="changed", method="cause",
            p_value=p_value, p_adjusted=p_adjusted, p_alone=p_adjusted,
        )  # fmt: skip
    if judgement.state not in ("changed", "fault"):
        return judgement
    if cause.get("harmless"):
        return replace(judgement, state="changed")
    return replace(judgement, state="fault") if at_fault else judgement
