"""Time stamps: are they even, and if not, what is wrong with them.

Stamps are even where a straight line explains them: to 1 % of a sample, or to their own
resolution where they are rounded more coarsely than that. Samples with even stamps are kept as
they are, since interpolating them could only lose what they hold.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.source import Name
from opamc_cli.storage.schemas.channels import same_clock

Seconds = npt.NDArray[np.float64]

EVEN_WITHIN = 0.01
"""Largest deviation from the line, in samples, of stamps that count as even."""

RATE_WITHIN = 0.1
"""Relative difference of declared and measured rate beyond which the declaration is wrong: far
beyond, resampling would alias or invent."""

MAX_DROPPED = 0.05
"""Share of rows with unusable stamps beyond which the stamps tell no time."""

MAX_STRETCH = 10
"""Samples per row beyond which a recording is mostly gap."""

ONE_RATE_WITHIN = 1.25
"""Ratio of the rates of two stretches beyond which the logger's rate has changed."""

STRETCHES = 20
STRETCH_ROWS = 50
"""As many stretches are looked at, of as many rows at least: a burst or a few lost samples are no
rate."""

LOST_S = 0.2
"""Seconds of a gap, or of rows before an earlier one, that may hold a motion or part of one."""

SAME_RATE = 1e-9
"""Relative difference of rates that is none: of the arithmetic, not of the clock."""
ONE_STEP, MOSTLY_ONE = 0.01, 0.9
"""Relative difference of steps that are one, and the share of them that tells the rate alone: of a
measured log that halted 286 of 300 steps agreed to a thousandth; a clock that jitters has no such
share, and keeps the mean of all."""

_CHUNK = 1 << 20


@dataclass(frozen=True)
class StampAccount:
    """What was found in the time stamps."""

    even: bool
    """The samples are evenly spaced."""
    resampled: bool
    """They were put on another grid all the same, or because they are not."""
    measured_rate_hz: float
    """What the stamps say."""
    jitter_s: float
    """Largest deviation of a step from the measured period, where no sample is missing."""
    n_bridged: int
    """Longer steps that are interpolated across: a sample is missing."""
    n_gaps: int
    longest_gap_s: float
    """With `n_gaps`: steps that are filled with NaN instead of values."""
    n_duplicates: int
    n_backward: int
    n_unreadable: int
    """With `n_duplicates`, `n_backward`: rows dropped: a stamp for the second time, before an
    earlier one, or none."""

    def doubt(self) -> str | None:
        """Say what part of the recording is not in the run, if a motion may be; None: nothing."""
        back_s = (self.n_backward + self.n_duplicates) / self.measured_rate_hz
        lost = []
        if back_s >= LOST_S:
            lost.append(f"stamps go back or repeat in rows of {back_s:.3g} s, which were dropped")
        if self.longest_gap_s >= LOST_S:
            lost.append(
                f"{self.n_gaps} gap{'s' * (self.n_gaps > 1)}, of {self.longest_gap_s:.3g} s at "
                "most, left as NaN"
            )
        advice = "look at the logger and its clock, or split the recording there"
        return f"{'; '.join(lost)}; {advice}" if lost else None


@dataclass(frozen=True)
class Clock:
    """The uniform grid that the samples are put on."""

    sampling_rate_hz: float
    """Of the grid."""
    n_samples: int
    """Of the grid."""
    start_s: float
    """Of the grid, on the stamps' scale."""
    kept: npt.NDArray[np.bool_] | None
    """Rows that are used, None for all."""
    max_gap_s: float
    """Longest step across which values are interpolated."""
    account: StampAccount
    """What was found."""


def examine(
    path: Path,
    source: Name,
    times_s: Seconds,
    declared_rate_hz: float | None,
    max_gap_samples: float,
    grid_rate_hz: float | None = None,
) -> Clock:
    """Find the uniform grid of a recording's time stamps.

    Parameters
    ----------
    path, source
        File and time column, for messages.
    times_s
        Stamps, shape (rows,); NaN where unreadable.
    declared_rate_hz
        Rate of the logger's clock, None where it is not known. Uneven stamps are put on a grid
        of this rate, or else of the measured one.
    max_gap_samples
        Longest step, in samples, that is interpolated across.
    grid_rate_hz
        Rate of the grid whatever the clock's; None: as above.

    Raises
    ------
    InputError
        If the stamps tell no rate, contradict the declared one, or are mostly gap.
    """
    if len(times_s) < 3:
        msg = f"{path}: {len(times_s)} rows are too few; a recording has many cycles"
        raise InputError(msg)
    clock = _even_clock(times_s, declared_rate_hz)
    if clock is None:
        return _uneven_clock(path, source, times_s, declared_rate_hz, max_gap_samples, grid_rate_hz)
    if grid_rate_hz is None or abs(clock.sampling_rate_hz / grid_rate_hz - 1.0) < SAME_RATE:
        return clock
    rate = clock.sampling_rate_hz
    if abs(rate / grid_rate_hz - 1.0) > RATE_WITHIN:
        msg = (
            f"{path}: resample_hz is {grid_rate_hz:g}, the recording has {rate:.6g} Hz, more than "
            f"{RATE_WITHIN:.0%} apart; a lower rate would alias and a higher one invent: choose "
            "one in between, or record at it"
        )
        raise InputError(msg)
    span_s = float(times_s[-1] - times_s[0])
    return Clock(
        sampling_rate_hz=grid_rate_hz,
        n_samples=int(span_s * grid_rate_hz + 1e-6) + 1,
        start_s=clock.start_s,
        kept=np.ones(len(times_s), dtype=np.bool_),
        max_gap_s=max_gap_samples / rate,
        account=replace(clock.account, resampled=True),
    )


def resolution_s(times_s: Seconds) -> float:
    """Return the decimal step that stamps are rounded to, 0 where none shows.

    Examples
    --------
    >>> resolution_s(np.round(np.arange(50) / 2048, 3))
    0.001
    """
    steps = times_s[:4096] - times_s[0]
    for digits in range(10):
        unit = 10.0**-digits
        counts = steps / unit
        if np.all(np.abs(counts - np.round(counts)) < 1e-3):
            return unit
    return 0.0


def _even_clock(times_s: Seconds, declared_rate_hz: float | None) -> Clock | None:
    if not all(np.isfinite(times_s[a:b]).all() for a, b in _chunks(len(times_s))):
        return None
    period = _fitted_period(times_s)
    if period <= 0:
        return None
    coarse = resolution_s(times_s)
    if declared_rate_hz is not None and _is_line(times_s, 1.0 / declared_rate_hz, coarse):
        rate = declared_rate_hz
    else:
        # a line that is free to tilt would pass off a missing sample as rounding to whole samples
        rounding = coarse if coarse < period / 2 else 0.0
        if not _is_line(times_s, period, rounding):
            return None
        if declared_rate_hz is None:
            simple = float(f"{1.0 / period:.6g}")
            rate = simple if _is_line(times_s, 1.0 / simple, rounding) else 1.0 / period
        elif same_clock(1.0 / period, declared_rate_hz):
            rate = declared_rate_hz
        else:
            return None
    jitter = max(float(np.abs(step - period).max()) for step in _steps(times_s))
    account = StampAccount(True, False, 1.0 / period, jitter, 0, 0, 0.0, 0, 0, 0)
    return Clock(rate, len(times_s), float(times_s[0]), None, 0.0, account)


def _uneven_clock(
    path: Path,
    source: Name,
    times_s: Seconds,
    declared_rate_hz: float | None,
    max_gap_samples: float,
    grid_rate_hz: float | None,
) -> Clock:
    readable = np.isfinite(times_s)
    latest = np.fmax.accumulate(times_s)
    # a stamp counts if it is later than every stamp before it
    kept = readable.copy()
    kept[1:] &= ~(times_s[1:] <= latest[:-1])
    repeated = readable[1:] & (times_s[1:] == latest[:-1])
    n_duplicates = int(repeated.sum())
    n_unreadable = int((~readable).sum())
    n_dropped = int((~kept).sum())
    n_backward = n_dropped - n_duplicates - n_unreadable
    if n_dropped > MAX_DROPPED * len(times_s) or n_dropped > len(times_s) - 3:
        set_back = n_backward > n_dropped / 2
        what = (
            "split the recording where its clock was set back" if set_back else "correct its unit"
        )
        msg = (
            f"{path}: time column {source!r} is unusable in {n_dropped} of {len(times_s)} rows "
            f"({n_duplicates} repeated, {n_backward} backward, "
            f"{n_unreadable} unreadable; first: data row {int(np.argmin(kept)) + 1}), "
            f"at most {MAX_DROPPED:.0%} may be; {what}, or drop time from the map and give "
            "sampling_rate_hz"
        )
        raise InputError(msg)
    step = np.diff(times_s[kept])
    missing = _missing_samples(step, resolution_s(times_s[kept]))
    _refuse_two_rates(path, source, step, np.flatnonzero(kept), max_gap_samples)
    measured = 1.0 / float(step[_counted(step, missing)].mean())
    rate = grid_rate_hz or declared_rate_hz or float(f"{measured:.6g}")
    for declared in (declared_rate_hz, grid_rate_hz):
        if declared is not None and abs(measured / declared - 1.0) > RATE_WITHIN:
            msg = (
                f"{path}: time column {source!r} says {measured:.6g} Hz, the map {declared:g} Hz, "
                f"more than {RATE_WITHIN:.0%} apart; correct sampling_rate_hz, resample_hz or "
                "time.unit"
            )
            raise InputError(msg)
    max_gap_s = max_gap_samples / min(rate, measured)
    gaps = step[step > max_gap_s]
    start_s, stop_s = (float(times_s[kept][i]) for i in (0, -1))
    n_samples = int((stop_s - start_s) * rate + 1e-6) + 1
    if n_samples > MAX_STRETCH * len(times_s):
        msg = (
            f"{path}: time column {source!r} spans {stop_s - start_s:.6g} s, {n_samples} samples "
            f"at {rate:g} Hz, with {len(times_s)} rows; it is mostly gap (longest "
            f"{float(gaps.max()):.6g} s): split the recording there"
        )
        raise InputError(msg)
    regular = step[~missing]
    account = StampAccount(
        even=False,
        resampled=True,
        measured_rate_hz=measured,
        jitter_s=float(np.abs(regular - 1.0 / measured).max()),
        n_bridged=int(np.sum(missing & (step <= max_gap_s))),
        n_gaps=len(gaps),
        longest_gap_s=float(gaps.max(initial=0.0)),
        n_duplicates=n_duplicates,
        n_backward=n_backward,
        n_unreadable=n_unreadable,
    )
    return Clock(rate, n_samples, start_s, kept, max_gap_s, account)


def _missing_samples(step: Seconds, rounding_s: float) -> npt.NDArray[np.bool_]:
    """Return which steps a sample is missing in.

    A stamp that comes late makes a long step too, but a short one beside it: the three together
    are then no longer than three. Rounded stamps step by turns over and under the period, which
    is the mean of both and not the commoner one: 418 Hz in whole milliseconds were taken for 473.

    Examples
    --------
    >>> _missing_samples(np.array([2.0, 3.0, 2.0, 2.0, 5.0, 2.0, 3.0]), rounding_s=1.0).nonzero()
    (array([4]),)
    """
    middle = float(np.median(step))
    within = ONE_STEP * middle + (rounding_s if rounding_s < middle else 0.0)
    typical = float(step[np.abs(step - middle) <= within].mean())
    padded = np.concatenate(([typical], step, [typical]))
    together = padded[:-2] + padded[1:-1] + padded[2:]
    return np.asarray((step >= 1.5 * typical) & (together >= 3.5 * typical))


def _counted(step: Seconds, missing: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Mark the steps that tell the rate: those that are one, where nine of ten are.

    A logger that halts writes the rows of that time in a burst, which belongs to the gap.
    """
    typical = float(np.median(step))
    one = np.abs(step - typical) <= ONE_STEP * typical
    return np.asarray(one if one.mean() >= MOSTLY_ONE else ~missing)


def _refuse_two_rates(
    path: Path, source: Name, step: Seconds, rows: npt.NDArray[np.intp], max_gap_samples: float
) -> None:
    """Refuse a recording whose rate changes: to resample it would alias a part, or invent one."""
    n_stretches = min(STRETCHES, len(step) // STRETCH_ROWS)
    if n_stretches < 2:
        return
    edges = np.linspace(0, len(step), n_stretches + 1).astype(int)
    typical = float(np.median(step))
    parts = np.split(step, edges[1:-1])
    middles = np.array([np.median(part) for part in parts])
    rates = np.array(
        [
            1.0 / part[part <= max_gap_samples * max(typical, middle)].mean()
            for part, middle in zip(parts, middles, strict=True)
        ]
    )
    fast, slow = int(rates.argmax()), int(rates.argmin())
    # Where samples were lost close together most steps are as long as elsewhere.
    ratios = rates[fast] / rates[slow], middles[slow] / middles[fast]
    if min(ratios) > ONE_RATE_WITHIN:
        first, last = sorted((fast, slow))
        between = step[edges[first] : edges[last + 1]]
        change = edges[first] + _change(between, 1.0 / rates[first], 1.0 / rates[last])
        msg = (
            f"{path}: time column {source!r} says {rates[first]:.4g} Hz up to row "
            f"{rows[change] + 1} and {rates[last]:.4g} Hz from there: the rate changes; split the "
            "recording there, or log at one rate"
        )
        raise InputError(msg)


def _change(step: Seconds, before_s: float, after_s: float) -> int:
    """Return how many steps fit the first of two periods before the second fits better.

    By the sum of the logarithms' absolute deviations, to which a gap or a late stamp counts no
    more than the ratio of both periods.

    Examples
    --------
    >>> _change(np.array([1.1, 0.9, 30.0, 1.0, 1.0, 2.1, 1.9, 2.0]), 1.0, 2.0)
    5
    """
    logs = np.log(step)
    worse = np.abs(logs - np.log(before_s)) - np.abs(logs - np.log(after_s))
    return int(np.argmin(np.concatenate(([0.0], np.cumsum(worse)))))


def _fitted_period(times_s: Seconds) -> float:
    """Return the slope of the least-squares line through the stamps."""
    n = len(times_s)
    middle = (n - 1) / 2
    total = 0.0
    for a, b in _chunks(n):
        total += float(np.dot(np.arange(a, b) - middle, times_s[a:b] - times_s[0]))
    return total * 12 / (n * (n * n - 1.0))


def _is_line(times_s: Seconds, period: float, rounding_s: float) -> bool:
    """Return whether the stamps are evenly spaced, to 1 % of a sample or to their rounding.

    A period of whole rounding steps is not rounded at all: a step more is a missing sample.
    """
    steps = period / rounding_s if rounding_s > 0 else 1.0
    if abs(steps - round(steps)) < 1e-6 and steps > 0.5:
        rounding_s = 0.0
    low, high = np.inf, -np.inf
    for a, b in _chunks(len(times_s)):
        deviation = times_s[a:b] - times_s[0] - np.arange(a, b) * period
        low, high = min(low, float(deviation.min())), max(high, float(deviation.max()))
    return high - low <= max(2 * EVEN_WITHIN * period, rounding_s * (1 + 1e-9))


def _steps(times_s: Seconds) -> Iterator[Seconds]:
    for a, b in _chunks(len(times_s) - 1):
        yield np.diff(times_s[a : b + 1])


def _chunks(n: int) -> Iterator[tuple[int, int]]:
    for start in range(0, n, _CHUNK):
        yield start, min(start + _CHUNK, n)
