"""A logged speed that is the command, not the joint's."""

import numpy as np
from numpy.typing import NDArray

from opamc_cli.signal.motion.signs import LEAST_SPEED_RAD_S
from opamc_cli.signal.motion.smoothing import (
    averaged,
    averaging_kernel,
    derivatives,
    filled,
    less_late,
    measurement_noise,
    noise_gain,
    smoothing_window,
)

APART, CERTAIN = 0.01, 5.0
"""Share of the speed, and of the noise of the position's own, that the two differ by at the least:
a stranger's 15 commanded speeds by 1.4 to 5.5 %, his and two others' 99 measured ones, filtered or
not, by 0.9 % at most."""
QUIET = 2e-4
"""Of the speed: noise of what nobody has measured. Of those 15 it was 0 to 0.9e-4, or half a step
of what they were rounded to; of 56 measured speeds of five machines that differ by 1 % and more
3.9e-4 to 50e-4, two steps and more."""


def apart(
    position_rad: NDArray[np.float64], velocity_rad_s: NDArray[np.float64], rate_hz: float
) -> float | None:
    """How far a logged speed is from its position's, if no sensor has measured it.

    Parameters
    ----------
    position_rad, velocity_rad_s : arrays of shape (n,)
        As logged; gaps are bridged.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    float or None
        Standard deviation of what both differ by, of the root mean square of the speed, where that
        is more than filters and noise make of one speed; None where it may be the joint's own.
    """
    position, logged = filled(position_rad), filled(velocity_rad_s)
    window = smoothing_window(position, rate_hz)
    speed, acceleration = (derivatives(position, rate_hz, window, k) for k in (1, 2))
    size = float(np.sqrt(np.mean(speed**2)))
    own = less_late(logged, speed, acceleration, rate_hz)
    # Through the same average: what a long window takes off the position's is no difference.
    alike = averaged(own, ((0, own.size),), averaging_kernel(window, 1))
    apart = float(np.std((alike - speed)[window:-window])) if own.size > 2 * window else 0.0
    noise = measurement_noise(position) * noise_gain(rate_hz, window, 1)
    changes = np.abs(np.diff(logged))
    changes = changes[changes > 1e-6 * size]
    step = float(changes.min()) if changes.size else 0.0
    quiet = measurement_noise(logged) < max(QUIET * size, step)
    least = max(APART * size, CERTAIN * noise, step)
    return apart / size if quiet and size > LEAST_SPEED_RAD_S and apart > least else None
