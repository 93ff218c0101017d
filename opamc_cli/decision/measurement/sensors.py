"""Whether what sensors alone do has grown as much as the current's fluctuation.

Without a neutral wire the phases of a motor add up to nothing, whatever gear, load and drive do; of
a reported current single samples that leap are the logger's.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opamc_cli.decision.measurement.at_rest import (
    BLOCK_S,
    FEWEST_RECORDINGS,
    FEWEST_SAMPLES,
    GROWN,
    Floats,
    about_course,
)
from opamc_cli.signal.plausible.spikes import spikes

OF_LENGTH = 2 / 9
"""Mean square by which an error of the phases changes their vector's length, over that of their
sum: of one phase's error two thirds are the vector's, half of whose square is along the vector; of
three independent ones it is the same."""

MANY_TIMES = np.array([GROWN**2, GROWN**2, GROWN])
"""Times the power of the largest of the baseline's parts: zero and gain are one number a recording,
of either sign, and six may be near nothing by chance (docs/decision.md)."""

AS_MUCH = 1 / 3
"""Of the growth of the fluctuation: of spikes far above the current the length changes by all of
the vector's error, twice what is counted."""

USUAL = 0.99
"""Of the samples, by their vector's length, that tell what of the sum follows the phases: spikes,
which are few, lie beyond."""

KINDS = ("sensor_offset", "sensor_gain", "sensor_noise")


@dataclass(frozen=True)
class SensorErrors:
    """What of a recording is the sensors', and how much its current fluctuates."""

    parts: tuple[float, float, float]
    """By `KINDS`: of the phases' sum what is constant, what follows the phases, and the rest; as
    mean squares by which they change the vector's length, in A^2. Of a current its spikes."""
    fluctuation: float
    """Mean square of the current, or of that length, about its slow course, in A^2."""


@dataclass(frozen=True)
class ErrorGrowth:
    """What most of the sensors' errors that have grown is."""

    kind: str
    """Of `KINDS`."""
    times: float
    """Its size over the baseline's, of which there may be hardly any."""
    share: float
    """Of the growth of the fluctuation, 1 at most."""


def sensor_errors(current: Floats, rate_hz: float) -> SensorErrors | None:
    """Measure what the sensors of a current add.

    Parameters
    ----------
    current : ndarray, shape (n,) or (n, 3)
        Reported current, or three phases, in A; NaN where unknown.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    SensorErrors or None
        None where no stretch of samples is known.
    """
    size = max(round(BLOCK_S * rate_hz), FEWEST_SAMPLES)
    n = len(current) // size
    length = current[: n * size]
    if current.ndim > 1:
        vector = length - length.mean(axis=1, keepdims=True)
        length = np.sqrt(2 / 3 * (vector**2).sum(axis=1))
    stretches = length.reshape(n, size, 1)
    stretches = stretches[np.isfinite(stretches).all(axis=(1, 2))]
    if not len(stretches):
        return None
    parts = _of_phases(current) if current.ndim > 1 else (0.0, 0.0, _of_spikes(current))
    return SensorErrors(parts, float(about_course(stretches).mean()))


def _of_phases(phases: Floats) -> tuple[float, float, float]:
    known = phases[np.isfinite(phases).all(axis=1)]
    total = known.sum(axis=1)
    # a gain that all three share leaves no sum
    beside = known - known.mean(axis=1, keepdims=True)
    large = (beside**2).sum(axis=1)
    usual = large <= np.quantile(large, USUAL)
    beside = beside[:, :2] - beside[:, :2].mean(axis=0)
    followed = beside @ np.linalg.lstsq(beside[usual], (total - total.mean())[usual])[0]
    own = (total.mean(), followed, total - total.mean() - followed)
    offset, gain, noise = (OF_LENGTH * float(np.mean(np.square(part))) for part in own)
    return offset, gain, noise


def _of_spikes(current: Floats) -> float:
    found = spikes(current)
    away = current[found] - (current[found - 1] + current[found + 1]) / 2
    return float(away @ away) / current.size


def growth_of_errors(
    baseline: Sequence[SensorErrors], target: Sequence[SensorErrors]
) -> ErrorGrowth | None:
    """Tell whether what the sensors add has grown as the current's fluctuation has.

    Parameters
    ----------
    baseline, target : sequence of SensorErrors
        One for each recording.

    Returns
    -------
    ErrorGrowth or None
        None where no part of it has grown beyond the baseline's recordings, or by less than a third
        of what the fluctuation has grown by, or less than that differs among the baseline's.
    """
    if len(baseline) < FEWEST_RECORDINGS or not target:
        return None
    usual = np.array([one.parts for one in baseline])
    before, after = np.median(usual, axis=0), np.median([one.parts for one in target], axis=0)
    fluctuations = [one.fluctuation for one in baseline]
    risen = float(np.median([one.fluctuation for one in target]) - np.median(fluctuations))
    grown = np.where(after > MANY_TIMES * usual.max(axis=0), after - before, 0.0)
    most, total = int(np.argmax(grown)), float(grown.sum())
    if total <= max(AS_MUCH * risen, float(np.std(fluctuations, ddof=1))):
        return None
    share = min(total / risen, 1.0) if risen > 0 else 1.0
    times = float(np.sqrt(after[most] / max(before[most], 1e-300)))
    return ErrorGrowth(KINDS[most], times, float(share))
