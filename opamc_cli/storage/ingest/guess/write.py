"""The map that is guessed for recordings, as text for their user to look at and correct."""

import json
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
from opamc_cli.storage.ingest.guess.values import (
    MOST_TURNS,
    Float,
    Guess,
    angle_units,
    are_phases,
    current_unit,
    rate_from_speed,
    time_unit,
    turns,
    wraps,
)
from opamc_cli.storage.ingest.map.map_file import ColumnMap, IngestMap
from opamc_cli.storage.ingest.map.units import CONVERSIONS, conversion, date_s, is_torque
from opamc_cli.storage.ingest.opening import open_source
from opamc_cli.storage.ingest.source import Array, Name, Rate, Selection, Source
from opamc_cli.storage.ingest.time.stamps import RATE_WITHIN, Clock, examine
from opamc_cli.storage.schemas.channels import CURRENTS, LOGGED, Conversion

LOOKED_AT_ROWS = 1 << 16
"""Rows whose values are looked at: minutes of a robot's log."""

PROGRAMS = ("program", "Program", "program_name", "prog", "Prog", "programm", "Programm")
"""Names of a column of texts that names the program."""

WARMTH = LIMITS["temperature"]

LOOKED_AT_FILES = 20
"""Recordings whose rate is looked at."""


@dataclass(frozen=True)
class _Look:
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


@dataclass(frozen=True)
class _Line:
    key: str
    text: str
    why: str


def guess_map(paths: Sequence[Path], encoding: str | None = None) -> str:
    """Return a map for recordings of one kind, as YAML with a comment for every line.

    Parameters
    ----------
    paths
        Recordings; channels are taken from the first, rates from all (the first twenty).
    encoding
        Of a text, None where the text is to tell it.

    Raises
    ------
    InputError
        If a recording cannot be read, or nothing in it looks like a current.
    """
    look = _look(paths[0], encoding)
    if not any(kind in look.choices for kind in CURRENTS):
        msg = (
            f"{paths[0]}: no channel looks like a motor current or torque "
            f"({', '.join(look.unused[:12]) or 'no names'}); write the map by hand, see "
            "docs/formats.md"
        )
        raise InputError(msg)
    clock, clock_lines = _clock_lines(look, paths)
    rate = clock.sampling_rate_hz if clock is not None else None
    lines = [
        f"# Guessed from {paths[0].name}. Look at every line, correct it, save this as a map.",
        *_layout_lines(look),
        *clock_lines,
        "columns:",
    ]
    columns = _column_lines(look, rate)
    width = max(len(line.text) for line in columns)
    lines += [f"  {line.text:<{width}}  # {line.why}" for line in columns]
    if look.repeated:
        lines.append(f"# not used, for several columns have the name: {_shortened(look.repeated)}")
    if look.unused:
        lines.append(f"# not used: {_shortened(look.unused)}")
    if _differ_by_axis(paths):
        lines.append("# the files seem to hold one joint each: give each a map with its axis")
    lines += [
        "metadata:",
        "  robot:    # such as cell 7; runs of different robots are told apart",
        _program_line(look),
        *_started_at(look),
    ]
    return "\n".join(lines) + "\n"


def _look(path: Path, encoding: str | None = None) -> _Look:
    kind = format_by_ending(path)
    if kind is None:
        msg = f"{path}: its ending does not tell the format; known: {known_endings()}"
        raise InputError(msg)
    layout = text_layout(path, encoding) if kind == "csv" else None
    with open_source(path, _any_map(kind, layout)) as source:
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
        time = time_channel(meant)
        program = _program(source)
        chosen = [channel for choice in choices.values() for channel in choice.by_axis.values()]
        values = {_key(c): _values(source, c) for c in [*chosen, *([time] if time else [])]}
    if time and counts_time(time.pattern) and _time_guess(time, values[_key(time)]) is None:
        time = None
    logged = choices.get("temperature", Choice("temperature", {}, ()))
    odd = {n: one for n, one in logged.by_axis.items() if _is_of_no_joint(values[_key(one)], one)}
    for axis in odd:
        del logged.by_axis[axis]
    signed = [
        _key(channel)
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
        pattern = re.sub(r"[0-9]+(?=[^0-9]*$)", "#", name)
        # one of a family that is used is named itself
        unused.append(name if pattern in patterns else pattern)
    unused = list(dict.fromkeys(unused))
    # of nested groups the deeper ones are many, and seldom signals
    rest = [name for name in unused if "/" not in name[1:]] or unused
    repeated = list(dict.fromkeys(each.repeated for each in listed if each.repeated))
    rates = [each.rate for each in listed if each.name in used]
    rate = rates[0] if len({one and one.hz for one in rates}) == 1 else None
    return _Look(path, layout, choices, time, values, rest, repeated, rate, unsigned, program)


def _program(source: Source) -> str | None:
    for name in PROGRAMS:
        with suppress(InputError):
            if isinstance(source.value(name), str):
                return name
    return None


def _program_line(look: _Look) -> str:
    if look.program is None:
        return "  program:  # such as pick; runs of different programs are not compared"
    why = "its first row's; runs of different programs are not compared"
    return f"  program: {{source: {_quoted(look.program)}}}  # {why}"


def _is_of_no_joint(values: Array, channel: Meant) -> bool:
    """Return whether a temperature would be left out."""
    unit, size = conversion(channel.unit or "degC", "temperature") or Conversion(1.0), Size(WARMTH)
    size.add(unit.factor * channel.scale * values + unit.offset)
    return size.is_impossible


def _differ_by_axis(paths: Sequence[Path]) -> bool:
    """Return whether names of files differ by the number of a joint alone, as `n06_axis2.csv`."""
    number = re.compile(r"((?:axis|achse|joint|motor|(?<![a-z])[aj])[ _.\-]*)[0-9]+", re.I)
    kinds = {number.sub(r"\1#", path.stem) for path in paths}
    return len({path.stem for path in paths}) > 1 and len(kinds) == 1


def _any_map(kind: str, layout: Layout | None) -> IngestMap:
    column = ColumnMap(source=0 if kind == "csv" else "", unit="A")
    given: dict[str, Any] = {"format": kind, "columns": {"axis1_a": column}}
    if layout is not None:
        given |= vars(layout)
    return IngestMap(**given)


def _numbered_phases(source: Source, numbers: Sequence[Name]) -> list[Meant]:
    """Take three columns without names for the phases of one motor, if they behave so."""
    if len(numbers) != 3:
        return []
    a, b, c = (_values(source, Meant("a", None, "", n, None, True, None)) for n in numbers)
    if not are_phases(a, b, c):
        return []
    return [
        Meant(phase, 1, f"column {n}", n, None, True, None)
        for phase, n in zip("abc", numbers, strict=True)
    ]


def _values(source: Source, channel: Meant) -> Array:
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


def _layout_lines(look: _Look) -> list[str]:
    lines = [f"format: {format_by_ending(look.path)}"]
    layout = look.layout
    if layout is None:
        return lines
    lines.append(f"separator: {json.dumps(layout.separator)}")
    if layout.decimal != ".":
        lines.append(f'decimal: "{layout.decimal}"')
    lines.append(f"header: {'true' if layout.header else 'false'}")
    for key in ("skip_rows", "units_rows"):
        if getattr(layout, key):
            lines.append(f"{key}: {getattr(layout, key)}")
    if layout.encoding != "utf-8":
        lines.append(f"encoding: {layout.encoding}")
    return lines


def _clock_lines(look: _Look, paths: Sequence[Path]) -> tuple[Clock | None, list[str]]:
    """Return the first recording's clock, None where its rate is not known, and its lines."""
    time = look.time
    stamps = look.values.get(time.source) if time is not None else None
    unit = _time_guess(time, stamps)
    if time is None and (declared := look.rate) is not None:
        where = f"{{source: {_quoted(declared.source)}, unit: {declared.unit}}}"
        line = f"sampling_rate_hz: {where}  # {declared.hz:.6g} Hz in {look.path.name}"
        return _counted(look, declared.source, declared.hz), [line]
    if time is None or stamps is None:
        return None, ["sampling_rate_hz:  # no channel tells it: write the samples per second"]
    if unit is None:
        why = f"{time.source} goes back or fits no unit of time: write the samples per second"
        return None, [f"sampling_rate_hz:  # {why}"]
    line = f"time: {{source: {_quoted(time.source)}, unit: {unit.unit}}}"
    if unit.unit == "samples":
        rate = rate_from_speed(*_angles(look))
        lines = [f"{line}  # {unit.why}"]
        if rate is None:
            return None, [*lines, "sampling_rate_hz:  # write how many samples make a second"]
        why = "at this rate the positions agree with the speeds"
        lines.append(f"sampling_rate_hz: {rate:g}  # {why}")
        return _counted(look, time.source, rate), lines
    clocks = [_examined(look.path, time.source, stamps, unit.unit)]
    clocks += [_clock_of(path, look, time, unit.unit) for path in paths[1:LOOKED_AT_FILES]]
    rates = [clock.sampling_rate_hz for clock in clocks]
    first = clocks[0]
    if first.account.even:
        how = f"{first.sampling_rate_hz:g} Hz, even"
    else:
        how = (
            f"{first.account.measured_rate_hz:.4g} Hz, uneven by up to "
            f"{first.account.jitter_s * 1e3:.2g} ms"
        )
    lines = [f"{line}  # {unit.why}: {how}"]
    spread = max(rates) / min(rates) - 1
    if spread > RATE_WITHIN:
        lines.append(f"# rates differ from {min(rates):g} to {max(rates):g} Hz: too much for one")
    elif spread > 0 or not first.account.even:
        middle = float(f"{np.median(rates):.3g}")
        told = f"{min(rates):.4g} to {max(rates):.4g} Hz in {len(rates)} recordings"
        why = told if spread > 0 else "an uneven clock is another one in every recording"
        lines.append(f"resample_hz: {middle:g}  # {why}; runs of one rate can be compared")
    return first, lines


def _counted(look: _Look, source: Name, rate_hz: float) -> Clock:
    count = max(map(len, look.values.values()))
    return examine(look.path, source, np.arange(count) / rate_hz, rate_hz, 2.5)


def _time_guess(time: Meant | None, stamps: Array | None) -> Guess | None:
    if time is None or stamps is None or len(stamps) < 3:
        return None
    if stamps.dtype.kind == "M":
        return Guess("iso8601", "dates")
    if time.unit in CONVERSIONS["time"]:
        return Guess(str(time.unit), "as the file says")
    return time_unit(stamps)


def _examined(path: Path, source: Name, stamps: Array, unit: str) -> Clock:
    if stamps.dtype.kind == "M":
        seconds = (stamps - stamps[0]) / np.timedelta64(1, "us") * 1e-6
    else:
        known = conversion(unit, "time")
        seconds = (stamps - stamps[0]) * (known.factor if known else 1.0)
    return examine(path, source, seconds, None, 2.5)


def _clock_of(path: Path, look: _Look, time: Meant, unit: str) -> Clock:
    with open_source(path, _any_map(str(format_by_ending(path)), look.layout)) as source:
        return _examined(path, time.source, _values(source, time), unit)


def _angles(look: _Look) -> tuple[dict[int, Float], dict[int, Float]]:
    positions, speeds = (
        {axis: look.values[_key(channel)] for axis, channel in look.choices[kind].by_axis.items()}
        if kind in look.choices
        else {}
        for kind in ("position", "velocity")
    )
    return positions, speeds


def _column_lines(look: _Look, rate_hz: float | None) -> list[_Line]:
    positions, speeds = _angles(look)
    position, speed = angle_units(positions, speeds, rate_hz)
    every = {axis for choice in look.choices.values() for axis in choice.by_axis}
    lines: list[_Line] = []
    for kind, choice in look.choices.items():
        channels = choice.by_axis
        if not channels:
            continue
        largest = max(
            float(np.nanmax(np.abs(look.values[_key(channel)]), initial=0.0))
            for channel in channels.values()
        )
        declared, scale = next((one.unit, one.scale) for one in channels.values())
        torque = next(iter(channels.values())).quantity == "torque"
        match kind:
            case "position":
                guess = position
            case "velocity":
                guess = speed
            case _ if kind in LOGGED:
                guess = Guess(next(iter(LOGGED[kind].units)), f"largest {largest:.3g}")
            case _ if declared == "%":  # refused until somebody writes what the rated one is
                what, unit = ("torque", "Nm") if torque else ("current", "A")
                why = f"largest {largest:.3g}; per cent of a rated {what} that the file does not "
                guess = Guess('"%"', f"{why}tell: write unit: {unit}, scale: rated / 100")
            case _ if torque:
                guess = Guess("Nm", f"largest {largest:.3g}; a torque stands for the current")
            case _:
                guess = current_unit(largest)
        if declared and _fits(declared, kind):
            guess = Guess(declared, f"as the file says; largest {largest:.3g}")
        else:
            scale = 1.0
        why = guess.why
        if kind == "position" and turns(scale * largest, guess.unit) > MOST_TURNS:
            count = turns(scale * largest, guess.unit)
            why += f": {count:.3g} turns; a motor's needs scale: 1 / gear ratio"
        if choice.passed_over:
            why += f"; not {', '.join(choice.passed_over[:3])}"
        scaled = {axis: scale * values for axis, values in positions.items()}
        extra = ", unwrap: true" if kind == "position" and wraps(scaled, guess.unit) else ""
        if not look.unsigned.isdisjoint(map(_key, channels.values())):
            extra, why = ", unwrap: 65536", f"{why}; negative numbers are 65536 too large"
        extra += f", scale: {scale:g}" if scale != 1.0 else ""
        # A line for all axes asks for as many of every kind.
        all_axes = ", optional: true" if every - channels.keys() else ""
        lines += _lines_of(kind, channels, guess.unit, extra, all_axes, why)
    return lines


def _fits(unit: str, kind: str) -> bool:
    quantity = "current" if kind in CURRENTS else kind
    return conversion(unit, quantity) is not None and not (kind in "abc" and is_torque(unit))


def _lines_of(
    kind: str, channels: dict[int, Meant], unit: str, extra: str, all_axes: str, why: str
) -> list[_Line]:
    """Return one line for all axes where the sources count with them, else one for each."""
    shared: dict[tuple[str, int], list[int]] = {}
    for axis, channel in channels.items():
        # a number with zeros before it is none that {n} stands for
        counts = channel.pattern.replace("#", str(channel.number)) == channel.source
        if channel.index is None and channel.number is not None and counts:
            shared.setdefault((channel.pattern, channel.number - axis), []).append(axis)
        elif channel.index is not None:
            shared.setdefault((f"{channel.source}@", channel.index - axis), []).append(axis)
    lines: list[_Line] = []
    covered: set[int] = set()
    best = max(shared.items(), key=lambda item: len(item[1]), default=None)
    if best is not None and len(best[1]) > 1 and max(best[1]) == max(channels):
        (pattern, offset), covered_axes = best
        mark = f"{{n{offset:+d}}}" if offset else "{n}"
        covered = set(covered_axes)
        if pattern.endswith("@"):
            where = f"source: {_quoted(pattern[:-1])}, index: {mark}"
        else:
            where = f"source: {_quoted(pattern.replace('#', mark))}"
        text = f"axis{{n}}_{kind}: {{{where}, unit: {unit}{extra}{all_axes}}}"
        lines.append(_Line(kind, text, why))
    for axis, channel in channels.items():
        if axis not in covered:
            index = "" if channel.index is None else f", index: {channel.index}"
            text = f"axis{axis}_{kind}: {{source: {_quoted(channel.source)}{index}"
            lines.append(_Line(kind, f"{text}, unit: {unit}{extra}}}", why))
    return lines


def _key(channel: Meant) -> Name | tuple[Name, int]:
    return channel.source if channel.index is None else (channel.source, channel.index)


def _quoted(name: Name) -> str:
    """Return a name as YAML takes it within braces."""
    text = str(name)
    if isinstance(name, int) or re.fullmatch(r"[A-Za-z_/][\w/. {}+-]*\w|[A-Za-z_]|[\w{}+-]+", text):
        return text
    return json.dumps(text, ensure_ascii=False)


def _shortened(names: Sequence[str]) -> str:
    shown = ", ".join(names[:10])
    return f"{shown} and {len(names) - 10} more" if len(names) > 10 else shown


def _started_at(look: _Look) -> list[str]:
    kind = format_by_ending(look.path)
    own = {"ros": "@started_at", "mdf": "@start_time"}.get(str(kind))
    stamps = look.values.get(look.time.source) if look.time else None
    if own is None and look.time is not None and stamps is not None and len(stamps):
        unit = _time_guess(look.time, stamps)
        is_date = stamps.dtype.kind == "M"
        if is_date or (unit is not None and date_s(float(stamps[0]), unit.unit) is not None):
            own = str(look.time.source)
    return [f"  started_at: {{source: {_quoted(own)}}}"] if own else []
