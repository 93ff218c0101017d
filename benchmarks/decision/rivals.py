"""What else could judge a joint from its motor current: features that others have proposed.

Each function takes the envelope of one motion (and the electrical angle where it needs it) and
returns a row of numbers; `standardised_distance` turns rows by session into one score, the same
way for every rival.
"""

import math

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import IsolationForest

FloatArray = NDArray[np.float64]

KDE_GRID_A = np.arange(-20.0, 20.0, 0.05)
"""Where torque current densities are evaluated."""


def amplitude_features(envelope_a: FloatArray) -> FloatArray:
    """Log rms, kurtosis and crest factor of the envelope."""
    rms = math.sqrt(float(np.mean(envelope_a**2)))
    centred = envelope_a - envelope_a.mean()
    variance = float(np.mean(centred**2))
    kurtosis = float(np.mean(centred**4)) / variance**2
    return np.array([math.log(rms), kurtosis, float(np.abs(envelope_a).max()) / rms])


def sideband_features(
    envelope_a: FloatArray, electrical_angle_rad: FloatArray, pole_pairs: int, n_orders: int = 8
) -> FloatArray:
    """Log amplitude of the envelope at whole orders of the motor's revolution.

    Amplitude modulation at order k of the shaft is a pair of sidebands of the carrier at
    ± k/p of its frequency. Read over the angle instead of over time, they stay in place while
    the speed changes, which is generous to this rival.
    """
    turns = np.abs(electrical_angle_rad - electrical_angle_rad[0]) / (2 * np.pi * pole_pairs)
    turns = np.maximum.accumulate(turns)
    grid = np.linspace(0.0, turns[-1], envelope_a.size)
    over_angle = np.interp(grid, turns, envelope_a)
    trend = np.polynomial.Polynomial.fit(grid, over_angle, 3)(grid)
    residual = (over_angle - trend) * np.hanning(grid.size)
    kernel = np.exp(-2j * np.pi * np.outer(np.arange(1, n_orders + 1), grid))
    amplitude = np.abs(kernel @ residual) / grid.size
    return np.log(amplitude + 1e-6)


def torque_histogram(torque_current_a: FloatArray) -> FloatArray:
    """Count the torque current in the cells of `KDE_GRID_A`."""
    edges = np.append(KDE_GRID_A, KDE_GRID_A[-1] + 0.05) - 0.025
    return np.histogram(torque_current_a, edges)[0].astype(np.float64)


def kernel_density(histogram: FloatArray) -> FloatArray:
    """Gaussian kernel density of binned torque current, with Silverman's bandwidth."""
    n = histogram.sum()
    mean = float(histogram @ KDE_GRID_A) / n
    spread = math.sqrt(max(float(histogram @ (KDE_GRID_A - mean) ** 2) / n, 1e-6))
    bandwidth = max(1.06 * spread * n**-0.2, 0.05)
    reach = np.arange(-400, 401) * 0.05
    kernel = np.exp(-0.5 * (reach / bandwidth) ** 2)
    density = np.convolve(histogram, kernel / kernel.sum(), mode="same")
    density = np.maximum(density, 1e-6 * density.max())
    return density / density.sum()


def symmetric_kl(p: FloatArray, q: FloatArray) -> float:
    """Kullback-Leibler distance KL(p‖q) + KL(q‖p) between densities, as Bittencourt uses it.

    A. C. Bittencourt et al., A data-driven approach to diagnostics of repetitive processes in
    the distribution domain, Mechatronics 24 (2014).
    """
    return float(np.sum((p - q) * np.log(p / q)))


def permutation_entropy(counts: FloatArray) -> float:
    """Normalised permutation entropy (C. Bandt and B. Pompe, 2002)."""
    pmf = counts[counts > 0] / counts.sum()
    return float(-(pmf * np.log(pmf)).sum() / math.log(counts.size))


def standardised_distance(baseline: FloatArray, target: FloatArray) -> float:
    """Root-mean-square distance of a session from the others, in units of their own spread.

    Parameters
    ----------
    baseline : ndarray, shape (sessions, motions, features)
    target : ndarray, shape (motions, features)
    """
    spread = baseline.std(axis=0, ddof=1)
    # few sessions may agree by accident: a spread is not taken below a fifth of the typical one
    floor = 0.2 * np.median(spread, axis=0, keepdims=True) + 1e-12
    z = (target - baseline.mean(axis=0)) / np.maximum(spread, floor)
    return float(np.sqrt(np.mean(z**2)))


def isolation_score(baseline: FloatArray, target: FloatArray, seed: int) -> float:
    """Mean anomaly of the target's segments by an isolation forest grown on the baseline's.

    Parameters
    ----------
    baseline : ndarray, shape (segments, features)
    target : ndarray, shape (segments, features)
    seed : int
    """
    forest = IsolationForest(n_estimators=50, random_state=seed, n_jobs=1).fit(baseline)
    return float(-forest.score_samples(target).mean())
