"""How much of the current changed beyond what sessions differ by, and how much causes explain."""

import numpy as np

from opamc_cli.joint.change.lines import strokes
from opamc_cli.joint.change.slow import Population, Shift, shift_current
from opamc_cli.joint.change.units import Compared, own_fit
from opamc_cli.joint.motion.track import Floats
from opamc_cli.joint.spectra import highest_order
from opamc_cli.signal.transform.least_squares import solve

MOST_HARMONICS = 4
KNOTS = 6
"""A ripple's size and phase follow speed and load along a stroke: this many values of each."""

CLEAR = 2.5
"""Baseline standard deviations by which a mean square must differ to count as changed."""


def energy_of(
    compared: Compared, population: Population, shift: Shift | None = None
) -> tuple[float, float]:
    """Change of the mean square residual, after a shift, if given, is taken from the target.

    First in the declared effects' coefficients (what the baseline's mean model leaves more in the
    target than a unit's own fit, less the same in the baseline), then in the residual of every
    unit's own fit; both in A^2.
    """
    after = compared.after
    sums = compared.sums(population.terms, True, shift_current(compared, shift))
    counts = sums.parts.counts
    left = sums.left(solve(sums.gram, sums.moment)) / counts
    mean = np.zeros(sums.moment.shape[1])
    mean[: population.mean.size] = population.mean
    moved = np.maximum(sums.left(mean) / counts - left, 0.0)
    n = int(np.count_nonzero(~after))
    # A baseline unit is a part of the mean that it is compared with.
    fair = (n + 1) / max(n - 1, 1)
    slow = float(np.mean(moved[after]) - fair * np.mean(moved[~after]))
    spread = max(float(np.std(left[~after], ddof=1)), 0.05 * float(np.median(left[~after])))
    fast = float(np.median(left[after]) - np.median(left[~after]))
    clear = fast > CLEAR * spread * np.sqrt(1 / n + 1 / np.count_nonzero(after))
    return max(slow, 0.0), fast if clear else 0.0


def rest_growth(compared: Compared, population: Population, shift: Shift | None) -> float:
    """By which factor the share of the current that neither model nor shift holds has grown.

    Of the equally smooth current's mean square, corners and reversals with it: there a loose joint
    knocks, which a fit to clear samples never sees.
    """
    taken = shift_current(compared, shift, fine=False)
    left = own_fit(compared, population.terms, taken=taken)[1]
    sums = compared.sums(())
    shares, after = left * sums.parts.counts / sums.power, compared.after
    return float(np.median(shares[after])) / max(float(np.median(shares[~after])), 1e-300)


def comb_energy(compared: Compared, residual: Floats, fundamental: float) -> float:
    """Mean square that a ripple and its harmonics hold more in the target, A^2.

    Every stroke has its own amplitudes and phases, which follow its course; what such a comb
    takes from the baseline's noise and kinematic error is taken off.
    """
    track, after = compared.track, compared.after
    top = highest_order(track)
    orders = [k * fundamental for k in range(1, MOST_HARMONICS + 1) if k * fundamental < top]
    held = np.zeros(after.size)
    for start, stop in strokes(track, compared.dataset.fine.fit):
        rows = start + np.flatnonzero(compared.dataset.fine.fit[start:stop])
        angle = track.machine_angle_rad[rows]
        knots = np.linspace(float(angle.min()), float(angle.max()), KNOTS)
        weights = np.stack([np.interp(angle, knots, one) for one in np.eye(KNOTS)], axis=1)
        for order in orders:
            waves = weights * np.exp(1j * order * angle)[:, None]
            columns = np.concatenate([waves.real, waves.imag], axis=1)
            gram, moment = columns.T @ columns, columns.T @ residual[rows]
            held[track.group[start]] += moment @ np.linalg.lstsq(gram, moment, rcond=1e-9)[0]
    held /= compared.dataset.fine.parts.counts
    return max(float(np.median(held[after]) - np.median(held[~after])), 0.0)
