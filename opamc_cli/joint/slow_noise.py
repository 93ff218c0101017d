"""The slow part of a noise, too slow for an autoregression of a few samples.

A sensor's white noise hides a drift from the ten samples before the present one: what they predict
is the drift's level with a third of the white noise's error, while a thousand would tell it. Slow
effects would then be judged against less slow noise than there is. So the noise is a fast part, an
autoregression, plus a slow one of first order; how large and how slow it is says the restricted
likelihood (Patterson and Thompson, Biometrika 58, 1971), in which what does not repeat because
friction or load change from cycle to cycle does not count as noise.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from opamc_cli.joint.track import Bools, Floats, Ints
from opamc_cli.joint.tracking import SlowPart, Tracking
from opamc_cli.joint.whitening import (
    AR_ORDER,
    NoiseModel,
    autocovariance,
    filter_of,
    settled,
    whitened,
)

FEWEST_SAMPLES = 300
MOST_SAMPLES = 20_000
TIMES = 5
LONGEST_SHARE = 0.0625
"""Of a cycle: what is slower differs between cycles as effects do that drift."""
SUPPORT = 3
"""Time constants over which the autocovariance tells the slow part's size."""
LOCAL_SHARE = 0.8
RISES = (0.75, 1.5, 3.0)
"""How much larger the slow part may be than the autocovariance says, from which all
that may differ between cycles has been taken."""
LEAST_RISE = 2.0
"""Of the log-likelihood, to prefer a noise with a slow part."""
CLEAR_RISE = 4.0
"""Likewise, to prefer an autocovariance from which all that may differ between cycles was taken:
some of the slow noise goes with it."""


def noise_model(noise: Floats, valid: Bools, pairs: Sequence[slice], columns: Floats) -> NoiseModel:
    """Fit the fast and the slow part of a noise to differences of successive cycles.

    Parameters
    ----------
    noise : array of shape (n,)
        Differences.
    valid : bool array of shape (n,)
        Samples at which they are known.
    pairs : sequence of slice
        The differences of one cycle and the next, ascending.
    columns : array of shape (n, k)
        Regressors whose coefficients may differ between cycles.

    Returns
    -------
    NoiseModel
        Without a slow part, where the fast one alone does as well.
    """
    values = np.where(valid, noise, 0.0)
    longest = int(LONGEST_SHARE * max(pair.stop - pair.start for pair in pairs))
    pairs = [part for pair in _enough(pairs, valid) for part in _cut(pair, valid)]
    inside = np.zeros_like(valid)
    for pair in pairs:
        inside[pair] = valid[pair]
    bounds = tuple((pair.start, pair.stop) for pair in pairs)
    rows = np.flatnonzero(settled(inside, bounds, AR_ORDER))
    if rows.size < FEWEST_SAMPLES or longest <= 2 * AR_ORDER:
        return NoiseModel(filter_of(*autocovariance(values, valid, AR_ORDER)))
    scale = np.sqrt(np.mean(columns[inside] ** 2, axis=0))
    drifting = np.concatenate(
        [columns / np.maximum(scale, 1e-300), np.ones((noise.size, 1))], axis=1
    )
    steady = values.copy()
    for pair in pairs:
        own = np.flatnonzero(inside[pair]) + pair.start
        steady[own] -= drifting[own] @ np.linalg.lstsq(drifting[own], values[own], rcond=None)[0]
    label = np.searchsorted([pair.stop for pair in pairs], rows, side="right")
    edges = [0, *(np.flatnonzero(np.diff(label)) + 1).tolist(), rows.size]
    steps = np.diff(rows, prepend=rows[0])
    steps[edges[:-1]] = 0
    parts = [slice(*both) for both in pairwise(edges)]
    data = np.concatenate([drifting, values[:, None]], axis=1)
    best = []
    for source in (values, steady):
        covariance, counts = autocovariance(source, inside, SUPPORT * longest)
        best.append(_likeliest(_models(covariance, counts, longest), data, rows, steps, parts))
    (model, likelihood), (without_drift, likelihood_without) = best
    return without_drift if likelihood_without > likelihood + CLEAR_RISE else model


def _likeliest(
    models: Iterable[tuple[Floats, tuple[SlowPart | None, ...]]],
    data: Floats,
    rows: Ints,
    steps: Ints,
    parts: list[slice],
) -> tuple[NoiseModel, float]:
    """Find the likeliest model, and its likelihood; the first one need not have a slow part."""
    best, highest = NoiseModel(np.ones(1)), -np.inf
    for taps, slows in models:
        white = whitened(data, taps)[rows]
        for slow in slows:
            model = NoiseModel(taps, slow)
            found = _likelihood(model, white, steps, parts)
            if found > highest + (0.0 if best.slow is not None else LEAST_RISE):
                best, highest = model, found
    return best, highest


def _enough(pairs: Sequence[slice], valid: Bools) -> list[slice]:
    """Take the first pairs that hold enough samples."""
    chosen: list[slice] = []
    held = 0
    for pair in pairs:
        count = int(np.count_nonzero(valid[pair]))
        if count < 2 * AR_ORDER or held > MOST_SAMPLES:
            continue
        chosen.append(pair)
        held += count
    return chosen


def _cut(pair: slice, valid: Bools) -> list[slice]:
    """Halve a cycle: what changes may do so in the middle of it."""
    rows = np.flatnonzero(valid[pair]) + pair.start
    middle = int(rows[rows.size // 2])
    return [slice(pair.start, middle), slice(middle, pair.stop)]


def _models(
    covariance: Floats, counts: Floats, longest: int
) -> Iterator[tuple[Floats, tuple[SlowPart | None, ...]]]:
    """Fast parts that make up an autocovariance, with slow ones beside which they do."""
    near = slice(0, AR_ORDER + 1)
    yield filter_of(covariance[near], counts[near]), (None,)
    for time in np.geomspace(AR_ORDER, longest, TIMES):
        pole = float(np.exp(-1.0 / time))
        lags = np.arange(AR_ORDER + 1, min(int(SUPPORT * time) + AR_ORDER, covariance.size))
        fading = counts[lags] * pole**lags
        power = float(fading @ covariance[lags]) / max(float(fading @ pole**lags), 1e-300)
        power *= LOCAL_SHARE
        fast = covariance[near] - power * pole ** np.arange(AR_ORDER + 1)
        if power <= 0 or fast[0] <= 0:
            continue
        taps = filter_of(fast, counts[near])
        innovation = float(fast[: taps.size] @ taps)
        if innovation <= 0:
            continue
        yield taps, tuple(SlowPart(pole, rise * power / innovation) for rise in RISES)


def _likelihood(model: NoiseModel, white: Floats, steps: Ints, parts: list[slice]) -> float:
    """Restricted log-likelihood; the last column is the noise, the others may explain it."""
    scale = np.ones(steps.size)
    if model.slow is not None:
        response = np.full(steps.size, float(model.taps.sum()))
        tracking = Tracking.of(model.slow, steps, response)
        white, scale = np.array(white, order="F"), tracking.scale
        tracking.take_out(white)
    error, rooms, free = 0.0, 0.0, 0
    for part in parts:
        own = white[part]
        gram = own.T @ own
        lengths, turned = np.linalg.eigh(gram[:-1, :-1])
        spans = lengths > 1e-9 * lengths[-1]
        inside = turned[:, spans].T @ gram[:-1, -1]
        error += float(gram[-1, -1] - np.sum(inside**2 / lengths[spans]))
        rooms += float(np.log(lengths[spans]).sum())
        free += own.shape[0] - int(np.count_nonzero(spans))
    if error <= 0 or free <= 0:
        return -np.inf
    return float(np.log(scale).sum() - 0.5 * free * np.log(error / free) - 0.5 * rooms)
