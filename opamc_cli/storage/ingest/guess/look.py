"""What the first recording holds, as far as its map can be guessed from it."""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from opamc_cli.errors import InputError
from opamc_cli.signal.plausible.quality import LIMITS, Size
from opamc_cli.storage.ingest.convert import UNSIGNED, quarters_of
from opamc_cli.storage.ingest.formats import format_by_ending, known_endings
from opamc_cli.storage.ingest.guess.channels import Choice, choose, time_channel
from opamc_cli.storage.ingest.guess.layout import Layout, text_layout
from opamc_cli.storage.ingest.guess.names import Meant, counts_time, meanings
from opamc_cli.storage.ingest.guess.values import Guess, are_phases, time_unit
from opamc_cli.storage.ingest.map.map_file import ColumnMap, IngestMap
from opamc_cli.storage.ingest.map.units import CONVERSIONS, conversion
from opamc_cli.storage.ingest.opening import open_source, require_recording
from opamc_cli.storage.ingest.source import Array, Name, Rate, Selection, Source
from opamc_cli.storage.schemas.channels import CURRENTS, Conversion

LOOKED_AT_ROWS = 1 << 16
"""Rows whose values are looked at: minutes of a robot's log."""

PROGRAMS = ("program", "Program", "program_name", "prog", "Prog", "programm", "Programm")
"""Names of a column of texts that names the program."""

WARMTH = LIMITS["temperature"]


@dataclass(frozen=True)
class Look:
    """What was seen in the first recording."""

    path: Path
    layout: Layout | None
    choices: dict[str, Choice]
    time: Meant | None
    values: dict[Name | tuple[Name, int], Array]
    unused: list[str]
    repeated: list[str]
    """Names that several columns have."""
    rate: Rate | None
    """Where the file declares one of all that was chosen."""
    unsigned: set[Name | tuple[Name, int]]
    """Keys of `values` that the file has without their sign."""
    program: str | None = None
    """Column that names the program."""


def look_at(path: Path, encoding: str | None = None) -> Look:
    """Look at a recording's channels and at the beginning of their values.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    kind = format_by_ending(path)
    if kind is None:
        msg = f"{path}: its ending does not tell the format; known: {known_endings()}"
        raise InputError(msg)
    require_recording(path)
    layout = text_layout(path, encoding) if kind == "csv" else None
    with open_source(path, any_map(kind, layout)) as source:
        # a joint's name is safer than its place in a message
        listed = [c for c in source.channels() if kind != "ros" or c.width is None]
        meant = meanings(listed, counted=kind != "ros")
        if layout is not None and not layout.header:
            meant = _numbered_phases(source, [c.name for c in listed if isinstance(c.name, int)])
        choices = choose(meant)
        rows = {each.name: each.rows for each in listed}
        for kind in (kind for kind in CURRENTS if kind in choices and choices[kind].by_axis):
            n = rows[next(iter(choices[kind].by_axis.values())).source]
            # what was logged at another rate is no channel of this run
            meant = [each for each in meant if rows[each.source] == n]
            choices = choose(meant)
            break
        values: dict[Name | tuple[Name, int], Array] = {}
        empty: set[Name] = set()
        while True:
            chosen = [channel for choice in choices.values() for channel in choice.by_axis.values()]
            values |= {key_of(c): values_of(source, c) for c in chosen if key_of(c) not in values}
            holding = _empty(choices, values)
            if not holding:
                break
            empty |= holding
            meant = [each for each in meant if each.source not in empty]
            choices = choose(meant)
        time = time_channel(meant)
        program = _program(source)
        if time:
            values[key_of(time)] = values_of(source, time)
    if time and counts_time(time.pattern) and time_guess(time, values[key_of(time)]) is None:
        time = None
    logged = choices.get("temperature", Choice("temperature", {}, ()))
    odd = {n: one for n, one in logged.by_axis.items() if _is_of_no_joint(values[key_of(one)], one)}
    for axis in odd:
        del logged.by_axis[axis]
    signed = [
        key_of(channel)
        for kind, choice in choices.items()
        if kind in (*CURRENTS, "velocity")
        for channel in choice.by_axis.values()
    ]
    unsigned = {key for key in signed if quarters_of(values[key]) == UNSIGNED}
    for key in unsigned:
        values[key] = np.where(values[key] < 1 << 15, values[key], values[key] - (1 << 16))
    taken = [*chosen, *([time] if time else [])]
    used, patterns = {each.source for each in taken}, {each.pattern for each in taken}
    why = f"{WARMTH.beyond}: {WARMTH.looks_like}?"
    unused = [f"{each.source} ({why})" for each in odd.values()]
    for name in (each.name for each in listed if each.name not in used):
        if isinstance(name, int):
            continue
        if name in empty:
            unused.append(f"{name} (empty)")
            continue
        pattern = re.sub(r"[0-9]+(?=[^0-9]*$)", "#", name)
        # one of a family that is used is named itself
        unused.append(name if pattern in patterns else pattern)
    unused = list(dict.fromkeys(unused))
    # of nested groups the deeper ones are many, and seldom signals; a text has none but units
    rest = [name for name in unused if layout is not None or "/" not in name[1:]] or unused
    repeated = list(dict.fromkeys(each.repeated for each in listed if each.repeated))
    rates = [each.rate for each in listed if each.name in used]
    rate = rates[0] if len({one and one.hz for one in rates}) == 1 else None
    return Look(path, layout, choices, time, values, rest, repeated, rate, unsigned, program)


def _empty(choices: dict[str, Choice], values: dict[Name | tuple[Name, int], Array]) -> set[Name]:
    """Return what was chosen of kinds that hold no number: loggers keep columns for what they lack.

    Where one axis of several is empty, it is that joint's loss, and no reason for another family.
    """
    found: set[Name] = set()
    for choice in choices.values():
        own = choice.by_axis.values()
        if not any(np.isfinite(values[key_of(channel)]).any() for channel in own):
            found |= {channel.source for channel in own}
    return found


def _program(source: Source) -> str | None:
    for name in PROGRAMS:
        with suppress(InputError):
            if isinstance(source.value(name), str):
                return name
    return None


def _is_of_no_joint(values: Array, channel: Meant) -> bool:
    """Return whether a temperature would be left out."""
    unit, size = conversion(channel.unit or "degC", "temperature") or Conversion(1.0), Size(WARMTH)
    size.add(unit.factor * channel.scale * values + unit.offset)
    return size.is_impossible


def any_map(kind: str, layout: Layout | None) -> IngestMap:
    """Return a map by which a recording of a kind can be opened, whatever its channels are."""
    column = ColumnMap(source=0 if kind == "csv" else "", unit="A")
    given: dict[str, Any] = {"format": kind, "columns": {"axis1_a": column}}
    if layout is not None:
        given |= vars(layout)
    return IngestMap(**given)


def _numbered_phases(source: Source, numbers: Sequence[Name]) -> list[Meant]:
    """Take three columns without names for the phases of one motor, if they behave so."""
    if len(numbers) != 3:
        return []
    a, b, c = (values_of(source, Meant("a", None, "", n, None, True, None)) for n in numbers)
    if not are_phases(a, b, c):
        return []
    return [
        Meant(phase, 1, f"column {n}", n, None, True, None)
        for phase, n in zip("abc", numbers, strict=True)
    ]


def values_of(source: Source, channel: Meant) -> Array:
    """Read the first values of a channel, (n,), `LOOKED_AT_ROWS` at most."""
    dates = channel.quantity == "time" and channel.unit is None
    selection = Selection(channel.source, channel.index)
    if dates:
        listed = {each.name: each.dates for each in source.channels()}
        selection = Selection(channel.source, channel.index, listed.get(channel.source, False))
    rows: list[Array] = []
    n = 0
    for block in source.blocks({"x": selection}):
        rows.append(block["x"])
        n += len(block["x"])
        if n >= LOOKED_AT_ROWS:
            break
    return np.concatenate(rows)[:LOOKED_AT_ROWS] if rows else np.empty(0)


def key_of(channel: Meant) -> Name | tuple[Name, int]:
    """Return under what a channel's values are known."""
    return channel.source if channel.index is None else (channel.source, channel.index)


def time_guess(time: Meant | None, stamps: Array | None) -> Guess | None:
    """Tell the unit of a clock by what the file says of it or by its stamps, shape (n,)."""
    if time is None or stamps is None or len(stamps) < 3:
        return None
    if stamps.dtype.kind == "M":
        return Guess("iso8601", "dates")
    if time.unit in CONVERSIONS["time"]:
        return Guess(str(time.unit), "as the file says")
    return time_unit(stamps)
