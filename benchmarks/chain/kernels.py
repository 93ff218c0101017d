"""Speed of the compiled kernels beside public tools, as ratios taken in one process.

Run with ``python benchmarks/chain/kernels.py`` (``--quick`` for the short form). Every figure is
the best of a few repetitions on one thread; the machine's other load moves both sides of a ratio.
"""

# Threads are pinned before the libraries that read the variables are imported.
# ruff: noqa: E402
import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[name] = "1"
os.environ["SSQ_PARALLEL"] = "0"  # ssqueezepy on one thread as well

import argparse
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import antropy
import numpy as np
import ordpy
import ssqueezepy

from opamc_cli.signal.motion.motion_signal import MotionBand, MotionStream, join_frames
from opamc_cli.signal.ordinal.patterns import ordinal_counts
from opamc_cli.signal.transform.analytic import clarke, temporal_fine_structure
from opamc_cli.signal.transform.products import products_over

FS_HZ = 2048.0
STEP = 16


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    what: str
    reached: float
    unit: str
    target: float
    at_most: bool

    def __str__(self) -> str:
        """One line of a Markdown table."""
        good = self.reached <= self.target if self.at_most else self.reached >= self.target
        bound = "<=" if self.at_most else ">="
        verdict = "reached" if good else "MISSED"
        reached = f"{self.reached:.3g} {self.unit}".strip()
        return f"| {self.what} | {reached} | {bound} {self.target:g} | {verdict} |"


def best_time(call: Callable[[], Any], repetitions: int) -> float:
    call()  # compile, and warm the caches
    times = []
    for _ in range(repetitions):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return min(times)


def ordinal_rows(n: int, n_slow: int, repetitions: int) -> list[Row]:
    rng = np.random.default_rng(0)
    x = np.cumsum(rng.standard_normal(n)).astype(np.float32)
    small = x[:n_slow]
    read = best_time(x.sum, repetitions) / n
    five = best_time(lambda: ordinal_counts(x, [5], 3), repetitions) / n
    every = best_time(lambda: ordinal_counts(x, range(3, 8), 3), repetitions) / n
    # Beside other tools: the same, shorter array for both.
    short = best_time(lambda: ordinal_counts(small, [5], 3), repetitions) / n_slow
    with_ordpy = best_time(lambda: ordpy.ordinal_distribution(small, dx=5, taux=3), 1) / n_slow
    with_antropy = best_time(lambda: antropy.perm_entropy(small, 5, 3), 5) / n_slow
    print(
        f"ordinal, order 5: {1e-6 / five:.0f} M samples/s; x.sum(): {1e-6 / read:.0f} M samples/s"
    )
    return [
        Row("ordinal counts, order 5, beside x.sum()", five / read, "x its time", 6, True),
        Row("orders 3..7 in one pass, beside x.sum()", every / read, "x its time", 30, True),
        Row("ordinal counts, order 5, beside ordpy", with_ordpy / short, "x faster", 1000, False),
        Row("ordinal counts, order 5, beside antropy", with_antropy / short, "x faster", 60, False),
    ]


def motion_rows(n: int, n_slow: int, repetitions: int) -> list[Row]:
    t = np.arange(n) / FS_HZ
    frequency_hz = 160 + 140 * np.sin(2 * np.pi * 0.2 * t)
    angle = 2 * np.pi * np.cumsum(frequency_hz) / FS_HZ
    phases = [np.cos(angle - k * 2 * np.pi / 3).astype(np.float32) for k in range(3)]
    tfs = temporal_fine_structure(clarke(*phases), 0.1)
    band = MotionBand()

    def stream(x: np.ndarray) -> Any:
        motion = MotionStream(band, FS_HZ, STEP)
        return join_frames([motion.push(x), motion.finish()])

    ours = best_time(lambda: stream(tfs), repetitions) / n
    vector = best_time(lambda: temporal_fine_structure(clarke(*phases), 0.1), repetitions) / n

    small = tfs[:n_slow]
    morse = ("gmw", {"gamma": 3, "beta": 20})
    scales = band.wavelet.peak_rad * FS_HZ / (2 * np.pi * band.frequencies_hz()[::-1])

    def same_scales() -> np.ndarray:
        return np.abs(ssqueezepy.cwt(small.copy(), morse, scales=scales)[0])

    default = best_time(lambda: ssqueezepy.cwt(small.copy()), 1) / n_slow
    same = best_time(same_scales, 1) / n_slow
    inner = slice(300, -300)
    difference = np.abs(stream(small).strength - same_scales()[:, ::STEP].max(axis=0))[inner].max()
    print(
        f"motion signal, {scales.size} scales: {1e-6 / ours:.1f} M samples/s; with the Clarke "
        f"vector and the fine structure {1e-6 / (ours + vector):.1f} M samples/s; ssqueezepy "
        f"{1e-6 / default:.3f} (defaults), {1e-6 / same:.3f} (same scales) M samples/s"
    )
    return [
        Row("motion signal and ridge, one channel", 1e-6 / ours, "M samples/s", 10, False),
        Row(
            "motion signal beside ssqueezepy.cwt, defaults", default / ours, "x faster", 100, False
        ),
        Row("motion signal beside ssqueezepy.cwt, same scales", same / ours, "x faster", 20, False),
        Row("largest difference of S(t) from ssqueezepy", float(difference), "", 1e-3, True),
    ]


def product_rows(repetitions: int) -> list[Row]:
    rng, count, samples = np.random.default_rng(0), 36, 1000
    edges = np.arange(0, (count + 1) * samples, samples)
    ranges = np.stack([edges[:-1], edges[1:]], axis=1)
    rows = []
    for (k, m), target in {(1, 1): 3, (8, 8): 1.5, (70, 8): 1}.items():
        left, right = (
            np.asfortranarray(rng.standard_normal((count * samples, one))) for one in (k, m)
        )

        def by_blas(left: np.ndarray = left, right: np.ndarray = right) -> Any:
            return [left[start:stop].T @ right[start:stop] for start, stop in ranges]

        def by_loops(left: np.ndarray = left, right: np.ndarray = right) -> Any:
            return products_over(ranges, left, right)

        faster = best_time(by_blas, repetitions) / best_time(by_loops, repetitions)
        what = f"products of {k} by {m} signals over ranges, beside BLAS"
        rows.append(Row(what, faster, "x faster", target, False))
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="shorter arrays")
    quick = parser.parse_args().quick
    tools = ("numpy", "scipy", "numba", "ssqueezepy", "ordpy", "antropy")
    print(f"python {platform.python_version()}, " + ", ".join(f"{t} {version(t)}" for t in tools))
    rows = ordinal_rows(5_000_000 if quick else 50_000_000, 200_000, 30 if quick else 10)
    rows += motion_rows(2_000_000 if quick else 10_000_000, 60_000 if quick else 200_000, 8)
    rows += product_rows(30)
    print("| what | reached | target | |\n|---|---|---|---|")
    print(*rows, sep="\n")


if __name__ == "__main__":
    main()
