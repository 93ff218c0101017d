"""The current sensors' offset, found from whole turns and taken off before the envelope."""

import numpy as np
import pytest

from opamc_cli.config import load_config
from opamc_cli.stages.recordings.envelope import current_offset, read_envelope
from opamc_cli.stages.recordings.identified import IdentifiedPart
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.storage.sources import RunSource

RATE_HZ = 2048.0
F_HZ = 60.0
"""Highest frequency at which the current vector turns."""
OFFSETS_A = (0.2, -0.15, 0.07)


def write(path, seconds=4.0, phases="abc", reported=False):
    time = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    angle = 2 * np.pi * np.cumsum(F_HZ * np.sin(np.pi * time / seconds)) / RATE_HZ
    torque = 3.0 + 0.5 * np.sin(2 * np.pi * 3 * time)
    columns = {}
    for phase, shift, offset in zip("abc", range(3), OFFSETS_A, strict=True):
        if phase in phases:
            current = torque * np.cos(angle - 2 * np.pi * shift / 3) + offset
            columns[f"axis1_{phase}"] = current.astype(np.float32)
    if reported:
        columns = {"axis1_current": torque.astype(np.float32), "axis1_position": angle / 500}
    save_run(path, RunInfo(RATE_HZ), columns)
    return torque


def test_the_offset_of_three_sensors_is_found_and_taken_off(tmp_path):
    torque = write(tmp_path / "run.parquet")
    with Run(tmp_path / "run.parquet") as run:
        offset = current_offset(run, 1, [(0, 4096, F_HZ), (4096, 8192, F_HZ)])
        a, b, c = OFFSETS_A
        true = 2 / 3 * (a + b * np.exp(2j * np.pi / 3) + c * np.exp(-2j * np.pi / 3))
        assert abs(offset - true) < 0.1 * abs(true)
        plain = read_envelope(run, 1, 0, 8192)
        clean = read_envelope(run, 1, 0, 8192, offset=offset)
    assert clean.dtype == np.float32
    assert np.abs(clean - torque).max() < 0.15 * np.abs(plain - torque).max()


def test_the_offset_of_a_single_phase_is_its_mean(tmp_path):
    write(tmp_path / "run.parquet", phases="a")
    with Run(tmp_path / "run.parquet") as run:
        assert current_offset(run, 1, [(0, 8192, F_HZ)]).real == pytest.approx(0.2, abs=0.03)


def test_the_offset_of_no_motion_is_none(tmp_path):
    write(tmp_path / "run.parquet")
    with Run(tmp_path / "run.parquet") as run:
        assert current_offset(run, 1, []) == 0j


def test_the_mean_of_a_reported_current_is_torque(tmp_path):
    write(tmp_path / "run.parquet", reported=True)
    with Run(tmp_path / "run.parquet") as run:
        assert current_offset(run, 1, [(0, 8192, F_HZ)]) == 0j


@pytest.mark.parametrize(("samples", "taken_off"), [(409, False), (410, True)])
def test_a_motion_s_reference_tells_whether_its_offset_is_taken_off(tmp_path, samples, taken_off):
    # twelve turns at the highest frequency: one motion alone, or many of them
    torque = write(tmp_path / "run.parquet")
    for starts in ([3900], range(3000, 5000, 300)):
        rows = [
            {"kind": "motion", "start": start, "stop": start + samples, "lag": 0}
            | {"reference_samples": samples, "reference_f_max_hz": F_HZ}
            | {"sampling_rate_hz": RATE_HZ}
            for start in starts
        ]
        with Run(tmp_path / "run.parquet") as run:
            source = RunSource.of(run)
        courses = IdentifiedPart(source, 1, tuple(rows)).courses(load_config().patterns)
        error = max(
            np.abs(np.abs(course) - torque[r["start"] : r["stop"]]).max()
            for r, course, _ in courses
        )
        assert (error < 0.1) == taken_off
