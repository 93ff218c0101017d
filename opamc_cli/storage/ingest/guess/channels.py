"""Which channel is which column of a run, by names, and checked against the values."""

from collections.abc import Sequence
from dataclasses import dataclass

from opamc_cli.storage.ingest.guess.names import Meant, counts_time, nearness, says_actual
from opamc_cli.storage.ingest.map.axes import MOST_AXES
from opamc_cli.storage.schemas.channels import LOGGED, PHASES

KINDS = ("current", *PHASES, *LOGGED)
"""Kinds of a run's columns, in the order in which a map lists them."""


@dataclass(frozen=True)
class Choice:
    """The channels of one kind by axis, and the patterns that were passed over for them."""

    kind: str
    by_axis: dict[int, Meant]
    passed_over: tuple[str, ...]


def choose(meant: Sequence[Meant]) -> dict[str, Choice]:
    """Return the channels of each kind that a map takes.

    The one measured family with the most axes wins. A joint keeps its number, `J4` is axis 4;
    where currents count from 0, or beyond what an arm has axes, the lowest is axis 1. Channels
    without a number (as ROS names joints) are axes in their order.
    """
    families: dict[str, list[list[Meant]]] = {}
    for kind in (*KINDS, "torque"):
        groups: dict[str, list[Meant]] = {}
        for channel in meant:
            if channel.quantity == kind:
                place = channel.pattern if channel.number is not None else _parent(channel)
                groups.setdefault(place, []).append(channel)
        families[kind] = sorted(groups.values(), key=_worth, reverse=True)
    measured = any(group[0].measured for group in families["current"])
    if not measured and not any(families[phase] for phase in PHASES):
        families["current"] = families["torque"]
    lowest = _first(families)
    choices = {}
    for kind in KINDS:
        groups_of_kind = families[kind]
        if not groups_of_kind:
            continue
        by_axis: dict[int, Meant] = {}
        taken: list[str] = []
        for group in groups_of_kind:
            own = _by_axis(group, lowest)
            # the same kind under another name, for axes that the first does not hold
            fits = not by_axis or (group[0].measured and not own.keys() & by_axis.keys())
            if own and fits:
                by_axis.update(own)
                taken.append(group[0].pattern)
        others = tuple(g[0].pattern for g in groups_of_kind if g[0].pattern not in taken)
        choices[kind] = Choice(kind, dict(sorted(by_axis.items())), others)
    axes = {
        axis for kind in ("current", *PHASES) if kind in choices for axis in choices[kind].by_axis
    }
    # Where joints beside are matters to the others, whether their own current was logged or not.
    places = set(axes)
    logged = choices["position"].by_axis if axes and "position" in choices else {}
    while max(places, default=0) + 1 in logged:
        places.add(max(places) + 1)
    return {
        kind: _within(choice, places if kind == "position" else axes)
        for kind, choice in choices.items()
    }


def time_channel(meant: Sequence[Meant]) -> Meant | None:
    """Return the channel of time stamps; one that only its unit tells if there is no other."""
    stamps = [channel for channel in meant if channel.quantity == "time" and channel.measured]
    return min(stamps, key=lambda channel: counts_time(channel.pattern), default=None)


def _within(choice: Choice, axes: set[int]) -> Choice:
    kept = {axis: channel for axis, channel in choice.by_axis.items() if axis in axes}
    return Choice(choice.kind, kept, choice.passed_over)


def _worth(group: Sequence[Meant]) -> tuple[bool, bool, int, int, int]:
    pattern = group[0].pattern
    near = nearness(pattern) if group[0].quantity == "temperature" else 0
    return group[0].measured, says_actual(pattern), near, len(group), -len(pattern)


def _parent(channel: Meant) -> str:
    """Return where a channel without a number lies: `/joint_states/#/effort`."""
    parts = channel.pattern.split("/")
    return "/".join([*parts[:-2], "#", parts[-1]]) if len(parts) > 2 else channel.pattern


def _first(families: dict[str, list[list[Meant]]]) -> int:
    """Return the number in names that is axis 1."""
    for kind in KINDS:
        for group in families[kind]:
            numbers = [channel.number for channel in group if channel.number is not None]
            if numbers and group[0].index is None:
                return 1 if min(numbers) > 0 and max(numbers) <= MOST_AXES else min(numbers)
    return 0


def _by_axis(group: Sequence[Meant], lowest: int) -> dict[int, Meant]:
    if any(channel.number is None for channel in group):
        return dict(enumerate(group, start=1))
    first = 0 if group[0].index is not None else lowest
    axes = {int(channel.number or 0) - first + 1: channel for channel in group}
    # what is numbered below the first current belongs to no axis
    return {axis: channel for axis, channel in axes.items() if axis > 0}
