"""How much of the current changed beyond what sessions differ by, and how much causes explain."""

from dataclasses import dataclass

import numpy as np

from opamc_cli.joint.change.lines import strokes
from opamc_cli.joint.change.slow import Population, Shift, shift_current, without
from opamc_cli.joint.change.units import Unit, own_fit
from opamc_cli.joint.motion.track import Floats
from opamc_cli.joint.spectra import highest_order

MOST_HARMONICS = 4
KNOTS = 6
"""A ripple's size and phase follow speed and load along a stroke: this many values of each."""

CLEAR = 2.5
"""Baseline standard deviations by which a mean square must differ to count as changed."""


@dataclass(frozen=True)
class Energy:
    """Change of the mean square residual, A^2."""

    slow: float
    """In the declared effects' coefficients: what the baseline's mean model leaves more in the
    target than a unit's own fit, less the same in the baseline."""
    fast: float
    """In the residual of every unit's own fit."""

    @property
    def total(self) -> float:
        """Both together."""
        return self.slow + self.fast


def energy_of(
    units: list[Unit], population: Population, slow_found: bool, shift: Shift | None = None
) -> Energy:
    """Change of the mean square residual, after a shift is taken from the target if one is given.

    Without `slow_found` the coefficients do not lie outside the baseline's: their difference is
    that of healthy sessions and counts as nothing.
    """
    after = np.array([unit.after for unit in units])
    moved = np.zeros(len(units))
    left = np.zeros(len(units))
    for k, unit in enumerate(units):
        current = without(unit, shift)
        residual = own_fit(unit, population.terms, fine=True, current=current)[1]
        model = unit.stacked(population.terms, fine=True) @ population.mean
        left[k] = np.mean(residual**2)
        moved[k] = max(float(np.mean((current - model) ** 2)) - left[k], 0.0)
    n = int(np.count_nonzero(~after))
    # A baseline unit is a part of the mean that it is compared with.
    fair = (n + 1) / max(n - 1, 1)
    slow = float(np.mean(moved[after]) - fair * np.mean(moved[~after])) if slow_found else 0.0
    spread = max(float(np.std(left[~after], ddof=1)), 0.05 * float(np.median(left[~after])))
    fast = float(np.median(left[after]) - np.median(left[~after]))
    clear = fast > CLEAR * spread * np.sqrt(1 / n + 1 / np.count_nonzero(after))
    return Energy(max(slow, 0.0), fast if clear else 0.0)


def rest_growth(units: list[Unit], population: Population, shift: Shift | None) -> float:
    """By which factor the share of the current that neither model nor shift holds has grown.

    Of the equally smooth current's mean square, corners and reversals with it: there a loose joint
    knocks, which a fit to clear samples never sees.
    """
    shares: dict[bool, list[float]] = {False: [], True: []}
    for unit in units:
        current = without(unit, shift, fine=False)
        residual = own_fit(unit, population.terms, current=current)[1]
        shares[unit.after].append(float(np.mean(residual**2) / np.mean(unit.current_a() ** 2)))
    return float(np.median(shares[True])) / max(float(np.median(shares[False])), 1e-300)


def shift_power(units: list[Unit], shift: Shift) -> float:
    """Mean square of a shift's own current in the target's units, A^2."""
    powers = [np.mean(shift_current(unit, shift) ** 2) for unit in units if unit.after]
    return float(np.mean(powers))


def comb_energy(units: list[Unit], plain: list[Floats], fundamental: float) -> float:
    """Mean square that a ripple and its harmonics hold more in the target, A^2.

    Every stroke has its own amplitudes and phases, which follow its course; what such a comb
    takes from the baseline's noise and kinematic error is taken off.
    """
    held: dict[bool, list[float]] = {False: [], True: []}
    for unit, residual in zip(units, plain, strict=True):
        count = max(int(np.count_nonzero(unit.fine_rows)), 1)
        total = 0.0
        top = highest_order(unit.fine)
        orders = [k * fundamental for k in range(1, MOST_HARMONICS + 1) if k * fundamental < top]
        for start, stop in strokes(unit.fine, unit.fine_rows):
            rows = start + np.flatnonzero(unit.fine_rows[start:stop])
            angle = unit.fine.machine_angle_rad[rows]
            knots = np.linspace(float(angle.min()), float(angle.max()), KNOTS)
            weights = np.stack([np.interp(angle, knots, one) for one in np.eye(KNOTS)], axis=1)
            values = residual[rows]
            for order in orders:
                waves = np.exp(1j * order * angle)
                columns = np.concatenate(
                    [weights * waves.real[:, None], weights * waves.imag[:, None]], axis=1
                )
                gram = columns.T @ columns
                moment = columns.T @ values
                total += float(moment @ np.linalg.lstsq(gram, moment, rcond=1e-9)[0])
        held[unit.after].append(total / count)
    return max(float(np.median(held[True]) - np.median(held[False])), 0.0)
