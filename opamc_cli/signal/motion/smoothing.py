"""Local polynomials and averages: derivatives of a path, and where they lack something."""

from math import perm

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import convolve1d, correlate1d, maximum_filter1d, uniform_filter1d

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

POLYNOMIAL_ORDER = 3
SHORTEST_WINDOW = 3
CORNER_WINDOW = 5
"""Samples that show what the shortest window, which takes nothing a second time, may take."""
LONGEST_WINDOW_S = 0.2
LONGEST_WINDOW = 15
"""Samples that a window may have however long they last: of a noisy position logged at 25 Hz, five
samples leave a fifth of the speed as noise, and no direction is certain."""
QUIET_S = 0.05
"""Longest window by which an acceleration is quietened: at 100 Hz, where nine samples are 90 ms, an
arm that rings and ripples lost more than the noise (testbed, 590000: 0.924 A, 0.888 without)."""
BESIDE_S = 0.02
"""Of a path beside a gap, by which it is told how fast the path is there."""
LATE_SHARE = 0.1
"""Of what a logged speed differs by from the position's, that its lag must explain: a stranger's 71
filtered speeds 0.2 or more; of 20 measured joints, which show none, 0.03 at most."""
ALLOWED_NOISE_SHARE = 0.01
RAMPS_SHARE = 2 / 3
"""Of the longest window: one that is hardly shorter leaves of a ramp as little, but is another draw
of what is found (a sweep of 2 s, in the sum of six declared models 4.48 -> 4.77 A)."""
LONG_WINDOW = 127
"""Samples from which on Fourier transforms are faster than sums over the window: of 245 000 samples
20 ms instead of 50 with 245 of them, 170 with 735; they differ by 4e-13 of the result."""
OFF_GRID = 0.05
"""Share of a step by which a change may miss a multiple of it."""
ROUNDING = 1e-12
"""Share of the largest value below which a difference is the computer's rounding."""
LARGEST_LACK = 0.3
"""Standard deviations of the current's noise that the smoothing may take from a sample."""
CERTAIN = 3.0
"""Standard deviations of the acceleration's noise: less may not be lacking at all."""
FEWEST_CLEAR = 0.05
"""Share of the moving samples: where fewer would be left, the path is of that nature. At 0.02 a
ripple that shook a joint left 2.8 % of a stroke, none of them sealed, and had no name."""
LONGEST_CORNER = 4
"""Lengths of the window's average: a corner is felt over one on each side, what lasts is vibration.
Of samples that are not clear at most 1 % lie in longer runs where a coarse encoder rounds off a
trapezoid, 73 to 100 % where a ripple shakes a soft joint."""


def measurement_noise(path: Floats) -> float:
    """Estimate the standard deviation of what is not smooth in a path, from its fourth differences.

    Of a path, (n,), in its unit, by the median absolute difference; the sum of squares of the
    weights 1, -4, 6, -4, 1 is 70. Where a path in steps of an encoder hardly changes
    from sample to sample, most differences are none: they do not count.
    """
    rounding = ROUNDING * float(np.max(np.abs(path)))
    differences = np.abs(np.diff(path, 4))
    if _in_steps(path, rounding):
        differences = differences[differences > rounding]
    middle = float(np.median(differences)) if differences.size else 0.0
    return middle / 0.6745 / np.sqrt(70.0) if middle > rounding else 0.0


def _in_steps(path: Floats, rounding: float) -> bool:
    """Whether all changes of a path are multiples of the least: a path in an encoder's steps."""
    changes = np.abs(np.diff(path))
    changes = changes[changes > rounding]
    if not changes.size:
        return False
    steps = changes / changes.min()
    return bool(np.quantile(np.abs(steps - np.round(steps)), 0.9) < OFF_GRID)


def smoothing_window(path: Floats, rate_hz: float, derivative: int = 2) -> int:
    """Shortest odd window whose derivative noise is small against the derivative itself.

    Of a position (derivative 2) or a speed (1), shape (n,): 3 samples or more, at most 0.2 s or 15
    samples. Where no window does, as where next to all of the way goes at one speed, the noise is
    held against the derivative where there is one (its mean square weighted by its square), if
    that makes it much shorter.
    """
    longest = max(int(LONGEST_WINDOW_S * rate_hz) | 1, LONGEST_WINDOW)
    longest = min(longest, (path.size - 1) | 1)
    noise = measurement_noise(path)
    window, of_ramps = SHORTEST_WINDOW, longest
    while window < longest:
        values = derivatives(path, rate_hz, window, derivative)
        own = noise * noise_gain(rate_hz, window, derivative) / ALLOWED_NOISE_SHARE
        squares = (values - values.mean()) ** 2
        if own**2 <= float(squares.mean()):
            return window
        if own**2 * float(squares.sum()) <= float(squares @ squares):
            of_ramps = min(of_ramps, window)
        window = int(window * 1.3 + 2) | 1
    return max(of_ramps if of_ramps < RAMPS_SHARE * longest else longest, SHORTEST_WINDOW)


def polynomial_weights(rate_hz: float, window: int, derivative: int, at: int | Ints = 0) -> Floats:
    """Weights of a window's samples in a derivative of the cubic that fits them best; (window,).

    At a sample counted from the middle, or at k of them: then (k, window). As
    `scipy.signal.savgol_coeffs`, without the 0.7 s that package takes to load.
    """
    half = window // 2
    places = np.arange(-half, half + 1) / half
    fit = np.linalg.pinv(np.vander(places, min(POLYNOMIAL_ORDER + 1, window), increasing=True))
    place = np.asarray(at) / half
    asked = [perm(k, derivative) * place ** max(k - derivative, 0) for k in range(len(fit))]
    weights: Floats = np.stack(asked, axis=-1) @ fit * (rate_hz / half) ** derivative
    return weights


def noise_gain(rate_hz: float, window: int, derivative: int) -> float:
    """Compute the standard deviation of a derivative of white noise of unit deviation."""
    return float(np.linalg.norm(polynomial_weights(rate_hz, window, derivative)))


def averaging_kernel(window: int, derivative: int) -> Floats:
    """Weights, of sum 1, of the average that a local polynomial's derivative is a derivative of.

    The second derivative of a Savitzky-Golay filter is the plain second difference of the path
    averaged with these weights; what is fitted to that derivative has to be averaged alike.
    """
    weights = polynomial_weights(1.0, window, derivative)
    for _ in range(derivative):
        weights = -np.cumsum(weights)
    # Two sums have moved the weights back by one sample, one sum by half a sample.
    centred = np.roll(weights, 1) if derivative == 2 else weights + np.roll(weights, 1)
    kernel: Floats = centred / centred.sum()
    return kernel


def blurred(
    path: Floats, middle: Floats, rate_hz: float, window: int, derivative: int
) -> Floats | None:
    """Compare a path's derivative with those of a third and of three times the window; (n, 2).

    Where the motion is less smooth than the window, as at a step of the acceleration, the current
    holds what the derivative lacks; these two span the lack. None where the window is the shortest.
    """
    if window <= SHORTEST_WINDOW:
        return None
    narrow = max(window // 3 | 1, SHORTEST_WINDOW)
    wide = min(3 * window, (path.size - 1) | 1)
    return np.stack(
        [derivatives(path, rate_hz, size, derivative) - middle for size in (narrow, wide)], axis=1
    )


def less_late(logged: Floats, velocity: Floats, acceleration: Floats, rate_hz: float) -> Floats:
    """Take the lag of a drive's filter off a logged speed, if the position's own shows one.

    Parameters
    ----------
    logged, velocity : arrays of shape (n,)
        Speeds, as logged and as the position tells.
    acceleration : array of shape (n,)
        As the position tells.
    rate_hz
        Sampling rate.

    Returns
    -------
    array of shape (n,)
        Of first order; the logged speed itself where no lag explains what both differ by.
    """
    lead = velocity - logged
    lag_s = float(lead @ acceleration) / max(float(acceleration @ acceleration), 1e-300)
    if lag_s <= 0 or lag_s * float(lead @ acceleration) < LATE_SHARE * float(lead @ lead):
        return logged
    return logged + lag_s * derivatives(logged, rate_hz, SHORTEST_WINDOW, 1)


def quietened(path: Floats, values: Floats, rate_hz: float, window: int, derivative: int) -> Floats:
    """Take from a path's derivative, (n,), what noise makes of it where nothing bends; (n,).

    Of the difference to a window three times as long the share is kept that is more than the path's
    noise makes of it in that window: at a corner all, at one speed next to nothing. It is Stein's
    estimate of a mean (W. James and C. Stein, 1961), sample by sample. Beyond 15 samples, where a
    coarse encoder's steps are no noise from sample to sample, and 50 ms nothing is taken.
    """
    wide = min(3 * window, (path.size - 1) | 1)
    if wide > min(LONGEST_WINDOW, QUIET_S * rate_hz):
        return values
    beyond = values - derivatives(path, rate_hz, wide, derivative)
    narrow, wider = (polynomial_weights(rate_hz, size, derivative) for size in (window, wide))
    gain = np.linalg.norm(np.pad(narrow, (wide - window) // 2) - wider)
    chance = (measurement_noise(path) * gain) ** 2
    seen = np.maximum(uniform_filter1d(beyond**2, wide), chance)
    lost = np.divide(chance, seen, out=np.zeros_like(seen), where=seen > 0)
    return np.asarray(values - lost * beyond)


def taken_noise_gain(rate_hz: float, window: int, derivative: int) -> float:
    """Compute the standard deviation of what a window takes from a derivative a second time.

    For a path that is white noise of unit deviation.
    """
    kernel = polynomial_weights(rate_hz, window, derivative)[::-1]
    twice = np.convolve(kernel, averaging_kernel(window, derivative)[::-1])
    half = (twice.size - kernel.size) // 2
    return float(np.linalg.norm(np.pad(kernel, half) - twice))


def derivatives(path: Floats, rate_hz: float, window: int, derivative: int) -> Floats:
    """Savitzky-Golay derivative of a path (cubic; edges by the outermost polynomial), (n,).

    Derivative 0 is the smoothed path itself. The window has an odd number of samples, 5 to n.
    Savitzky and Golay, Analytical Chemistry 36, 1964.
    """
    half = window // 2
    weights = polynomial_weights(rate_hz, window, derivative, np.arange(-half, half + 1))
    smooth = (
        correlate1d(path, weights[half]) if window < LONG_WINDOW else _by_fft(path, weights[half])
    )
    # Within half a window of the ends the outermost polynomial goes on.
    smooth[:half] = weights[:half] @ path[:window]
    smooth[-half:] = weights[half + 1 :] @ path[-window:]
    return smooth


def _by_fft(path: Floats, weights: Floats) -> Floats:
    """Correlate a path with weights, at most as many; what is beyond its ends is its first value.

    Without that value an offset of the path costs no digits.
    """
    length, half = next_fast_len(path.size + weights.size, real=True), weights.size // 2
    products = rfft(path - path[0], length) * rfft(weights, length).conj()
    found: Floats = np.roll(irfft(products, length), half)[: path.size] + path[0] * weights.sum()
    return found


def filled(values: Floats) -> Floats:
    """Values, (n,), with gaps bridged by straight lines; unchanged if all are finite."""
    values = np.asarray(values, dtype=np.float64)
    good = np.isfinite(values)
    if good.all() or not good.any():
        return values
    indices = np.arange(values.size)
    return np.interp(indices, indices[good], values[good])


def bridged_path(path: Floats, rate_hz: float) -> Floats:
    """Path, (n,), with gaps bridged by cubics as fast at their ends as the path is there.

    A straight line would begin and end by blows, of which a joint that rings says nothing.
    Unchanged if all values are finite.
    """
    whole = filled(path)
    good = np.isfinite(path)
    if good.all() or not good.any():
        return whole
    beside = max(round(BESIDE_S * rate_hz), SHORTEST_WINDOW)
    ends = np.flatnonzero(np.diff(good.astype(np.int8), prepend=1, append=1)).reshape(-1, 2)
    for first, last in ends.tolist():
        before, after = whole[max(first - beside, 0) : first], whole[last : last + beside]
        if min(before.size, after.size) < SHORTEST_WINDOW:
            continue
        way, n = after[0] - before[-1], last - first + 1
        # parabolas, from the gap outwards
        starts = -n * np.polyfit(np.arange(before.size), before[::-1], 2)[1] - way
        stops = n * np.polyfit(np.arange(after.size), after, 2)[1] - way
        t = np.arange(1, n) / n
        whole[first:last] += t * (1 - t) * ((1 - t) * starts - t * stops)
    return whole


def unstepped(values: Floats) -> Floats:
    """Bridge the steps of a slow channel that is logged coarsely, such as a temperature; (n,).

    By straight lines through the middles of the steps, the first and the last value held; the
    values themselves where more than a tenth of them are steps.
    """
    steps = np.flatnonzero(np.diff(values)) + 1
    if not steps.size or steps.size > values.size / 10:
        return values
    places = np.concatenate([[0], steps - 0.5, [values.size - 1]])
    levels = np.concatenate([values[:1], (values[steps - 1] + values[steps]) / 2, values[-1:]])
    bridged: Floats = np.interp(np.arange(values.size), places, levels)
    return bridged


def clear_of_corners(
    acceleration: Floats, current_a: Floats, moving: Bools, kernel: Floats, noise: float
) -> Bools:
    """Tell the samples whose acceleration is as true as the current's noise can show.

    At a step of the acceleration, as every trapezoidal speed has them, and where a coarse encoder
    asks for a long window, the smoothed acceleration is not the true one. The inertia's current is
    left over: broad in frequency, the same in every cycle, and well fitted by sines of the angle or
    of time.

    What the window takes from the acceleration is about what it would take a second time (Tukey's
    twicing), with `noise` of that standard deviation in it. How much current that is, is fitted to
    the current less its own moving average, which holds what the window takes, and noise. All are
    (n,), of one recording, but for the kernel: the moving average, of odd length, that the
    acceleration has gone through.
    """
    everywhere = ((0, acceleration.size),)
    clear = np.ones(acceleration.size, dtype=bool)
    taken = acceleration - averaged(acceleration, everywhere, kernel)
    energy = float(taken[moving] @ taken[moving])
    if energy <= 0:
        return clear
    fast = current_a - averaged(current_a, everywhere, kernel)
    inertia = float(taken[moving] @ fast[moving]) / energy
    current_noise = float(np.median(np.abs(fast - inertia * taken)[moving])) / 0.6745
    limit = max(LARGEST_LACK * current_noise, CERTAIN * noise * abs(inertia))
    # At the corner itself nothing is taken, on its two sides the more.
    lacking = moving & widened(np.abs(inertia * taken) > limit, max(kernel.size // 4, 1))
    starts, stops = np.flatnonzero(np.diff(lacking, prepend=False, append=False)).reshape(-1, 2).T
    lengths = stops - starts
    vibrates = 2 * lengths[lengths > LONGEST_CORNER * kernel.size].sum() > lengths.sum()
    few = np.count_nonzero(moving & ~lacking) < FEWEST_CLEAR * np.count_nonzero(moving)
    return clear if vibrates or few else ~lacking


def widened(rows: Bools, reach: int) -> Bools:
    """Rows, (n,), that are true, or at most `reach` samples from one that is."""
    return np.asarray(maximum_filter1d(rows, 2 * reach + 1, mode="constant"))


def block_mean(values: Floats, bounds: tuple[tuple[int, int], ...], factor: int) -> Floats:
    """Average runs of `factor` samples, (n,) or (n, m), in each recording; a rest is dropped."""
    if factor == 1:
        return values
    # By products: nine times as fast as means over so short an axis.
    ones = np.ones(factor)
    parts = []
    for start, stop in bounds:
        blocks = (stop - start) // factor
        part = values[start : start + blocks * factor].T
        parts.append(part.reshape((*part.shape[:-1], blocks, factor)) @ ones)
    return np.concatenate(parts, axis=-1).T / factor


def averaged(values: Floats, bounds: tuple[tuple[int, int], ...], kernel: Floats) -> Floats:
    """Put signals, (n,) or (n, k), through a moving average, (w,), inside each recording.

    Beyond its ends, half-open `bounds`, each keeps its first and last value.
    """
    smooth = np.empty_like(values)
    for start, stop in bounds:
        smooth[start:stop] = convolve1d(values[start:stop], kernel, axis=0, mode="nearest")
    return smooth
