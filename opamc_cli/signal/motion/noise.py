"""How much noise the current vector carries, told without knowing when the robot stands."""

import numpy as np
from numpy.typing import NDArray

BLOCK = 256
QUIET_SHARE = 0.1


def noise_level(current: NDArray[np.inexact]) -> float:
    """Estimate the standard deviation of the white noise in each component of a current.

    Third differences remove a standing or slowly turning vector and leave the noise; the
    quietest tenth of short blocks is where the robot stands or turns slowest. If it never does,
    the result is too large, by what the carrier leaves over.

    Parameters
    ----------
    current : array, shape (n,), A
        Current vector (complex) or phase current (real); NaN is passed over.

    Returns
    -------
    float
        Standard deviation, A; 0 for fewer than 4 samples.
    """
    known = current[np.isfinite(current)]
    difference = np.diff(known, 3)
    power = difference.real**2 + difference.imag**2
    if not power.size:
        return 0.0
    n = power.size // BLOCK
    means = power[: n * BLOCK].reshape(n, BLOCK).mean(axis=1) if n else np.array([power.mean()])
    # Each component's third difference has 1 + 9 + 9 + 1 = 20 times the variance.
    n_components = 2 if np.iscomplexobj(current) else 1
    return float(np.sqrt(np.quantile(means, QUIET_SHARE) / (20 * n_components)))
