"""The map that is guessed for recordings, as text for their user to look at and correct."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.formats import format_by_ending
from opamc_cli.storage.ingest.guess.look import (
    Look,
    any_map,
    key_of,
    look_at,
    time_guess,
    values_of,
)
from opamc_cli.storage.ingest.guess.names import Meant
from opamc_cli.storage.ingest.guess.values import (
    MOST_TURNS,
    Float,
    Guess,
    angle_units,
    current_unit,
    rate_from_speed,
    turns,
    wraps,
)
from opamc_cli.storage.ingest.map.units import conversion, date_s, is_torque
from opamc_cli.storage.ingest.opening import open_source
from opamc_cli.storage.ingest.source import Array, Name
from opamc_cli.storage.ingest.time.stamps import RATE_WITHIN, Clock, examine
from opamc_cli.storage.schemas.channels import CURRENTS, LOGGED

LOOKED_AT_FILES = 20
"""Recordings whose rate is looked at."""


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
    look = look_at(paths[0], encoding)
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


def _program_line(look: Look) -> str:
    if look.program is None:
        return "  program:  # such as pick; runs of different programs are not compared"
    why = "its first row's; runs of different programs are not compared"
    return f"  program: {{source: {_quoted(look.program)}}}  # {why}"


def _differ_by_axis(paths: Sequence[Path]) -> bool:
    """Return whether names of files differ by the number of a joint alone, as `n06_axis2.csv`."""
    number = re.compile(r"((?:axis|achse|joint|motor|(?<![a-z])[aj])[ _.\-]*)[0-9]+", re.I)
    kinds = {number.sub(r"\1#", path.stem) for path in paths}
    return len({path.stem for path in paths}) > 1 and len(kinds) == 1


def _layout_lines(look: Look) -> list[str]:
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


def _clock_lines(look: Look, paths: Sequence[Path]) -> tuple[Clock | None, list[str]]:
    """Return the first recording's clock, None where its rate is not known, and its lines."""
    time = look.time
    stamps = look.values.get(time.source) if time is not None else None
    unit = time_guess(time, stamps)
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


def _counted(look: Look, source: Name, rate_hz: float) -> Clock:
    count = max(map(len, look.values.values()))
    return examine(look.path, source, np.arange(count) / rate_hz, rate_hz, 2.5)


def _examined(path: Path, source: Name, stamps: Array, unit: str) -> Clock:
    if stamps.dtype.kind == "M":
        seconds = (stamps - stamps[0]) / np.timedelta64(1, "us") * 1e-6
    else:
        known = conversion(unit, "time")
        seconds = (stamps - stamps[0]) * (known.factor if known else 1.0)
    return examine(path, source, seconds, None, 2.5)


def _clock_of(path: Path, look: Look, time: Meant, unit: str) -> Clock:
    with open_source(path, any_map(str(format_by_ending(path)), look.layout)) as source:
        return _examined(path, time.source, values_of(source, time), unit)


def _angles(look: Look) -> tuple[dict[int, Float], dict[int, Float]]:
    positions, speeds = (
        {axis: look.values[key_of(channel)] for axis, channel in look.choices[kind].by_axis.items()}
        if kind in look.choices
        else {}
        for kind in ("position", "velocity")
    )
    return positions, speeds


def _column_lines(look: Look, rate_hz: float | None) -> list[_Line]:
    positions, speeds = _angles(look)
    position, speed = angle_units(positions, speeds, rate_hz)
    every = {axis for choice in look.choices.values() for axis in choice.by_axis}
    lines: list[_Line] = []
    for kind, choice in look.choices.items():
        channels = choice.by_axis
        if not channels:
            continue
        largest = max(
            float(np.nanmax(np.abs(look.values[key_of(channel)]), initial=0.0))
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
        if not look.unsigned.isdisjoint(map(key_of, channels.values())):
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


def _quoted(name: Name) -> str:
    """Return a name as YAML takes it within braces."""
    text = str(name)
    if isinstance(name, int) or re.fullmatch(r"[A-Za-z_/][\w/. {}+-]*\w|[A-Za-z_]|[\w{}+-]+", text):
        return text
    return json.dumps(text, ensure_ascii=False)


def _shortened(names: Sequence[str]) -> str:
    shown = ", ".join(names[:10])
    return f"{shown} and {len(names) - 10} more" if len(names) > 10 else shown


def _started_at(look: Look) -> list[str]:
    kind = format_by_ending(look.path)
    own = {"ros": "@started_at", "mdf": "@start_time"}.get(str(kind))
    stamps = look.values.get(look.time.source) if look.time else None
    if own is None and look.time is not None and stamps is not None and len(stamps):
        unit = time_guess(look.time, stamps)
        is_date = stamps.dtype.kind == "M"
        if is_date or (unit is not None and date_s(float(stamps[0]), unit.unit) is not None):
            own = str(look.time.source)
    return [f"  started_at: {{source: {_quoted(own)}}}"] if own else []
