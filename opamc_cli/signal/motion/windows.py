"""Windows of whole carrier periods, for a recording that never stands still."""

import numpy as np


def carrier_windows(
    start: int,
    stop: int,
    f_carrier_hz: float,
    fs_hz: float,
    n_windows: int,
    min_samples: int,
) -> list[tuple[int, int]]:
    """Cut an interval into windows of equal length, each a whole number of carrier periods.

    Whole periods, since a window that ends within a period holds some ordinal patterns once
    more than others.

    Parameters
    ----------
    start, stop : int
        Interval to cut, samples, half-open.
    f_carrier_hz : float
        Carrier frequency, > 0, Hz.
    fs_hz : float
        Sampling rate, Hz.
    n_windows : int
        Windows wanted, at least 1.
    min_samples : int
        Fewer windows are made rather than shorter ones than this.

    Returns
    -------
    list of (start, stop)
        In order, not overlapping, half-open; empty if not one carrier period fits.
    """
    n = max(1, min(n_windows, (stop - start) // max(1, min_samples)))
    period = fs_hz / f_carrier_hz
    n_periods = int(np.floor((stop - start) / n / period))
    length = min(round(n_periods * period), (stop - start) // n)
    if length < 1:
        return []
    return [(start + i * length, start + (i + 1) * length) for i in range(n)]
