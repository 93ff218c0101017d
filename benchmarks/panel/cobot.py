"""Cases of the cobot: shoulder or elbow moves, one thing is hidden in its gear, load or log.

Everything is hidden in an arm that lacks little but what its warmth and the filter of its current
do. Two rows are of the whole arm: as it is, and with something hidden that takes turns over seeds.
"""

from collections.abc import Iterator
from functools import partial

from sources import cobot

from panel.case import RIGID, Case, Logged, Wanted

PRESENT = ("elasticity", "time_delay", "thermal_viscous", "warmup")
"""What every arm has: springs, a filtered current, friction that falls as the gear warms."""
PRESENT_WHOLE = (*PRESENT, "ripple", "load_friction", "stribeck")
SHOULDER, ELBOW = 1, 2


def cases(seed: int, _wanted: Wanted) -> Iterator[Case]:
    """Everything that can be hidden once a seed, in one size each; odd seeds move the shoulder."""
    hidden = list(cobot.HIDDEN)
    for one in (*hidden, ""):
        yield _case(one, seed, whole=False)
    for one in (hidden[seed % len(hidden)], ""):
        yield _case(one, seed, whole=True)


def _case(hidden: str, seed: int, *, whole: bool) -> Case:
    moving = SHOULDER if seed % 2 else ELBOW
    return Case(
        "cobot",
        f"{hidden or 'none'}{' whole arm' * whole} {seed}",
        "cyclic",
        "position",
        RIGID,
        cobot.HIDDEN.get(hidden, ""),
        partial(record, hidden, seed, moving, whole),
        PRESENT_WHOLE if whole else PRESENT,
        gear=(cobot.RATIO, cobot.POLE_PAIRS),
        seed=seed,
    )


def record(hidden: str, seed: int, moving: int, whole: bool) -> list[Logged]:
    """Record one joint; the temperature is logged only where it matters."""
    made = cobot.record(cobot.draw(seed, moving, whole=whole), hidden)
    warm = made.temperature if hidden == "warming with thermometer" else None
    return [Logged(made.rate_hz, made.current, position=made.position, temperature=warm)]
