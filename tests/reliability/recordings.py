"""Recordings of a robot with two joints, as they should be and with something wrong."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run

RATE_HZ = 1000.0
INFO = RunInfo(sampling_rate_hz=RATE_HZ, robot="R1", program="pick")
MOTIONS = {1: ((40.0, 1.0, 1), (80.0, 1.4, -1)), 2: ((55.0, 1.2, -1), (90.0, 0.9, 1))}
"""By axis: carrier in Hz, duration in s and sense of rotation of the motions of a cycle."""
REST_S = 0.5
OFFSETS_A = (0.015, -0.02, 0.01)
Columns = dict[str, np.ndarray]


def columns(seed: int, cycles: int = 3) -> Columns:
    """Return the phase currents of both joints through some cycles, with noise of their own."""
    found: Columns = {}
    for axis, motions in MOTIONS.items():
        rng = np.random.default_rng([seed, axis])
        speed = [np.zeros(int(REST_S * RATE_HZ))]
        for _ in range(cycles):
            for carrier_hz, duration_s, sense in motions:
                n = int(duration_s * RATE_HZ)
                ramp = np.clip(np.minimum(np.arange(n), np.arange(n)[::-1]) / (0.15 * n), 0, 1)
                speed += [sense * carrier_hz * ramp, np.zeros(int(REST_S * RATE_HZ))]
        hz = np.concatenate(speed)
        n = len(hz)
        angle = 2 * np.pi * np.cumsum(hz) / RATE_HZ + 0.3
        torque = 2 + np.abs(hz) / 40 + np.convolve(rng.normal(size=n), np.ones(9) / 9, "same")
        for k, name in enumerate("abc"):
            phase = torque * np.cos(angle - k * 2 * np.pi / 3) + OFFSETS_A[k]
            found[f"axis{axis}_{name}"] = (phase + 0.02 * rng.normal(size=n)).astype(np.float32)
    shortest = min(map(len, found.values()))
    return {name: values[:shortest] for name, values in found.items()}


def reported(seed: int, cycles: int = 3) -> Columns:
    """Return what a drive reports of the same cycles: current with its sign, position and speed."""
    found: Columns = {}
    for axis, motions in MOTIONS.items():
        rng = np.random.default_rng([seed, axis, 1])
        speed = [np.zeros(int(REST_S * RATE_HZ))]
        for _ in range(cycles):
            for carrier_hz, duration_s, sense in motions:
                n = int(duration_s * RATE_HZ)
                ramp = np.clip(np.minimum(np.arange(n), np.arange(n)[::-1]) / (0.15 * n), 0, 1)
                # a joint comes back
                speed += [sense * carrier_hz / duration_s * ramp, np.zeros(int(REST_S * RATE_HZ))]
        velocity = np.concatenate(speed) / 40
        n = len(velocity)
        load = np.convolve(rng.normal(size=n), np.ones(9) / 9, "same")
        current = 2 * np.sign(velocity) + velocity + 0.3 * load + 0.02 * rng.normal(size=n)
        found[f"axis{axis}_current"] = current.astype(np.float32)
        found[f"axis{axis}_position"] = np.cumsum(velocity) / RATE_HZ
        found[f"axis{axis}_velocity"] = velocity.astype(np.float32)
    shortest = min(map(len, found.values()))
    return {name: values[:shortest] for name, values in found.items()}


def record(
    path: Path,
    seed: int,
    alter: Callable[[Columns], object] = lambda _: None,
    made: Callable[[int], Columns] = columns,
    **info: object,
) -> Path:
    """Write one recording, altered in place if that is asked for."""
    found = made(seed)
    alter(found)
    path.parent.mkdir(parents=True, exist_ok=True)
    info = {"started_at": f"2026-03-{seed + 1:02d}T02:00:00+00:00", **info}
    save_run(path, dataclasses.replace(INFO, **info), found)
    return path
