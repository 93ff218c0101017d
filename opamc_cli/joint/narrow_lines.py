"""Take lines of constant frequency out of a noise: they are effects, not its colour.

Hum from the mains does not repeat with the motion, so that differences of cycles hold it. A filter
that whitens it away would leave nothing of it to be found.
"""

import numpy as np
from scipy.fft import next_fast_len, rfft

from opamc_cli.joint.track import Bools, Floats

LOWEST_HZ = 5.0
"""Below, a session is too short to tell a line from slow noise."""
LEAST_SHARE = 0.1
"""Of the noise's power: a line that holds less hardly shows in ten taps."""
MOST_LINES = 4
OVERSAMPLING = 4


def without_lines(noise: Floats, valid: Bools, rate_hz: float) -> Floats:
    """Subtract the strongest lines, one after the other.

    Parameters
    ----------
    noise : array of shape (n,)
        Residual; samples that are not valid do not count.
    valid : bool array of shape (n,)
        Samples that count.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    array of shape (n,)
        Zero where samples do not count.
    """
    rest = np.where(valid, noise, 0.0)
    rows = np.flatnonzero(valid)
    length = next_fast_len(OVERSAMPLING * rest.size, real=True)
    lowest = int(np.ceil(LOWEST_HZ * length / rate_hz))
    for _ in range(MOST_LINES if rows.size else 0):
        power = np.abs(rfft(rest, length))
        power[:lowest] = 0.0
        peak = int(np.argmax(power))
        left, middle, right = power[max(peak - 1, 0)], power[peak], power[(peak + 1) % power.size]
        curvature = left - 2 * middle + right
        shift = 0.5 * (left - right) / curvature if curvature < 0 else 0.0
        phase = 2 * np.pi * (peak + float(np.clip(shift, -0.5, 0.5))) / length * rows
        waves = np.stack([np.cos(phase), np.sin(phase)], axis=1)
        line = waves @ np.linalg.lstsq(waves, rest[rows], rcond=None)[0]
        if float(line @ line) < LEAST_SHARE * float(rest[rows] @ rest[rows]):
            break
        rest[rows] -= line
    return rest
