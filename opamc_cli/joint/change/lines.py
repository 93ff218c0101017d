"""Order spectra of units, stroke by stroke, and the lines that grew."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from opamc_cli.decision.significance.moderated import moderated_t
from opamc_cli.joint.change.slow import Shift, shift_current
from opamc_cli.joint.change.units import Compared, own_fit, stretches
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.track import Bools, Floats, Track
from opamc_cli.joint.spectra import FEWEST_SAMPLES, LOWEST_ORDER, highest_order
from opamc_cli.signal.transform.angle_bins import OVERSAMPLING, AngleBins, vertex

SHORTEST_STROKE = 0.4
"""Cycles of the lowest order that is looked for: a turn of the motor."""

LARGEST_P = 5e-3
SMALLEST_RATIO = 2.0
"""A line has to hold twice its power in the baseline, and twice its neighbours' growth."""
SIDE_LOBES = 4.0
NEIGHBOURHOOD = 12
"""Resolutions to either side over which the growth of the neighbours is taken."""
FLOOR = 3.0
"""Of the surroundings' power, added to all of a tapered spectrum: without it noise's scatter would
be the measure of what lies far above it."""
MAIN_LOBES = 1.5, 2.5
"""Resolutions to either side that a line takes, with what a lag makes of it; of tapered strokes."""


@dataclass(frozen=True)
class OrderSpectra:
    """Power over order, one row per unit, on one grid."""

    orders: Floats
    """Cycles per revolution of the machine angle; (k,)."""
    before: Floats
    after: Floats
    """With `before`: mean power per sample, summed coherently within strokes only: phases alone
    know no zero of the angle, and the velocity loop turns the phase with the speed; s of shape
    (units, k)."""
    resolution: float
    """Smallest difference of orders that the usual stroke can tell apart."""
    tapered: bool = False


@dataclass(frozen=True)
class Line:
    """A line that grew."""

    order: float
    error: float
    """With `order`: with its standard error over units."""
    new: bool
    """Whether the baseline has none there."""
    growth: float
    """Ratio of the powers."""
    excess: float
    """Difference of the powers."""
    p_value: float
    """Corrected for the number of orders."""


def fast_residuals(compared: Compared, terms: tuple[Term, ...], shift: Shift | None) -> Floats:
    """Residual of every unit's own fit on the full grid, (n,); zero where samples do not count.

    Slow effects, the `shift`, are taken from the target's current first.
    """
    dataset, track = compared.dataset, compared.track
    taken = shift_current(compared, shift)
    coefficients = own_fit(compared, terms, True, taken)[0]
    columns = [dataset.columns(term, True) for term in terms]
    columns += [] if track.blur is None else [track.blur]
    fitted = np.einsum("nk,nk->n", np.concatenate(columns, axis=1), coefficients[track.group])
    current = track.current_a if taken is None else track.current_a - taken
    return np.where(dataset.fine.fit, current - fitted, 0.0)


def clocked(compared: Compared) -> Compared:
    """Let time turn the machine, once a second: its orders are then frequencies in Hz."""
    fine = compared.dataset.fine
    turns = 2 * np.pi * fine.track.run_time_s
    track = replace(fine.track, machine_angle_rad=turns, angle_kind="joint")
    return replace(compared, dataset=replace(compared.dataset, fine=replace(fine, track=track)))


def strokes(track: Track, rows: Bools) -> list[tuple[int, int]]:
    """Half-open stretches of motion in one direction and one group, long enough to count orders."""
    # Where the motion is logged, samples that do not count, at a corner of the acceleration say, do
    # not end a stroke: the angle is known on both sides of them.
    logged = "logged" in track.channels
    side = track.direction if logged else np.where(rows, track.direction, 0.0)
    shortest_rad = SHORTEST_STROKE * 2 * np.pi / LOWEST_ORDER[track.angle_kind]
    found = []
    for first, last in stretches(side, track.group):
        counted = first + np.flatnonzero(rows[first:last])
        if side[first] == 0 or not counted.size:
            continue
        start, stop = int(counted[0]), int(counted[-1]) + 1
        travel = np.ptp(track.machine_angle_rad[start:stop])
        if stop - start >= FEWEST_SAMPLES and travel >= shortest_rad:
            found.append((start, stop))
    return found


def order_spectra(compared: Compared, residual: Floats, tapered: bool = False) -> OrderSpectra:
    """Spectra of all units on one grid of orders; of none where too few strokes are long enough.

    Untapered, jumps at a stroke's ends leak over all orders, far above worn teeth; tapered, what is
    too faint to explain a change is seen as well.
    """
    track, after = compared.track, compared.after
    pieces = strokes(track, residual != 0)
    travels = [float(np.ptp(track.machine_angle_rad[start:stop])) for start, stop in pieces]
    top = highest_order(track)
    none = OrderSpectra(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)), np.inf)
    if not pieces or top <= 0:
        return none
    bins = AngleBins.of(max(travels), top)
    # long strokes carry the energy: their resolution is what the sum has
    resolution = 2 * np.pi / float(np.average(travels, weights=travels))
    lowest = max(LOWEST_ORDER[track.angle_kind], 3 * resolution)
    first = int(np.searchsorted(bins.orders, lowest))
    power, samples = np.zeros((after.size, bins.orders.size)), np.zeros(after.size)
    for start, stop in pieces:
        unit, angle = track.group[start], track.machine_angle_rad[start:stop]
        power[unit] += bins.power(angle - angle.min(), residual[start:stop], tapered)
        samples[unit] += np.count_nonzero(residual[start:stop])
    rows = power[:, first:] / np.maximum(samples, 1.0)[:, None]
    before, later = rows[~after & (samples > 0)], rows[after & (samples > 0)]
    if len(before) < 2 or not len(later):
        return none
    return OrderSpectra(bins.orders[first:], before, later, resolution, tapered)


def grown_lines(spectra: OrderSpectra, between: float = 0.0, most: int = 6) -> list[Line]:
    """Lines of the target that lie outside what the baseline's units differ by, largest first.

    Where the units are cycles of one session, `between` is the variance of the logarithm of a
    line's power that is added to what they show.
    """
    orders = spectra.orders
    if orders.size < 2 * NEIGHBOURHOOD:
        return []
    spacing = float(orders[1] - orders[0])
    around = 2 * int(NEIGHBOURHOOD * spectra.resolution / spacing) + 1
    usual = spectra.before.mean(axis=0)
    floor = FLOOR * median_filter(usual, around) if spectra.tapered else 1e-12 * usual.mean()
    floor = floor + 1e-300
    sides = [uniform_filter1d(one, OVERSAMPLING, axis=1) for one in (spectra.before, spectra.after)]
    before, after = (np.log(side + floor) for side in sides)
    shares = np.mean(
        [(one.mean(axis=0) / (one.mean(axis=0) + floor)) ** 2 for one in sides], axis=0
    )
    _, p_values = moderated_t(before, after, between * shares)
    trials = max((orders[-1] - orders[0]) / spectra.resolution, 1.0)
    p_values = np.minimum(p_values * trials, 1.0)
    growth = after.mean(axis=0) - before.mean(axis=0)
    guard = max(int(1.5 * spectra.resolution / spacing), OVERSAMPLING)
    excess = np.exp(after.mean(axis=0)) - np.exp(before.mean(axis=0))
    doubled = np.minimum(growth, growth - median_filter(growth, around)) > np.log(SMALLEST_RATIO)
    possible = (p_values < LARGEST_P) & doubled
    found: list[Line] = []
    while len(found) < most and possible.any():
        peak = int(np.argmax(np.where(possible, excess, -np.inf)))
        away = np.abs(orders - orders[peak]) / spectra.resolution
        # a finite stroke smears a line: its side lobes are no lines of their own
        lobes = excess[peak] * SIDE_LOBES / (np.pi * np.maximum(away, 1.0)) ** 2
        possible &= (away > MAIN_LOBES[spectra.tapered]) & (excess > lobes)
        found.append(_line(spectra, peak, guard, growth[peak], excess[peak], p_values[peak]))
    return found


def power_at(spectra: OrderSpectra, order: float) -> tuple[float, float]:
    """Excess and growth of the power next to an order, where the excess is largest."""
    near = np.abs(spectra.orders - order) <= spectra.resolution
    sides = (spectra.before[:, near], spectra.after[:, near])
    before, after = (np.exp(np.log(side + 1e-300).mean(axis=0)) for side in sides)
    most = int(np.argmax(after - before))
    return float((after - before)[most]), float((after / before)[most])


def _line(
    spectra: OrderSpectra, peak: int, guard: int, growth: float, excess: float, p_value: float
) -> Line:
    near = slice(max(peak - guard, 0), peak + guard + 1)
    orders = spectra.orders[near]
    after, before = (
        np.array([vertex(orders, row[near], int(np.argmax(row[near]))) for row in rows])
        for rows in (spectra.after, spectra.before)
    )
    error = float(np.std(after, ddof=1)) if after.size > 1 else 0.1 * spectra.resolution
    error = max(error, 0.05 * spectra.resolution) / np.sqrt(after.size)
    return Line(
        order=float(after.mean()),
        error=error,
        # The baseline has a line here if its units, two at least, agree where it is.
        new=float(np.std(before, ddof=1)) >= 0.25 * spectra.resolution,
        growth=float(np.exp(growth)),
        excess=float(excess),
        p_value=float(p_value),
    )
