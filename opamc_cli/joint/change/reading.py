"""What lines over the motor angle mean that the target has and the baseline has not."""

import math
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from opamc_cli.decision.measurement.gear import passing_rollers
from opamc_cli.joint.change.lines import Line
from opamc_cli.joint.effects.base import Parameters
from opamc_cli.joint.effects.mains_hum import MAINS_HZ, MainsHum
from opamc_cli.joint.effects.ripple import OF_A_SENSOR, SMALLEST_RATIO, read_order
from opamc_cli.joint.motion.track import Track

HARMONICS = 12
SHORTEST_COMB = 3
PASSAGES = (2, 4)
"""Without a line at one of these per turn of the wave generator, or at a higher one that the
flexspline's slow turning moves away from the whole number, no comb is the mesh's."""

USUAL_POLE_PAIRS = range(2, 13)
USUAL_RATIO = 100.0
"""Gear ratio assumed where none is known."""

MAINS_HARMONICS = 6
CIRCULAR_BELOW = 0.5
"""Lines surely nearer to whole orders (0) than to the flexspline's (1) are read as whole ones."""

SIDE_RESOLUTIONS = 4.0
"""A damaged mesh has play that the load closes: as the load changes along a stroke, the line of
its passage is spread over its neighbourhood."""

BEARING = (
    "a bearing of the wave generator, {:.4g} rolling elements a turn under a load that its lobes "
    "bring twice: inspect the wave generator and its bearing"
)
FLEXSPLINE = "flexspline tooth damage (2(N+1)/N): inspect the flexspline"
EITHER = (
    "kinematic error, twice per wave generator turn, that has grown, or flexspline tooth damage "
    "(2(N+1)/N): inspect wave generator and flexspline"
)
KINEMATIC_TIE = "kinematic error of the wave generator (order 2), which does not grow by itself"
FLEXSPLINE_TIE = "flexspline tooth damage (order 2(N+1)/N)"


@dataclass(frozen=True, kw_only=True)
class Cause:
    """An effect that the target has and the baseline has not, or has less of."""

    effect: str
    """Name in the library."""
    parameters: Parameters
    """Non-linear parameters; orders are per revolution of the track's machine angle."""
    interpretation: str
    """What it means to a maintainer."""
    p_value: float
    """Probability with which healthy units show as much, corrected for what was tried."""
    ties: tuple[str, ...]
    """Effects or readings that explain the change as well."""
    evidence: Parameters = field(default_factory=dict)
    """What was measured, by name."""
    domain: str = ""
    origin: str = "joint"
    """With `domain`: the effect's. "joint", or "environment", "load", "measurement", which are no
    fault of it."""
    share: float = 0.0
    """Share of the change of the current's mean square beyond the sessions' own differences that it
    explains, 0 to 1."""
    serious: bool = False
    """True where it is the joint's and large enough to be called a fault whatever else changed."""
    clear: bool = False
    """True where nothing that all joints have in common could look like it."""

    @property
    def harmless(self) -> bool:
        """Whether the joint is no worse for it."""
        return self.origin != "joint"


@dataclass(frozen=True, kw_only=True)
class Reading(Cause):
    """What the lines say."""

    lines: tuple[Line, ...]
    """Those that belong to it."""
    fundamental: float
    """Order, or frequency, whose harmonics are the comb."""
    kind: str
    """As that of `OrderMeaning`; or "mesh", the wave generator's passage over the teeth, or
    "mains"."""
    power: float = 0.0
    """Mean square that it holds more in the target than in the baseline, A^2."""


def read_lines(lines: list[Line], track: Track, resolution: float) -> Reading:
    """Read the lines that grew, strongest first; a stroke tells orders `resolution` apart."""
    other = read_line(lines[0], track, resolution)
    if other.kind in OF_A_SENSOR or 0 < (track.joint.gear_ratio or 0.0) < SMALLEST_RATIO:
        return other
    rolling = _rolling(lines, track, resolution)
    if rolling is not None:
        return rolling
    poles, comb = _comb(lines, resolution)
    if comb and track.angle_kind == "electrical":
        return _wave_generator(comb, track, resolution, poles)
    for poles in _turns(track, lines[0]):
        wave = [line for line in lines if _family(line, poles, track, resolution)]
        passages = [line for line in wave if _passage(line, poles, track, resolution)]
        # One line is enough if it is the strongest; a comb speaks for itself.
        if lines[0] in passages or (passages and len(wave) >= SHORTEST_COMB):
            return _wave_generator(wave, track, resolution, poles)
    return other


def _rolling(lines: list[Line], track: Track, resolution: float) -> Reading | None:
    """Read the strongest line of the motor's angle that is new as a bearing's, if it may be."""
    new = [line for line in lines if line.new and track.angle_kind == "motor"]
    ratio = track.joint.gear_ratio
    pair = passing_rollers([line.order for line in new], resolution, ratio)
    if pair is None or 0 not in pair:
        return None
    read = read_line(new[0], track, resolution)
    return replace(read, interpretation=BEARING.format(read.fundamental), kind="bearing")


def read_frequency(line: Line, resolution_hz: float) -> Reading | None:
    """Read a line whose order is a frequency in Hz; None where nobody knows its source."""
    multiples = [mains * k for mains in MAINS_HZ for k in range(1, MAINS_HARMONICS + 1)]
    mains = min(multiples, key=lambda frequency: abs(frequency - line.order))
    if abs(line.order - mains) > resolution_hz:
        return None
    return Reading(
        effect="mains_hum",
        parameters={"frequency_hz": mains},
        interpretation=MainsHum.meaning,
        p_value=line.p_value,
        ties=(),
        evidence={
            "measured_frequency_hz": line.order,
            "frequency_resolution_hz": resolution_hz,
            "power_ratio": line.growth,
        },
        lines=(line,),
        fundamental=line.order,
        kind="mains",
    )


def _turns(track: Track, line: Line) -> list[float]:
    """Revolutions of the track's machine angle per turn of the motor, as far as they are known."""
    if track.angle_kind == "motor":
        return [1.0]
    if track.angle_kind == "electrical":
        # The first line is the strongest: once or twice it is two per turn of the motor.
        return [float(p) for p in USUAL_POLE_PAIRS if 1.9 < line.order * p < 2.1]
    return []


def _comb(lines: list[Line], resolution: float) -> tuple[float, list[Line]]:
    """Pole pairs and comb, of the strongest and two more, whose line at 2 need not show."""
    best: tuple[float, list[Line]] = (1.0, [])
    slack = 0.25 * resolution
    for k, poles in product(range(1, HARMONICS // 2 + 1), USUAL_POLE_PAIRS):
        first, held = lines[0].order / k, dict[int, Line]()
        for line in lines:
            times = round(line.order / first)
            if times and abs(line.order - times * first) < slack * max(times / k, 1.0):
                held.setdefault(times, line)
        twice = 2 - slack * poles < first * poles < 2 * (1 + 1 / SMALLEST_RATIO) + slack
        if twice and len(held) >= max(len(best[1]) + 1, SHORTEST_COMB) and math.gcd(*held) == 1:
            best = float(poles), list(held.values())
    return best


def _error(line: Line, poles: float, resolution: float) -> float:
    """Give an order's standard error; a changing load moves it a quarter of the resolution."""
    return poles * math.hypot(line.error, 0.25 * resolution)


def _near(line: Line, poles: float, track: Track, slack: float) -> int | None:
    """Whole number of cycles per turn of the wave generator, in either frame, if there is one."""
    order = line.order * poles
    ratio = track.joint.gear_ratio or SMALLEST_RATIO
    for k in range(1, HARMONICS + 1):
        if k - slack < order < k * (1 + 1 / ratio) + slack:
            return k
    return None


def _family(line: Line, poles: float, track: Track, resolution: float) -> bool:
    """Whether a line may come from the mesh: near twice per turn, or a sharp multiple of it."""
    wide = min(SIDE_RESOLUTIONS * resolution * poles, 0.25)
    sharp = min(0.75 * resolution * poles, 0.25)
    return _near(line, poles, track, wide) == 2 or (_near(line, poles, track, sharp) or 0) >= 2


def _passage(line: Line, poles: float, track: Track, resolution: float) -> bool:
    """Whether a line can only be the mesh's: not so one at 6, say, that may be the motor's."""
    k = _near(line, poles, track, min(SIDE_RESOLUTIONS * resolution * poles, 0.25))
    of_sensors = (track.joint.pole_pairs or 0) * ("phases" in track.channels)
    if k in PASSAGES:
        return k == 2 or k not in (of_sensors, 2 * of_sensors)
    if k is None or k % 2 or track.joint.gear_ratio is None:
        return False
    sharp = 0.75 * resolution * poles
    order, turned = line.order * poles, k / track.joint.gear_ratio
    return abs(order - k - turned) < sharp < abs(order - k)


def _wave_generator(lines: list[Line], track: Track, resolution: float, poles: float) -> Reading:
    ratio = track.joint.gear_ratio
    place, doubt = _frame(lines, track, resolution, poles)
    first = ([line for line in lines if abs(line.order * poles - 2.0) < 0.25] or lines)[0]
    cycles = _near(first, poles, track, 0.25) or 2
    measured = 2 * first.order * poles / cycles
    # What grows between two recordings is rather damage: in doubt the flexspline is named first.
    if place + doubt > CIRCULAR_BELOW:
        interpretation = FLEXSPLINE
        ties = () if place - 2 * doubt > 0 else (KINEMATIC_TIE,)
        order = 2 * (ratio + 1) / ratio if ratio else measured
    else:
        interpretation, ties, order = EITHER, (FLEXSPLINE_TIE,), 2.0
    if track.angle_kind == "electrical":
        interpretation += f" (order {measured:.4g} per motor turn if it has {poles:.0f} pole pairs)"
    evidence = _evidence(first, measured / poles, resolution)
    evidence["power_ratio"] = max(line.growth for line in lines)
    return Reading(
        effect="ripple",
        parameters={"order": order / poles},
        interpretation=interpretation,
        p_value=min(line.p_value for line in lines),
        ties=ties,
        evidence=evidence,
        lines=tuple(lines),
        fundamental=order / poles,
        kind="mesh",
    )


def _evidence(line: Line, order: float, resolution: float) -> Parameters:
    return {
        "measured_order": order,
        "order_error": _error(line, 1.0, resolution),
        "order_resolution": resolution,
        "power_ratio": line.growth,
    }


def _frame(lines: list[Line], track: Track, resolution: float, poles: float) -> tuple[float, float]:
    """Where lines lie from the circular spline's orders (0) to the flexspline's (1); its error."""
    ratio = track.joint.gear_ratio or USUAL_RATIO
    places, weights = [], []
    for line in lines:
        k = _near(line, poles, track, min(0.75 * resolution * poles, 0.25))
        if k is not None:
            apart = k / ratio
            places.append((line.order * poles - k) / apart)
            # the lag that moves a line grows with its frequency
            error = _error(line, poles, resolution) * max(k / 2, 1.0)
            weights.append((apart / error) ** 2)
    if not places:
        return 0.5, math.inf
    return float(np.average(places, weights=weights)), float(1 / np.sqrt(np.sum(weights)))


def _meant(order: float, track: Track, resolution: float) -> float:
    """Nearest order that has a meaning of its own within what a stroke can tell apart."""
    if track.angle_kind != "motor":
        return order
    poles = track.joint.pole_pairs
    named = [1.0, 2.0, 4.0] + ([] if poles is None else [poles, 2.0 * poles, 6.0 * poles])
    nearest = min(named, key=lambda meant: abs(meant - order))
    return nearest if abs(nearest - order) < 0.75 * resolution else order


def read_line(line: Line, track: Track, resolution: float) -> Reading:
    """Read a line by itself, which is not taken for the mesh's."""
    meaning = read_order(_meant(line.order, track, resolution), track)
    effect, text = "ripple", meaning.text
    if meaning.kind in OF_A_SENSOR and "phases" in track.channels:
        effect = OF_A_SENSOR[meaning.kind]
        text += " (the drive's current measurement, not the gear)"
    return Reading(
        effect=effect,
        parameters={"order": line.order},
        interpretation=text,
        p_value=line.p_value,
        ties=() if effect == "ripple" else ("ripple",),
        evidence=_evidence(line, line.order, resolution),
        lines=(line,),
        fundamental=line.order,
        kind=meaning.kind,
    )
