"""In which domain a residual is structured, and how much of it any effect could explain.

A domain is seen through a flexible basis: hat functions over the covariate, without any claim
about the form. What such a basis predicts in groups that it was not fitted to is structure; what
is left of it after an effect was added says that the effect has the wrong form.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.stats import gamma
from scipy.stats import t as student

from opamc_cli.joint.model import Fit, Grid
from opamc_cli.joint.normal import held_out_error, normal_equations, solve
from opamc_cli.joint.spectra import (
    LOWEST_ORDER,
    OVERSAMPLING,
    line_power,
    order_resolution,
    order_spectrum,
    standing_views,
)
from opamc_cli.joint.track import Floats, Track
from opamc_cli.joint.view import prepare, residual_on

LINE_P = 1e-4
"""Probability with which noise alone shows a line."""
SAFETY = 4.0
"""Times the motion's noise that may repeat and yet be no effect."""
LEAST_GAIN = 0.02
LARGEST_P = 1e-3
"""Least share and largest p of what counts as structure."""


@dataclass(frozen=True)
class Structure:
    """Held-out share of the residual's mean square that a domain's flexible basis explains."""

    domain: str
    gain: float
    t_value: float
    p_value: float

    @property
    def significant(self) -> bool:
        """Whether more than chance and a trifle is left in the domain."""
        return self.gain > LEAST_GAIN and self.p_value < LARGEST_P


@dataclass(frozen=True)
class Ceiling:
    """What any reproducible effect could explain, and what nothing can.

    Attributes
    ----------
    share : float
        Share of the residual's mean square that repeats, at least 0.
    t_value, p_value : float
        Of that share.
    how : str
        "cycles" (covariance of cycles at equal times) or "domains" (best flexible basis).
    """

    share: float
    t_value: float
    p_value: float
    how: str

    @property
    def significant(self) -> bool:
        """Whether more than chance and a trifle repeats."""
        return self.share > LEAST_GAIN and self.p_value < LARGEST_P


def hats(values: Floats, knots: Floats) -> Floats:
    """Linear interpolation weights of values on knots.

    Parameters
    ----------
    values : array of shape (n,)
        Covariate.
    knots : array of shape (k,)
        Ascending; values beyond the ends take the end's weight.

    Returns
    -------
    array of shape (n, k)
        Rows sum to one.
    """
    weights = np.zeros((values.size, knots.size))
    if knots.size == 1:
        weights[:, 0] = 1.0
        return weights
    inside = np.clip(values, knots[0], knots[-1])
    left = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, knots.size - 2)
    share = (inside - knots[left]) / (knots[left + 1] - knots[left])
    rows = np.arange(values.size)
    weights[rows, left] = 1 - share
    weights[rows, left + 1] = share
    return weights


def _knots(values: Floats, count: int, closest: float = 0.02) -> Floats:
    """Quantiles, none nearer to the one below than a share of their range.

    At a constant speed, or a constant acceleration, quantiles crowd into the controller's own
    wobble and the measurement's noise: there the current drives the motion, or noise does, and
    what follows it is no effect of the motion.
    """
    found = np.unique(np.quantile(values, np.linspace(0.005, 0.995, count)))
    knots = [found[0]]
    for knot in found[1:]:
        if knot - knots[-1] >= closest * (found[-1] - found[0]):
            knots.append(knot)
    return np.array(knots)


def _even(values: Floats, count: int) -> Floats:
    """Evenly spread knots; a single one where the covariate does not change."""
    return np.unique(np.linspace(float(values.min()), float(values.max()), count))


def flexible_bases(track: Track, rows: np.ndarray) -> dict[str, Floats]:
    """Bases of all domains that a track has, on the given samples.

    Parameters
    ----------
    track : Track
        With fitted load.
    rows : bool array of shape (n,)
        Samples wanted.

    Returns
    -------
    dict of str to array of shape (m, k)
    """
    sign = track.direction[rows]
    forward = (sign > 0)[:, None]
    speed = np.abs(track.velocity[rows])
    position = track.position_rad[rows]
    time = track.time_s[rows]
    velocity = track.velocity[rows]

    def both_ways(weights: Floats) -> Floats:
        return np.concatenate([weights * forward, weights * ~forward], axis=1)

    bases = {
        "velocity": both_ways(hats(speed, _knots(speed, 9))),
        "joint-angle": both_ways(hats(position, _even(position, 25))),
        "acceleration": hats(track.acceleration[rows], _knots(track.acceleration[rows], 12, 0.08)),
        "time": np.concatenate(
            [
                hats(time, _even(time, 5)) * velocity[:, None],
                hats(time, _even(time, 5)) * sign[:, None],
                hats(time, _even(time, 5)),
            ],
            axis=1,
        ),
    }
    load = np.abs(track.load_a[rows])
    if load.size and load.std() > 0:
        bases["load"] = both_ways(hats(load, _knots(load, 7)))
    if track.temperature_c is not None:
        degrees = track.temperature_c[rows]
        if np.ptp(degrees) > 0.3:
            weights = hats(degrees, _even(degrees, 4))
            bases["temperature"] = np.concatenate(
                [weights * velocity[:, None], weights * sign[:, None]], axis=1
            )
    return bases


def structures(fit: Fit) -> list[Structure]:
    """Held-out gain of every domain's flexible basis, and the lines of the periodic domains.

    Parameters
    ----------
    fit : Fit
        The model so far.

    Returns
    -------
    list of Structure
        Largest gain first; motor-angle and frequency hold the share of their significant lines.
    """
    session = fit.session
    grid = session.coarse
    rows = grid.fit
    residual = residual_on(fit, fine=False)[rows]
    blocks = [session.columns(term, fine=False)[rows] for term in fit.terms]
    width = sum(block.shape[1] for block in blocks)
    found = []
    for domain, basis in flexible_bases(grid.track, rows).items():
        design = np.concatenate([*blocks, basis], axis=1)
        normal = normal_equations(design, residual, grid.slices)
        before = held_out_error(normal.taken(list(range(width))))
        falls = before - held_out_error(normal, ridged=basis.shape[1])
        found.append(_structure(domain, falls, before))
    found += _line_structures(fit)
    return sorted(found, key=lambda structure: -structure.gain)


def _structure(domain: str, falls: Floats, before: Floats) -> Structure:
    spread = float(np.std(falls, ddof=1)) if falls.size > 1 else 0.0
    t_value = float(falls.mean() / (spread / np.sqrt(falls.size))) if spread > 0 else 0.0
    p_value = float(student.sf(t_value, max(falls.size - 1, 1)))
    return Structure(domain, float(falls.sum() / max(before.sum(), 1e-300)), t_value, p_value)


def _line_structures(fit: Fit) -> list[Structure]:
    view = prepare(fit, fine=True)
    track = view.grid.track
    found = []
    orders, power, classes = order_spectrum(track, view.residual)
    first = int(
        np.searchsorted(orders, max(LOWEST_ORDER[track.angle_kind], 3 * order_resolution(track)))
    )
    if orders.size - first > 8:
        trials = (orders.size - first) / OVERSAMPLING
        height = float(power[first:].max())
        if height > gamma.isf(LINE_P / trials, classes):
            share = 2 * height / classes / max(int(view.valid.sum()), 1) * classes
            found.append(Structure("motor-angle", min(share, 1.0), float(np.sqrt(height)), LINE_P))
    shares = []
    for _turning, signals in standing_views(track, view.residual):
        frequencies, lines = line_power(track, signals)
        upper = frequencies > 5.0
        height = float(lines[upper].max()) if upper.any() else 0.0
        if upper.any() and height > gamma.isf(LINE_P / upper.sum(), 1):
            # Turned back, a line is shared out between two signals and two frequencies.
            shares.append(2 * len(signals) * height / max(int(view.valid.sum()), 1))
    if shares:
        root = float(np.sqrt(max(shares) * view.valid.sum() / 2))
        found.append(Structure("frequency", min(max(shares), 1.0), root, LINE_P))
    return found


def ceiling(fit: Fit, seen: list[Structure]) -> Ceiling:
    """Share of the residual's mean square that repeats from cycle to cycle.

    Parameters
    ----------
    fit : Fit
        The model so far.
    seen : list of Structure
        From `structures`, for motions that do not repeat.

    Returns
    -------
    Ceiling
        The larger of the cycles' covariance at equal times (unbiased: no cycle is compared with
        itself) and the best flexible basis. A repeated path repeats its encoder's rounding, and
        with it the noise of the acceleration: what is structured in no domain must repeat in
        block means too, where that noise has averaged out, or exceed that noise.
    """
    best = max(seen, key=lambda structure: structure.gain, default=Structure("", 0.0, 0.0, 1.0))
    by_domain = Ceiling(max(best.gain, 0.0), best.t_value, best.p_value, "domains")
    session = fit.session
    by_cycle = _cycle_ceiling(_without_blur(fit), session.sharp)
    if by_cycle is None or by_cycle.share < by_domain.share:
        return by_domain
    if not by_domain.significant and session.coarse is not session.fine:
        slow = _cycle_ceiling(residual_on(fit, fine=False), session.coarse)
        rough = SAFETY * _roughness(fit)
        if slow is not None and not slow.significant and by_cycle.share < rough:
            return by_domain
    return by_cycle


def _roughness(fit: Fit) -> float:
    """Mean square of what of the slow model varies within a block, as a share of the residual's.

    Effects of the motion are smooth where the motion is: this is its noise.
    """
    grid = fit.session.sharp
    width = fit.session.factor
    slow = np.zeros(grid.track.size)
    for term, values in zip(fit.terms, fit.coefficients, strict=True):
        if not term.effect.fast:
            slow += fit.session.columns(term, fine=True) @ values
    inside = grid.fit & (uniform_filter1d(grid.track.moving.astype(float), width) > 1 - 1e-9)
    if not inside.any():
        return 0.0
    rough = slow - uniform_filter1d(slow, width)
    power = float(np.mean(fit.residual_a[grid.fit] ** 2))
    return float(np.mean(rough[inside] ** 2)) / max(power, 1e-300)


def _without_blur(fit: Fit) -> Floats:
    """Fine residual without what smoothing took from the acceleration.

    The model is fitted anew to the samples that are clear of corners: elsewhere its coefficients
    have bent to them.
    """
    grid = fit.session.sharp
    blur = grid.track.blur
    if blur is None:
        return fit.residual_a
    blocks = [fit.session.columns(term, fine=True)[grid.fit] for term in fit.terms]
    design = np.concatenate([*blocks, blur[grid.fit]], axis=1)
    residual = np.zeros(grid.track.size)
    rest = fit.residual_a[grid.fit]
    residual[grid.fit] = rest - design @ solve(design.T @ design, design.T @ rest)
    return residual


def _cycle_ceiling(residual: Floats, grid: Grid) -> Ceiling | None:
    period = grid.track.period_samples
    if period is None:
        return None
    curves, masks = [], []
    for start, stop in grid.track.bounds:
        for begin in range(start, stop - period + 1, period):
            mask = grid.fit[begin : begin + period]
            if mask.any():
                curves.append(np.where(mask, residual[begin : begin + period], 0.0))
                masks.append(mask)
    if len(curves) < 2:
        return None
    values = np.stack(curves)
    valid = np.stack(masks).astype(float)
    products = []
    energy = float((values**2).sum() / max(valid.sum(), 1.0))
    total, total_mask = values.sum(axis=0), valid.sum(axis=0)
    for curve, mask in zip(values, valid, strict=True):
        others = np.where(total_mask - mask > 0, (total - curve), 0.0)
        count = np.maximum(total_mask - mask, 1.0)
        overlap = float((mask * (total_mask - mask > 0)).sum())
        products.append(float((curve * others / count).sum()) / max(overlap, 1.0))
    shares = np.array(products) / max(energy, 1e-300)
    spread = float(np.std(shares, ddof=1))
    t_value = float(shares.mean() / (spread / np.sqrt(shares.size))) if spread > 0 else 0.0
    p_value = float(student.sf(t_value, max(shares.size - 1, 1)))
    return Ceiling(max(float(shares.mean()), 0.0), t_value, p_value, "cycles")
