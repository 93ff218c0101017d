"""Current sensors with an offset: a slow move whose torque passes zero stays one motion."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from opamc_cli.config import load_config
from opamc_cli.config.testbed import load_testbed
from opamc_cli.stages.chain import segment
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.testbed.robot import simulate

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("offset_a", [0.0, 0.15])
def test_an_offset_does_not_cut_a_move_in_two(tmp_path: Path, offset_a: float) -> None:
    testbed = load_testbed(
        ROOT / "configs" / "testbed.yaml",
        ["program.speed_percent=20", "program.payload_kg=1", "program.cycles=2"],
    )
    robot = replace(
        testbed.robot,
        sensor=replace(testbed.robot.sensor, noise_a=0.02, offset_a=offset_a),
        spread=replace(testbed.robot.spread, sensor_offset_a=0.0),
    )
    recording = simulate(
        robot, replace(testbed.program, axes=(2,), order="together"), seed=1, axes=[2]
    )
    phases = recording.axes[2].phases_a
    columns = {f"axis2_{name}": np.ascontiguousarray(phases[:, k]) for k, name in enumerate("abc")}
    save_run(tmp_path / "run.parquet", RunInfo(sampling_rate_hz=2048.0), columns)
    found = segment.run([tmp_path / "run.parquet"], load_config(), tmp_path).table.to_pylist()
    assert len(found) == len(recording.segments)
    for row, truth in zip(found, recording.segments, strict=True):
        assert abs(row["start"] - truth.start) < 0.05 * 2048
        assert abs(row["stop"] - truth.stop) < 0.05 * 2048
