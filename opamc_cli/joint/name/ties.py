"""Explanations that the data cannot tell apart, and the recording that would."""

from collections.abc import Sequence

from opamc_cli.joint.name.chain import Chain
from opamc_cli.joint.name.search import Trial
from opamc_cli.joint.name.significance import LEAST_T, paired

ADVICE = (
    (
        {"thermal_viscous", "warmup", "viscous"},
        "record again with the joint already warm, logging its temperature",
    ),
    (
        {"coulomb", "viscous", "stribeck", "quadratic_friction", "sublinear_friction"},
        "move at more speeds, from a fiftieth of the top speed up to it",
    ),
    (
        {"ripple", "sensor_offset", "sensor_gain", "dead_time"},
        "log all three phase currents together with the position",
    ),
    (
        {"ripple", "mains_hum", "elasticity"},
        "repeat the motion at another speed: what belongs to an angle moves, a line stays",
    ),
    (
        {"inertia", "elasticity", "coupling", "time_delay", "payload_change"},
        "repeat the motion with other accelerations at equal speeds, without a change of tool",
    ),
    (
        {"offset", "asymmetric_friction", "spring", "gravity", "position_drag", "hysteresis"},
        "cover more of the travel, through every place in both directions",
    ),
)
"""Effects that are alike, and what tells them apart."""


def ties_of(best: Chain, name: str, others: Sequence[Trial]) -> tuple[str, ...]:
    """Return the effects that in the place of one leave no surely larger held-out error."""
    found = []
    for other in others:
        difference, error = paired(best.deviation, other.chain.deviation)
        if other.why_not is None and difference <= LEAST_T * error:
            found.append(other.term.effect.name)
    return tuple(other for other in dict.fromkeys(found) if other != name)


def separating_experiment(name: str, ties: tuple[str, ...]) -> str | None:
    """Say what to record to tell an effect from those that tie with it; None where nothing ties."""
    if not ties:
        return None
    for members, advice in ADVICE:
        if name in members and any(tie in members for tie in ties):
            return advice
    return "move over more of the travel, at more speeds and accelerations, in both directions"
