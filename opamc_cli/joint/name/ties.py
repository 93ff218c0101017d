"""Explanations that the data cannot tell apart, and the recording that would."""

from collections.abc import Sequence

from opamc_cli.joint.name.chain import Chain
from opamc_cli.joint.name.search import Trial
from opamc_cli.joint.name.significance import LEAST_T, paired

SPEED = frozenset({"coulomb", "viscous", "stribeck", "quadratic_friction", "sublinear_friction"})
PLACE = frozenset(
    {"offset", "asymmetric_friction", "spring", "gravity", "position_drag", "hysteresis"}
)
WARMTH = frozenset({"thermal_viscous", "warmup", "viscous"})
CHANGE = frozenset({"inertia", "elasticity", "coupling", "time_delay", "payload_change"})
ELECTRIC = frozenset({"ripple", "sensor_offset", "sensor_gain", "dead_time"})
LINE = frozenset({"ripple", "mains_hum", "elasticity"})

ADVICE = (
    (WARMTH, "record again with the joint already warm, logging its temperature"),
    (SPEED, "move at more speeds, from a fiftieth of the top speed up to it"),
    (ELECTRIC, "log all three phase currents together with the position"),
    (LINE, "repeat the motion at another speed: what belongs to an angle moves, a line stays"),
    (
        CHANGE,
        "repeat the motion with other accelerations at equal speeds, without a change of tool",
    ),
    (PLACE, "cover more of the travel, through every place in both directions"),
)


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
