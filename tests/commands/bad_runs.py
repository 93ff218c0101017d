"""A robot's run that everything can use, and what can be wrong with one."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run

RATE_HZ = 1000.0
INFO = RunInfo(sampling_rate_hz=RATE_HZ, robot="R1", program="pick")
MOTIONS = ((40.0, 1.0, 1), (80.0, 1.4, -1), (60.0, 0.8, 1))
"""Carrier in Hz, duration in s and sense of rotation of the motions of a cycle."""
REST_S = 0.5


def phases(seed: int = 0, cycles: int = 4, rate_hz: float = RATE_HZ) -> dict[str, np.ndarray]:
    """Return the phase currents of a joint that moves through `cycles` cycles."""
    rng = np.random.default_rng(seed)
    speed = [np.zeros(int(REST_S * rate_hz))]
    for _ in range(cycles):
        for carrier_hz, duration_s, sense in MOTIONS:
            n = int(duration_s * rate_hz)
            ramp = np.clip(np.minimum(np.arange(n), np.arange(n)[::-1]) / (0.15 * n), 0, 1)
            speed += [sense * carrier_hz * ramp, np.zeros(int(REST_S * rate_hz))]
    hz = np.concatenate(speed)
    angle = 2 * np.pi * np.cumsum(hz) / rate_hz + 0.3
    n = len(hz)
    torque = 2 + np.abs(hz) / 40 + np.convolve(rng.normal(size=n), np.ones(9) / 9, "same")
    return {
        f"axis1_{name}": (
            torque * np.cos(angle - k * 2 * np.pi / 3) + 0.02 * rng.normal(size=n)
        ).astype(np.float32)
        for k, name in enumerate("abc")
    }


def good(path: Path, seed: int = 0, cycles: int = 4, **info: object) -> Path:
    """Write a run that can be used."""
    save_run(path, dataclasses.replace(INFO, **info), phases(seed, cycles))
    return path


def with_metadata(path: Path, metadata: dict[str, str] | None, **columns: object) -> Path:
    """Write a Parquet file with any metadata."""
    table = pa.table(columns or {k: pa.array(v) for k, v in phases().items()})
    pq.write_table(table.replace_schema_metadata(metadata), path, write_page_checksum=True)
    return path


def milliamperes(path: Path) -> Path:
    save_run(path, INFO, {name: 1000 * x for name, x in phases().items()})
    return path


def stage_table(path: Path) -> Path:
    """Write what a later stage reads, under a run's name."""
    record = {"opamc_table": json.dumps({"stage": "segment", "schema_version": 1})}
    return with_metadata(path, record)


def missing(path: Path) -> Path:
    return path


def folder(path: Path) -> Path:
    path.mkdir()
    return path


def text(path: Path) -> Path:
    path.write_text("time,current\n0,1\n")
    return path


def empty_file(path: Path) -> Path:
    path.write_bytes(b"")
    return path


def truncated(path: Path) -> Path:
    content = good(path).read_bytes()
    path.write_bytes(content[: len(content) // 2])
    return path


def damaged(path: Path) -> Path:
    """Flip one bit in the middle of the samples."""
    content = bytearray(good(path).read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    return path


def other_columns(path: Path) -> Path:
    return with_metadata(path, {"opamc": '{"sampling_rate_hz": 1000}'}, current=[1.0, 2.0])


def text_column(path: Path) -> Path:
    return with_metadata(path, {"opamc": '{"sampling_rate_hz": 1000}'}, axis1_a=["1", "2"])


def no_metadata(path: Path) -> Path:
    return with_metadata(path, None)


def no_rate(path: Path) -> Path:
    return with_metadata(path, {"opamc": '{"robot": "R1"}'})


def zero_rate(path: Path) -> Path:
    return with_metadata(path, {"opamc": '{"sampling_rate_hz": 0}'})


def no_rows(path: Path) -> Path:
    nothing = pa.array([], pa.float32())
    return with_metadata(path, {"opamc": '{"sampling_rate_hz": 1000}'}, axis1_a=nothing)


def wrong_time(path: Path) -> Path:
    columns = phases()
    columns["time_s"] = np.arange(len(columns["axis1_a"])) / 500
    save_run(path, INFO, columns)
    return path


def _changed(path: Path, column: str, change: object) -> Path:
    columns = phases()
    columns[column] = change(columns[column])  # type: ignore[operator]
    save_run(path, INFO, columns)
    return path


def all_nan(path: Path) -> Path:
    return _changed(path, "axis1_b", lambda x: np.full_like(x, np.nan))


def infinite(path: Path) -> Path:
    def change(x: np.ndarray) -> np.ndarray:
        x[len(x) // 2] = np.inf
        return x

    return _changed(path, "axis1_a", change)


def some_nan(path: Path) -> Path:
    def change(x: np.ndarray) -> np.ndarray:
        x[::7] = np.nan
        return x

    return _changed(path, "axis1_a", change)


def constant(path: Path) -> Path:
    return _changed(path, "axis1_c", lambda x: np.full_like(x, 1.5))


def clipped(path: Path) -> Path:
    return _changed(path, "axis1_a", lambda x: np.clip(x, -1.5, 1.5))


def too_slow(path: Path) -> Path:
    """Write a run at one sample a second, as a data historian keeps it."""
    rng = np.random.default_rng(0)
    columns = {f"axis1_{p}": rng.normal(size=1500).astype(np.float32) for p in "abc"}
    save_run(path, RunInfo(1.0, "R1", "pick"), columns)
    return path


def standing(path: Path) -> Path:
    """Write a run of a joint that holds still."""
    rng = np.random.default_rng(0)
    columns = {
        f"axis1_{p}": (level + 0.02 * rng.normal(size=8000)).astype(np.float32)
        for p, level in (("a", 1.0), ("b", -0.4), ("c", -0.6))
    }
    save_run(path, INFO, columns)
    return path


def short(path: Path) -> Path:
    columns = {name: values[:40] for name, values in phases().items()}
    save_run(path, INFO, columns)
    return path


def part(path: Path, start: int, stop: int) -> Path:
    save_run(path, INFO, {name: values[start:stop] for name, values in phases().items()})
    return path


def one_cycle(path: Path) -> Path:
    return good(path, cycles=1)


def samples(path: Path) -> int:
    """Return how long a run is."""
    with Run(path) as run:
        return run.n_samples


def aliased(path: Path) -> Path:
    """Write a run whose fastest carrier, 80 Hz, is above what 170 Hz can show."""
    save_run(path, dataclasses.replace(INFO, sampling_rate_hz=170.0), phases(rate_hz=170.0))
    return path


def other_rate(path: Path) -> Path:
    save_run(path, dataclasses.replace(INFO, sampling_rate_hz=500.0), phases(rate_hz=500.0))
    return path


def other_program(path: Path) -> Path:
    return good(path, program="place")


def other_axis(path: Path) -> Path:
    columns = {name.replace("axis1", "axis2"): values for name, values in phases().items()}
    save_run(path, INFO, columns)
    return path


def current_alone(path: Path) -> Path:
    """Write reported current without position or velocity: nothing tells motion."""
    save_run(path, INFO, {"axis1_current": phases()["axis1_a"]})
    return path


def moving_joint(path: Path, change: object = None, n: int = 9000, seed: int = 0) -> Path:
    """Write what a drive reports of a joint that swings, with `change` done to its columns."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(n) / RATE_HZ
    angle = np.sin(2 * np.pi * t_s / 3)
    speed = np.gradient(angle, 1 / RATE_HZ)
    current = 0.5 * np.sign(speed) + 0.3 * speed + 0.4 * np.sin(angle) + 0.02 * rng.normal(size=n)
    columns = {
        "axis1_current": current.astype(np.float32),
        "axis1_position": angle,
        "axis1_velocity": speed.astype(np.float32),
    }
    if change is not None:
        change(columns)  # type: ignore[operator]
    save_run(path, INFO, columns)
    return path
