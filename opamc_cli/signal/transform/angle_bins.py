"""The spectrum over an angle, of samples that are uniform in time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft

Floats = NDArray[np.float64]

OVERSAMPLING = 4
MOST_BINS = 2**21
BINS_PER_WAVE = 16


@dataclass(frozen=True)
class AngleBins:
    """Bins of an angle, and the orders of their spectrum, oversampled four times."""

    width_rad: float
    travel_rad: float
    """Over which they lie; a longer one is wound up."""
    orders: Floats
    """Cycles per revolution, up to the highest; (k,)."""

    @classmethod
    def of(cls, travel_rad: float, top: float) -> "AngleBins":
        """Lay bins over a travel, fine enough for the highest order.

        A sample's angle is off by half a bin at most: 16 bins per shortest wave lose 1.3 %. A very
        long travel is wound up by whole turns.
        """
        width, travel = 2 * np.pi / top / BINS_PER_WAVE, travel_rad + 1e-9
        if travel / width > MOST_BINS:
            travel = 2 * np.pi * max(int(MOST_BINS * width / (2 * np.pi)), 1)
        step = 2 * np.pi / (cls._length(travel, width) * width)
        return cls(width, travel, step * np.arange(int(top / step), dtype=np.float64))

    @staticmethod
    def _length(travel_rad: float, width_rad: float) -> int:
        count = int(np.ceil(travel_rad / width_rad)) + 1
        return int(next_fast_len(OVERSAMPLING * count, real=True))

    def power(self, angle_rad: Floats, values: Floats, tapered: bool = False) -> Floats:
        """Power over the orders, (k,), of samples at angles from zero on, both (n,).

        Tapered by Hann's window over the angle, with the same mean for noise: otherwise jumps at
        both ends leak over all orders, far above a faint line.
        """
        if tapered:
            values = np.sqrt(8 / 3) * np.sin(np.pi * angle_rad / angle_rad.max()) ** 2 * values
        places = (angle_rad % self.travel_rad / self.width_rad).astype(np.int64)
        length = self._length(self.travel_rad, self.width_rad)
        power: Floats = np.abs(rfft(np.bincount(places, values), length)[: self.orders.size]) ** 2
        return power


def vertex(orders: Floats, power: Floats, best: int) -> float:
    """Order of a peak, number `best` of a power over even orders, (k,) each, by a parabola."""
    shift = 0.0
    if 0 < best < power.size - 1:
        left, middle, right = power[best - 1 : best + 2]
        curvature = left - 2 * middle + right
        shift = 0.5 * (left - right) / curvature if curvature < 0 else 0.0
    return float(orders[best] + np.clip(shift, -1, 1) * (orders[1] - orders[0]))
