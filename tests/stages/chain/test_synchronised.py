"""What an identified motion is synchronised by."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from opamc_cli.config import load_config
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.storage.runs import RunInfo, save_run

RATE_HZ = 250.0
CYCLES, MOTION, REST = 4, 400, 150


def save(path, delay, seed):
    """Two motions back and forth; a current whose course comes later than the motion."""
    rng = np.random.default_rng(seed)
    way = 0.5 - 0.5 * np.cos(np.pi * np.arange(MOTION) / MOTION)
    still = np.zeros(REST)
    cycle = np.concatenate([still, way, still + 1, 1 - way, still])
    position = np.tile(cycle, CYCLES) + 1e-5 * rng.normal(size=CYCLES * cycle.size)
    speed = np.gradient(np.tile(cycle, CYCLES)) * RATE_HZ
    current = np.roll(np.sign(speed) + speed, delay) + 0.01 * rng.normal(size=speed.size)
    save_run(
        path,
        RunInfo(sampling_rate_hz=RATE_HZ),
        {"axis1_current": current, "axis1_position": position},
    )


@pytest.mark.parametrize("delay", [0, 12])
def test_a_joint_whose_position_is_logged_is_synchronised_by_it(tmp_path, delay):
    save(tmp_path / "baseline/1.parquet", 0, 1)
    save(tmp_path / "target/1.parquet", delay, 2)
    baseline = run_chain([tmp_path / "baseline"], load_config(), tmp_path / "b")
    target = run_chain(
        [tmp_path / "target"], load_config(), tmp_path / "t", reference=baseline.motions
    )
    starts = [
        [row["start"] + row["lag"] for row in pq.read_table(one.motions).to_pylist()]
        for one in (baseline, target)
    ]
    assert len(starts[0]) == len(starts[1]) == 2 * CYCLES
    np.testing.assert_allclose(*starts, atol=2)
