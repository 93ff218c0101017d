"""What motions are identified and synchronised by, and how a reported current is read."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from opamc_cli.config import load_config
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.chain.witnesses import spectrum
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run

RATE_HZ = 250.0
CYCLES, MOTION, REST = 4, 400, 150


def save(path, delay, seed, back=MOTION, turn=np.inf):
    """Two motions there and back; a current whose course comes later than the motion."""
    rng = np.random.default_rng(seed)
    way, home = (0.5 - 0.5 * np.cos(np.pi * np.arange(n) / n) for n in (MOTION, back))
    still = np.zeros(REST)
    cycle = np.concatenate([still, way, still + 1, 1 - home, still])
    position = np.tile(cycle, CYCLES) + 1e-5 * rng.normal(size=CYCLES * cycle.size)
    speed = np.gradient(np.tile(cycle, CYCLES)) * RATE_HZ
    current = np.roll(np.sign(speed) + speed, delay) + 0.01 * rng.normal(size=speed.size)
    save_run(
        path,
        RunInfo(sampling_rate_hz=RATE_HZ),
        {"axis1_current": current, "axis1_position": np.mod(position + 5.5, turn)},
    )


@pytest.mark.parametrize(("delay", "turn"), [(0, np.inf), (12, np.inf), (12, 2 * np.pi)])
def test_a_joint_whose_position_is_logged_is_synchronised_by_it(tmp_path, delay, turn):
    """A position that begins anew at a whole turn had motions laid on one another at random."""
    save(tmp_path / "baseline/1.parquet", 0, 1)
    save(tmp_path / "target/1.parquet", delay, 2, turn=turn)
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


def save_phases(path, friction, seed):
    """The same motion in phases; with less friction its current comes through zero earlier."""
    rng = np.random.default_rng(seed)
    n = 1200
    way = 0.5 - 0.5 * np.cos(np.pi * np.arange(n) / n)
    cycle = np.concatenate([np.zeros(300), way, np.ones(300), 1 - way])
    angle = 2 * np.pi * 20 * np.tile(cycle, CYCLES)
    speed = np.gradient(angle)
    acceleration = np.gradient(speed)
    current = acceleration / abs(acceleration).max() + friction * speed / speed.max()
    turns = angle[:, None] - 2 * np.pi / 3 * np.arange(3)
    phases = current[:, None] * np.cos(turns) + 0.005 * rng.normal(size=(angle.size, 3))
    columns = {f"axis1_{name}": one for name, one in zip("abc", phases.T, strict=True)}
    save_run(path, RunInfo(sampling_rate_hz=1000.0), columns)


def test_phases_are_synchronised_by_how_far_they_turn(tmp_path):
    """By the course of the envelope, which friction bends, the way there was 0.1 s off."""
    save_phases(tmp_path / "baseline/1.parquet", 1.5, 1)
    save_phases(tmp_path / "target/1.parquet", 0.4, 2)
    baseline = run_chain([tmp_path / "baseline"], load_config(), tmp_path / "b")
    target = run_chain(
        [tmp_path / "target"], load_config(), tmp_path / "t", reference=baseline.motions
    )
    own, other = (
        [row for row in pq.read_table(one.motions).to_pylist() if row["motion"] >= 0]
        for one in (baseline, target)
    )
    places = {row["segment"]: row["start"] + row["lag"] for row in own}
    apart = [row["start"] + row["lag"] - places[row["segment"]] for row in other]
    assert len(apart) >= CYCLES
    assert max(map(abs, apart)) <= 10


def test_the_reference_is_the_cycle_that_most_recordings_hold(tmp_path):
    """The first one is odd: its way back is half as long."""
    for number in range(4):
        save(tmp_path / f"runs/{number}.parquet", 0, number, MOTION if number else MOTION // 2)
    done = run_chain([tmp_path / "runs"], load_config(), tmp_path / "out")
    found = {
        (row["run"], row["reference"])
        for row in pq.read_table(done.motions).to_pylist()
        if row["motion"] >= 0
    }
    assert {run for run, _ in found} == {"1", "2", "3"}
    assert [run for run, is_reference in found if is_reference] == ["1"]


def test_a_reported_current_keeps_its_sign_in_its_spectrum():
    """Moved by a hundredth of an ampere it passes zero elsewhere, and that is no fluctuation."""
    rng = np.random.default_rng(0)
    current = np.cos(np.pi * np.arange(800) / 800) + 1e-3 * rng.normal(size=800)
    config = load_config().patterns
    power = [
        np.array(spectrum.kept(moved, moved, RATE_HZ, config)["log_power"])
        for moved in (current, current + 0.01)
    ]
    np.testing.assert_allclose(*power, atol=0.01)
