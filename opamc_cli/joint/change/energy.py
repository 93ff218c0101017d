"""How much of the current changed beyond what sessions differ by, and how much causes explain."""

import numpy as np

from opamc_cli.joint.change.lines import strokes
from opamc_cli.joint.change.slow import Population, Shift, shift_current
from opamc_cli.joint.change.units import Compared, own_fit
from opamc_cli.joint.motion.track import Floats
from opamc_cli.joint.spectra import highest_order

MOST_HARMONICS = 4
KNOTS = 6
"""A ripple's size and phase follow speed and load along a stroke: this many values of each."""


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
