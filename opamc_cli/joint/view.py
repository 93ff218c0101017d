"""A fit's residual and regressors, whitened: what a search looks at."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from opamc_cli.joint.model import Fit, Grid
from opamc_cli.joint.narrow_lines import without_lines
from opamc_cli.joint.normal import solve
from opamc_cli.joint.slow_noise import noise_model
from opamc_cli.joint.span import orthonormal
from opamc_cli.joint.track import Bools, Floats
from opamc_cli.joint.whitening import (
    NoiseModel,
    Whitening,
    autoregression,
    whitening_with_gaps,
)

LEAST_DRIFT = 0.3
BLOCKS_PER_GROUP = 8
FEWEST_PAIRS = 3
STEP_POWER = 4.0
"""Of the median: a difference of two cycles above holds more than noise."""
AVERAGED = 16
STEP_LEVEL = 8.0
"""Of the least, averaged over a sixteenth of a cycle: slow noise alone was seen to reach 4.6."""


@dataclass(frozen=True)
class View:
    """One grid prepared for a search: whitened residual and the model's whitened span."""

    grid: Grid
    fine: bool
    whitening: Whitening
    valid: Bools
    span: Floats
    residual: Floats
    variance: float

    @cached_property
    def rows(self) -> NDArray[np.int64]:
        """Places of the valid samples on the grid."""
        return np.flatnonzero(self.valid)

    @cached_property
    def values(self) -> Floats:
        """Residual on the valid samples; the model's span explains nothing of it."""
        values: Floats = self.residual[self.rows]
        return values

    @cached_property
    def power(self) -> float:
        """Sum of squares of the residual."""
        return float(np.dot(self.values, self.values))

    def freedom(self, more: int) -> int:
        """Count the samples less the coefficients: the model's, and `more`.

        As a factor of the log-likelihood ratio it makes up for what coefficients fit by chance
        (Bartlett, Proceedings of the Royal Society A 160, 1937): on a coarse grid of sixty samples
        a chi-square without it is exceeded five times as often as it says.
        """
        return max(int(self.values.size) - int(self.span.shape[1]) - more, 1)

    def whitened_rows(self, columns: Floats) -> Floats:
        """Regressors of the whole grid as they are on the valid samples, whitened."""
        return self.whitening(columns)


def prepare(fit: Fit, fine: bool, residual: Floats | None = None) -> View:
    """Whiten a fit's residual and regressors on one grid.

    Parameters
    ----------
    fit : Fit
        The model so far.
    fine : bool
        Which grid.
    residual : array of shape (n,), optional
        Another residual on that grid, for decoys.
    """
    session = fit.session
    grid = session.grid(fine)
    own = residual_on(fit, fine)
    usable = grid.track.moving & (grid.track.group >= 0)
    noise = noise_of(fit, fine, own)
    whitening = whitening_with_gaps(noise, usable, grid.track.bounds, grid.fit)
    rows = whitening.rows
    valid = np.zeros_like(grid.fit)
    valid[rows] = True
    blocks = [session.columns(term, fine) for term in fit.terms]
    blur = grid.track.blur
    if fine and blur is not None:
        # What smoothing took from the acceleration is no effect.
        blocks.append(blur)
    base = np.empty((rows.size, sum(block.shape[1] for block in blocks)), order="F")
    place = 0
    for block in blocks:
        for column in block.T:
            base[:, place] = whitening(column)
            place += 1
    span = orthonormal(base)
    values = whitening(own if residual is None else residual)
    values = values - span @ (span.T @ values)
    full = np.zeros(grid.track.size)
    full[rows] = values
    variance = float(values @ values) / max(values.size - span.shape[1], 1)
    return View(grid, fine, whitening, valid, span, full, max(variance, 1e-300))


def residual_on(fit: Fit, fine: bool) -> Floats:
    """Residual of a fit on one of the session's grids.

    On the coarse grid it is the averaged current less the coarse regressors: the average of the
    fine residual would have gone through the motion's smoothing twice.
    """
    session = fit.session
    if fine or session.coarse is session.fine:
        return fit.residual_a
    residual = session.coarse.track.current_a.copy()
    for term, values in zip(fit.terms, fit.coefficients, strict=True):
        residual -= session.columns(term, fine=False) @ values
    return residual


def noise_of(fit: Fit, fine: bool, residual: Floats) -> NoiseModel:
    """Estimate the colour of what does not repeat in a residual.

    Parameters
    ----------
    fit : Fit
        The model so far.
    fine : bool
        Which grid.
    residual : array of shape (n,)
        Residual on that grid.

    Returns
    -------
    NoiseModel
        Of the difference of successive cycles where the motion repeats; else of the residual
        itself, without a slow part: that might as well be an effect.
    """
    grid = fit.session.grid(fine)
    period = grid.track.period_samples
    if period is None:
        return NoiseModel(autoregression(residual, grid.fit))
    noise = np.zeros_like(residual)
    valid = np.zeros_like(grid.fit)
    pairs: list[slice] = []
    for start, stop in grid.track.bounds:
        if stop - start <= period:
            continue
        noise[start : stop - period] = (
            residual[start : stop - period] - residual[start + period : stop]
        ) / np.sqrt(2)
        valid[start : stop - period] = (
            grid.fit[start : stop - period] & grid.fit[start + period : stop]
        )
        pairs += [
            slice(begin, min(begin + period, stop - period))
            for begin in range(start, stop - period, period)
        ]
    noise = without_lines(noise, valid, grid.track.rate_hz)
    _leave_out_steps(noise, valid, pairs)
    if valid.sum() < 0.2 * grid.fit.sum():
        return NoiseModel(autoregression(residual, grid.fit))
    if not fine:
        _remove_drift(fit, noise, valid)
    blocks = [fit.session.columns(term, fine) for term in fit.terms if not term.effect.fast]
    columns = np.concatenate([np.zeros((noise.size, 0)), *blocks], axis=1)
    return noise_model(noise, valid, pairs, columns)


def _leave_out_steps(noise: Floats, valid: Bools, pairs: list[slice]) -> None:
    """Mark, in place, differences of cycles that are no noise: something happened in between.

    Counted as the noise's colour, a payload that changes would hide itself.
    """
    known = [pair for pair in pairs if valid[pair].any()]
    if len(known) < FEWEST_PAIRS:
        return
    powers = np.array([np.mean(noise[pair][valid[pair]] ** 2) for pair in known])
    width = max(max(pair.stop - pair.start for pair in known) // AVERAGED, 1)
    kernel = np.ones(width) / width
    slow = np.convolve(np.where(valid, noise, 0.0), kernel, mode="same")
    levels = np.array([np.mean(slow[pair][valid[pair]] ** 2) for pair in known])
    least = STEP_LEVEL * float(levels.min())
    for pair, power, level in zip(known, powers, levels, strict=True):
        if power > STEP_POWER * float(np.median(powers)) or level > least:
            valid[pair] = False


def _remove_drift(fit: Fit, noise: Floats, valid: Bools) -> None:
    """Take out of the noise, in place, the model's own regressors times a parabola of time.

    Friction or load that drifts from cycle to cycle is what a slow effect looks like; counted as
    the noise's colour it would hide itself. A drift below three tenths of the noise stays: slow
    noise makes as much.
    """
    track = fit.session.coarse.track
    columns = [fit.session.columns(term, fine=False)[valid] for term in fit.terms]
    if not columns:
        return
    model = np.concatenate(columns, axis=1)
    time = track.time_s[valid]
    time = (time - time.mean()) / max(float(np.ptp(time)), 1e-9)
    drift = np.concatenate([model * (time**power)[:, None] for power in range(3)], axis=1)
    drifted = drift @ solve(drift.T @ drift, drift.T @ noise[valid])
    if drifted @ drifted > LEAST_DRIFT * (noise[valid] @ noise[valid]):
        noise[valid] -= drifted


def blocks_of(view: View, per_group: int) -> list[NDArray[np.int64]]:
    """Positions among the valid samples, in blocks of each group."""
    groups = view.grid.track.group[view.valid]
    edges = np.flatnonzero(np.diff(groups) != 0) + 1
    blocks: list[NDArray[np.int64]] = []
    for members in np.split(np.arange(groups.size), edges):
        blocks += [block for block in np.array_split(members, per_group) if block.size]
    return blocks


def block_t_value(view: View, contribution: Floats, in_one_group: bool = False) -> float:
    """Compute the t value of a contribution's agreement with the residual over blocks of time.

    Parameters
    ----------
    view : View
        Whitened residual.
    contribution : array of shape (m,)
        Whitened contribution on the view's valid samples.
    in_one_group : bool
        Whether one group alone knows of the effect.

    Returns
    -------
    float
        Sum over blocks of the products, over the root of their sum of squares: one lucky block
        gives 1, n equal ones the root of n. Eight blocks per group, so that effects that fade
        or step, and live in few groups, can show themselves too; what but a part
        of one group knows is given twice as many.
    """
    products = contribution * view.values
    per_group = (2 if in_one_group else 1) * BLOCKS_PER_GROUP
    sums = np.array([products[block].sum() for block in blocks_of(view, per_group)])
    length = float(np.linalg.norm(sums))
    return float(sums.sum() / length) if length > 0 else 0.0
