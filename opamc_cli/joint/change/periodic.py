"""Which periodic effect grew: over the motor angle, over time, or in the frame of the phases."""

from dataclasses import replace

from opamc_cli.joint.change.energy import comb_energy
from opamc_cli.joint.change.lines import Line, clocked, grown_lines, order_spectra, power_at
from opamc_cli.joint.change.reading import Reading, read_frequency, read_lines
from opamc_cli.joint.change.units import Compared
from opamc_cli.joint.motion.track import Floats
from opamc_cli.joint.spectra import standing_views

STANDING = 0.7
"""A ripple that is turned back to the phases' frame keeps half of its line there at most; what one
phase picks up has as much in that frame as in either of its two lines over the motor angle."""


def find_periodic(compared: Compared, residual: Floats, between: float = 0.0) -> Reading | None:
    """Read the lines that grew; None where none did, or one keeps a frequency not the mains'."""
    spectra = order_spectra(compared, residual)
    lines = grown_lines(spectra, between)
    if not lines:
        return None
    timed = clocked(compared)
    hum, standing = _picked_up(timed, residual, lines[0], between)
    if hum is not None:
        return hum
    # What has grown, and what keeps an order, is asked of strokes with their ends: there the speed
    # changes, and beside them cold lets faint harmonics of a healthy mesh grow tenfold.
    whole = order_spectra(compared, residual, tapered=False)
    lines = [replace(line, growth=power_at(whole, line.order)[1]) for line in lines]
    reading = read_lines(lines, compared.track, spectra.resolution)
    if reading.kind == "unknown":
        # An order that means nothing may be a frequency: hum, or a structure that rings.
        clock = order_spectra(timed, residual)
        beats = grown_lines(clock, between)
        ends = order_spectra(timed, residual, tapered=False)
        if beats and power_at(ends, beats[0].order)[0] > power_at(whole, lines[0].order)[0]:
            at = read_frequency(beats[0], clock.resolution)
            return None if at is None or standing else _with_power(at, timed, residual)
    return _with_power(reading, compared, residual)


def _with_power(reading: Reading, compared: Compared, *residuals: Floats) -> Reading:
    held = [comb_energy(compared, one, reading.fundamental) for one in residuals]
    return replace(reading, power=sum(held))


def _picked_up(
    timed: Compared, residual: Floats, strongest: Line, between: float
) -> tuple[Reading | None, bool]:
    """Mains hum of a phase, which turns against the field, and whether any frequency does."""
    sides = dict(standing_views(timed.track, residual)).get(True)
    if sides is None:
        return None, False
    one, other = (order_spectra(timed, side) for side in sides)
    spectra = replace(one, before=one.before + other.before, after=one.after + other.after)
    beats = grown_lines(spectra, between)
    if not beats or beats[0].excess < STANDING * strongest.excess:
        return None, False
    reading = read_frequency(beats[0], spectra.resolution)
    if reading is None:
        return None, True
    # Half of it is there; the other half turns twice as fast as the field.
    held = _with_power(reading, timed, *sides)
    return replace(held, power=2 * held.power), True
