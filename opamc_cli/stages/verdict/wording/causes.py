"""A cause as verdict.json holds it: what it means, and why it is believed."""

from collections.abc import Mapping, Sequence
from typing import Any

from opamc_cli.decision.measurement.at_rest import Growth
from opamc_cli.decision.measurement.lag import Lag
from opamc_cli.decision.measurement.sensors import ErrorGrowth
from opamc_cli.joint.change.explain import SMALLEST_SHARE, Change
from opamc_cli.joint.change.reading import Cause
from opamc_cli.joint.change.search import LESS_FRICTION, SCALE
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.stages.verdict.wording.reasons import (
    AT_REST,
    CURRENT_LAG,
    IN_SPIKES,
    IN_THE_SUM,
    SENSOR_NOISE,
    TAUGHT,
    effect_in_words,
    excuses_little,
    lies_outside,
)
from opamc_cli.storage.schemas.channels import axes_phrase

OF_OTHERS = ("effect", "parameters", "share", "interpretation", "origin")

FRICTION = frozenset(
    name
    for name, effect in built_in_library().items()
    if effect.resists and effect.origin == "joint" and not effect.at_a_place
)

ANY_FRICTION = (
    "friction, in a form that the recordings do not tell: check grease, preload and seals"
)
"""Of forms that tie: dry and lubricant friction that grow by half are nearest to a sublinear form,
and were called a starved lubricant."""

MUCH = 9.0
"""Times as much again: of a baseline that has hardly any of it, a factor says nothing."""

WELL_EXPLAINED = 0.8
"""Below this share the reasons say how much of the change is unexplained."""

MOST_TIMES = 100.0
"""Of what was hardly there more says nothing."""

HUM = "mains_hum"

NOISE = (
    "noise or hum of the current sensor, which has grown as much while the joint stands still: "
    "check the sensor, its cable and the amplifier"
)

OF_SPIKES = (
    "single samples that the current's sensor or the logger garbles: check cables, connectors and "
    "the log"
)

OF_THE_SUM = {
    "sensor_offset": "a zero error of a phase's current sensor: check the sensors' zero",
    "sensor_gain": "the gain of a phase's current sensor, or a current that leaves the three "
    "phases: check sensors, scaling, connectors and the motor's insulation",
    "sensor_noise": "noise, hum or spikes of the phases' current sensors: check sensors, cables "
    "and connectors",
}


def entry(change: Change) -> dict[str, Any] | None:
    """Return the first cause of a change as verdict.json holds it; None where there is none."""
    if not change.causes:
        return None
    first, *others = change.causes
    return {
        "effect": first.effect,
        "domain": first.domain,
        "parameters": dict(first.parameters),
        "interpretation": meaning(
            *(first.effect, first.interpretation, first.ties),
            first.evidence.get("relative_change"),
        ),
        "share": first.share,
        "p_value": first.p_value,
        "ties": list(first.ties),
        "harmless": change.harmless,
        "origin": first.origin,
        "explained": change.explained_share,
        "clear": first.clear,
        "evidence": dict(first.evidence),
        "why": _why(first, change),
        "others": [{key: getattr(cause, key) for key in OF_OTHERS} for cause in others],
    }


def with_sensor(sensor: dict[str, Any], found: dict[str, Any] | None) -> dict[str, Any]:
    """Put a sensor's trouble before what it may be, or beside what it is not."""
    if found is None:
        return sensor
    hum = found["effect"] == HUM and sensor["effect"] == SENSOR_NOISE and not excuses_little(found)
    if hum or found["effect"] == sensor["effect"]:
        evidence = {**found["evidence"], **sensor["evidence"]}
        return {**found, "evidence": evidence, "why": [*found["why"], *sensor["why"]]}
    rest = [one for one in found["others"] if one["effect"] != sensor["effect"]]
    # a sum, or spikes, prove it: a gain of 1.3 looks like a payload, or all of a scale, besides
    alike = lies_outside(found) or found["effect"] == SCALE.name
    proven = AT_REST not in sensor["evidence"] and alike
    if proven or _heard_at_rest(found):
        return {**sensor, "others": [{key: found[key] for key in OF_OTHERS}, *rest]}
    others = [*rest, {key: sensor[key] for key in OF_OTHERS}]
    return {**found, "others": others, "why": [*found["why"], *sensor["why"]]}


def _heard_at_rest(cause: Mapping[str, Any]) -> bool:
    """Whether a cause may be what a sensor's noise or hum looks like: friction is slow."""
    return cause["effect"] in ("ripple", HUM) or (lies_outside(cause) and excuses_little(cause))


def of_noise(noise: Growth) -> dict[str, Any]:
    """Return a sensor's noise, which is there at rest, as a cause."""
    why = (
        f"While the joint stands still the current fluctuates {noise.times:.2g} times as much as "
        f"in the baseline, which is {noise.share:.0%} of what it has grown by in motion; a fault "
        "of the gear shows in motion alone."
    )
    return _sensor(SENSOR_NOISE, NOISE, noise.share, {AT_REST: noise.times}, why)


def of_sum(grown: ErrorGrowth) -> dict[str, Any]:
    """Return trouble of the phases' sensors as a cause."""
    part = {"sensor_offset": "what is constant of", "sensor_gain": "what follows the phases of"}
    times = (
        f"{MOST_TIMES:g} times and more" if grown.times > MOST_TIMES else f"{grown.times:.2g} times"
    )
    why = (
        "The three phases of a motor without a neutral wire add up to nothing, whatever the gear "
        f"does; {part.get(grown.kind, 'the rest of')} their sum is {times} the baseline's, "
        f"and {grown.share:.0%} of what the current's fluctuation has grown by."
    )
    evidence = {IN_THE_SUM: min(grown.times, MOST_TIMES)}
    return _sensor(grown.kind, OF_THE_SUM[grown.kind], grown.share, evidence, why)


def of_spikes(grown: ErrorGrowth) -> dict[str, Any]:
    """Return single samples that leap as a cause."""
    why = (
        f"Single samples that leap and are back with the next are {grown.share:.0%} of what the "
        "current's fluctuation has grown by; a fault of the gear lasts longer."
    )
    evidence = {IN_SPIKES: min(grown.times, MOST_TIMES)}
    return _sensor(grown.kind, OF_SPIKES, grown.share, evidence, why)


def of_taught_points(away_rad: float) -> dict[str, Any]:
    """Return points that were taught anew as a cause: it is another path, whatever the joint is."""
    return {
        "effect": TAUGHT,
        "domain": "joint-angle",
        "parameters": {},
        "interpretation": (
            f"points of the program that were taught anew, up to {1e3 * away_rad:.2g} mrad away: "
            "of this path no baseline is there; record one"
        ),
        "share": 1.0,
        "p_value": None,
        "ties": [],
        "harmless": True,
        "origin": "load",
        "explained": 1.0,
        "clear": True,
        "evidence": {"displaced_rad": away_rad},
        "why": [
            f"By the logged position its motions begin and end up to {1e3 * away_rad:.2g} mrad "
            "from where those of the baseline do, and so do those of other joints; no fault moves "
            "them all."
        ],
        "others": [],
    }


def taught_points(away_rad: Mapping[int, float]) -> str:
    """Say that the points of a program were taught anew; by joint, how far away."""
    return (
        f"the program's points were taught anew: {axes_phrase(sorted(away_rad))} lead up to "
        f"{1e3 * max(away_rad.values()):.2g} mrad elsewhere than in the baseline; a fault that "
        "another path hides would not be told: record a new baseline"
    )


def _sensor(
    effect: str, meaning: str, share: float, evidence: Mapping[str, float], *why: str
) -> dict[str, Any]:
    """Return a cause that makes a joint neither healthy nor faulty."""
    return {
        "effect": effect,
        "domain": "time",
        "parameters": {},
        "interpretation": meaning,
        "share": share,
        "p_value": None,
        "ties": [],
        "harmless": False,
        "origin": "measurement",
        "explained": share,
        "clear": False,
        "evidence": dict(evidence),
        "why": [*why],
        "others": [],
    }


def of_lag(lag: Lag, found: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return a current's lag as the cause, beside it what was found with the current moved back.

    As a sensor's noise it makes a joint neither healthy nor faulty.
    """
    way = "later" if lag.lag_s > 0 else "earlier"
    late = f"the current comes {1e3 * abs(lag.lag_s):.2g} ms {way} against the position"
    others = [] if found is None else [{key: found[key] for key in OF_OTHERS}, *found["others"]]
    rest = [{**other, "share": other["share"] * (1 - lag.share)} for other in others]
    rest = [other for other in rest if other["share"] >= SMALLEST_SHARE]
    why = [
        f"In all motions alike {late} than in the baseline, whose recordings differ by "
        f"{1e3 * lag.of_baseline_s:.2g} ms at most; moved back, {lag.share:.0%} of what its course "
        "differs by is gone. A fault of the gear bends the course instead."
    ]
    if rest:
        why += ["With the current moved back:", *(found or {})["why"]]
    told = f"{late} than in the baseline: look at the logger, its bus and the drive"
    evidence = {"delay_s": lag.lag_s, "baseline_delay_s": lag.of_baseline_s}
    cause = _sensor(CURRENT_LAG, told, lag.share, evidence, *why)
    return {**cause, "parameters": {"delay_s": lag.lag_s}, "others": rest}


def meaning(effect: str, own: str, ties: Sequence[str], change: float | None) -> str:
    """Say what a cause means, and of friction whether it has grown, and by how much.

    Parameters
    ----------
    effect, own
        Its name, and what that means by itself.
    ties
        Names of what explains as much.
    change
        By which share of itself friction, or the current, is larger, if that is known.
    """
    unsure = effect in FRICTION and not FRICTION.isdisjoint(ties)
    said = ANY_FRICTION if unsure and own != LESS_FRICTION else own
    if change is None:
        return said
    what = "the current" if effect == SCALE.name else "the joint's friction"
    if change >= MUCH:
        return f"{said}; {what} has grown much"
    way = "grown" if change > 0 else "fallen"
    return f"{said}; {what} has {way} by {abs(change):.0%}"


def _why(cause: Cause, change: Change) -> list[str]:
    """Say in a maintainer's words what was measured, how sure it is, and what it cannot tell."""
    before, after = change.units
    kind = "sessions" if change.sessions else "cycles"
    sentences = []
    seen = cause.evidence
    if "measured_order" in seen:
        turn = "turn of the motor" if change.angle == "motor" else f"{change.angle} revolution"
        sentences.append(
            f"Torque ripple at {seen['measured_order']:.4g} ± {seen['order_error']:.1g} per {turn} "
            f"has {seen['power_ratio']:.3g} times the power that it has in the baseline's {kind}; "
            f"two orders must differ by {seen['order_resolution']:.2g} to be told apart within a "
            "stroke."
        )
        sentences += _told(change)
    if "measured_frequency_hz" in seen:
        sentences.append(
            f"A line at {seen['measured_frequency_hz']:.4g} Hz, whatever the speed, has "
            f"{seen['power_ratio']:.3g} times the power that it has in the baseline's {kind}."
        )
    chance = "below 0.0001" if cause.p_value < 1e-4 else f"{cause.p_value:.2g}"
    sentences.append(
        f"{_effect_name(cause)} explains {cause.share:.0%} of what the current changed beyond the "
        f"{kind}' own differences; healthy {kind} show as much with probability {chance} "
        f"({before} {kind} against {after})."
    )
    if cause.ties:
        sentences.append(
            f"The recordings cannot tell it from: {'; '.join(map(effect_in_words, cause.ties))}."
        )
    for other in change.causes[1:]:
        name = _effect_name(other).lower()
        sentences.append(f"Besides, {name} explains {other.share:.0%}: {other.interpretation}.")
    if change.explained_share < WELL_EXPLAINED:
        sentences.append(
            f"{1 - change.explained_share:.0%} of the change has no cause in the library."
        )
    if not change.sessions:
        sentences.append(
            "With fewer than three baseline recordings it is assumed, not known, how much healthy "
            "sessions differ."
        )
    return sentences


def _told(change: Change) -> list[str]:
    """Say how turns of the motor could be counted that nobody had told how to."""
    if change.told is None:
        return []
    what = f"That the motor has {change.told.pole_pairs} pole pairs"
    if change.told.gear_ratio is not None:
        what = f"That the gear ratio is {change.told.gear_ratio:.4g}"
    return [f"{what} is told by the baseline's own line at twice a wave generator's turn."]


def _effect_name(cause: Cause) -> str:
    name = effect_in_words(cause.effect)
    return name[0].upper() + name[1:]
