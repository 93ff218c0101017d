"""When nights make an alarm: k of n of them, one that is gross, or some that come back."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count

LATELY = 30
"""Judged nights, a month, in which one large night more than the `needed` ones is an alarm,
whatever lies between: an intermittent fault, as of a cable, may never show in two nights of three.
Large and not only certain, for a baseline that is too even by chance makes certain, not large. Of
3237 healthy nights of virtual joints (benchmarks/year.py) none was large."""


def recurring(needed: int) -> int:
    """Return how many large nights of the last `LATELY` are an alarm."""
    return needed + 1


@dataclass(frozen=True)
class Night:
    """What the rule looks at."""

    signal: bool
    """The joint is at fault by the night's own verdict, or not as it was by the chart."""
    large: bool = False
    """At fault by the size of its change, not by its cause alone."""
    gross: bool = False
    """So much so that one night is enough."""
    differs: bool = False
    """By its own p-value, whatever excuses that: it is no sign that an alarm is over."""
    calm: bool = True
    """Whether it may end an alarm: not while what is left of it lies near the limit."""
    judged: bool = True
    """False: nothing is known of the night, which neither raises nor clears."""


@dataclass(frozen=True)
class Episode:
    """An alarm, by index of its nights: half-open, `cleared` is None while it stands."""

    raised: int
    cleared: int | None
    returns: bool = False
    """Whether only nights that lie apart raised it: then it is over when they are past."""


def episodes(nights: Sequence[Night], needed: int, among: int) -> list[Episode]:
    """Return every alarm of a series of nights.

    Parameters
    ----------
    nights
        In time order.
    needed, among
        An alarm is raised in the night in which `needed` of the last `among` judged nights have a
        signal, or one more of the last `LATELY` is large; it is cleared in the first night in which
        `is_over` says so.
    """
    found: list[Episode] = []
    recent: list[Night] = []
    raised: int | None = None
    returns = False
    for index, night in enumerate(nights):
        if not night.judged:
            continue
        recent = [*recent, night][-max(among, LATELY) :]
        if raised is None:
            of_last = sum(one.signal for one in recent[-among:])
            together = night.gross or (night.signal and of_last >= needed)
            if together or (night.large and _returns(recent, needed)):
                raised, returns = index, not together
        elif is_over(recent, needed, among, returns=returns):
            found.append(Episode(raised, index, returns))
            raised = None
    if raised is not None:
        found.append(Episode(raised, None, returns))
    return found


def is_over(recent: Sequence[Night], needed: int, among: int, *, returns: bool) -> bool:
    """Return whether an alarm ends with the last of the judged nights so far.

    None of the last `among` has a signal, or differs, and that night is calm. One that `returns`
    stands as long as the last `LATELY` nights would raise it.
    """
    last = recent[-among:]
    quiet = last[-1].calm and not any(one.signal or one.differs for one in last)
    return quiet and len(last) == among and not (returns and _returns(recent, needed))


def nights_to_go(recent: Sequence[Night], needed: int, among: int, *, returns: bool) -> int:
    """Return how many nights without a sign would end an alarm that stands.

    Parameters
    ----------
    recent
        The judged nights so far, `LATELY` and `among` of them at least, or all.
    needed, among, returns
        As of `is_over`.
    """
    quiet = Night(signal=False)
    return next(
        more
        for more in count(1)
        if is_over([*recent, *[quiet] * more], needed, among, returns=returns)
    )


def _returns(recent: Sequence[Night], needed: int) -> bool:
    return sum(one.large for one in recent[-LATELY:]) >= recurring(needed)
