"""When nights make an alarm: k of n of them, or one that is gross; and when it is over."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Night:
    """What the rule looks at."""

    signal: bool
    """The joint is at fault by the night's own verdict, or not as it was by the chart."""
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


def episodes(nights: Sequence[Night], needed: int, among: int) -> list[Episode]:
    """Return every alarm of a series of nights.

    Parameters
    ----------
    nights
        In time order.
    needed, among
        An alarm is raised in the night in which `needed` of the last `among` judged nights have a
        signal; it is cleared in the first calm night in which none of the last `among` has, or
        differs.
    """
    found: list[Episode] = []
    recent: list[Night] = []
    raised: int | None = None
    for index, night in enumerate(nights):
        if not night.judged:
            continue
        recent = [*recent, night][-among:]
        if raised is None:
            if night.gross or (night.signal and sum(one.signal for one in recent) >= needed):
                raised = index
            continue
        quiet = night.calm and not any(one.signal or one.differs for one in recent)
        if quiet and len(recent) == among:
            found.append(Episode(raised, index))
            raised = None
    if raised is not None:
        found.append(Episode(raised, None))
    return found
