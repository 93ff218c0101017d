"""Which periodic effect grew: over the motor angle, over time, or in the frame of the phases."""

from dataclasses import replace

from opamc_cli.joint.change.energy import comb_energy
from opamc_cli.joint.change.lines import (
    Line,
    OrderSpectra,
    clocked,
    grown_lines,
    order_spectra,
    power_at,
)
from opamc_cli.joint.change.reading import Reading, read_frequency, read_lines
from opamc_cli.joint.change.units import Compared
from opamc_cli.joint.motion.track import Floats
from opamc_cli.joint.spectra import standing_views

OF_THE_GEAR = ("mesh", "bearing")
STANDING = 0.7
"""A ripple that is turned back to the phases' frame keeps half of its line there at most; what one
phase picks up has as much in that frame as in either of its two lines over the motor angle."""


def find_periodic(compared: Compared, residual: Floats, between: float = 0.0) -> list[Reading]:
    """Read the lines that grew; of two readings of one change the first names it best.

    Only a mesh may be blamed for what no more than tapered strokes show: what excuses a joint, and
    what nobody can name, has to stand out of whole ones.
    """
    whole = order_spectra(compared, residual)
    plain = _read(compared, residual, between, whole, whole)
    if plain is not None and plain.effect != "ripple":
        return [plain]
    faint = _read(compared, residual, between, whole, order_spectra(compared, residual, True))
    if faint is not None and faint.kind in OF_THE_GEAR:
        return [faint] if plain is None else [faint, plain]
    return [] if plain is None else [plain]


def _read(
    compared: Compared, residual: Floats, between: float, whole: OrderSpectra, spectra: OrderSpectra
) -> Reading | None:
    """None where no line grew, or one keeps a frequency that is not the mains'."""
    lines = grown_lines(spectra, between)
    if not lines:
        return None
    if spectra.tapered:
        # How much has grown, and whether an order or a frequency is kept, is asked of strokes with
        # their ends: there the speed changes, and beside them cold lets faint harmonics of a
        # healthy mesh grow tenfold.
        powers = [(line, *power_at(whole, line.order)) for line in lines]
        lines = [replace(line, excess=more, growth=growth) for line, more, growth in powers]
    timed = clocked(compared)
    hum = _picked_up(timed, residual, lines[0], between)
    if hum is not None:
        return hum
    reading = read_lines(lines, compared.track, spectra.resolution)
    if reading.kind == "unknown":
        # An order that means nothing may be a frequency: hum, or a structure that rings.
        clock = order_spectra(timed, residual)
        beats = grown_lines(clock, between)
        if beats and beats[0].excess > lines[0].excess:
            at = read_frequency(beats[0], clock.resolution)
            return None if at is None else _with_power(at, timed, residual)
    return _with_power(reading, compared, residual)


def _with_power(reading: Reading, compared: Compared, *residuals: Floats) -> Reading:
    held = [comb_energy(compared, one, reading.fundamental) for one in residuals]
    return replace(reading, power=sum(held))


def _picked_up(
    timed: Compared, residual: Floats, strongest: Line, between: float
) -> Reading | None:
    """Mains hum of a phase, which turns against the field in the torque current."""
    sides = dict(standing_views(timed.track, residual)).get(True)
    if sides is None:
        return None
    one, other = (order_spectra(timed, side) for side in sides)
    spectra = replace(one, before=one.before + other.before, after=one.after + other.after)
    beats = grown_lines(spectra, between)
    if not beats or beats[0].excess < STANDING * strongest.excess:
        return None
    reading = read_frequency(beats[0], spectra.resolution)
    if reading is None:
        return None
    # Half of it is there; the other half turns twice as fast as the field.
    held = _with_power(reading, timed, *sides)
    return replace(held, power=2 * held.power)
