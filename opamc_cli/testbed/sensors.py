"""From the current vector behind the anti-alias filter to sampled phase currents."""

import numpy as np
from numpy.typing import NDArray


def phase_currents(
    alpha_a: NDArray[np.float64],
    beta_a: NDArray[np.float64],
    gain: NDArray[np.float64],
    offset_a: NDArray[np.float64],
    noise_a: NDArray[np.float64],
    full_scale_a: float,
    bits: int,
) -> NDArray[np.float32]:
    """Three phase currents as three Hall sensors and a converter report them.

    Parameters
    ----------
    alpha_a, beta_a : ndarray, shape (n,)
        Current vector, amplitude invariant (its length is the phases' amplitude).
    gain, offset_a : ndarray, shape (3,)
        Of the sensors.
    noise_a : ndarray, shape (n, 3)
    full_scale_a : float
        Largest current that is converted; beyond it the value is clipped.
    bits : int
        Of the converter over the range of both signs.

    Returns
    -------
    ndarray of float32, shape (n, 3)
    """
    half, root = 0.5, 0.5 * np.sqrt(3.0)
    ideal = np.column_stack(
        [alpha_a, -half * alpha_a + root * beta_a, -half * alpha_a - root * beta_a]
    )
    return quantise(ideal * gain + offset_a + noise_a, full_scale_a, bits)


def quantise(values: NDArray[np.float64], full_scale: float, bits: int) -> NDArray[np.float32]:
    """Round to 2**bits steps from -full_scale to full_scale, and clip at that range."""
    step = 2.0 * full_scale / 2.0**bits
    top = 2 ** (bits - 1)
    return (np.clip(np.rint(values / step), -top, top - 1) * step).astype(np.float32)
