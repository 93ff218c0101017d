"""The three measured recordings, which are not part of the project."""

import csv
from pathlib import Path

import numpy as np
import pytest

from opamc_cli.stages.recordings import ingest
from opamc_cli.storage.ingest.map.load import load_map
from opamc_cli.storage.runs.run import Run

ROOT = Path(__file__).parents[3]
DATA = ROOT.parent / "shared" / "data"
MAPS = ROOT / "configs" / "maps"

pytestmark = [
    pytest.mark.measured,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no measured recordings in {DATA}"),
]


def ingested(tmp_path, files, name):
    outcome = ingest.run(files, load_map(MAPS / f"{name}.yaml"), tmp_path)
    assert not outcome.errors, outcome.errors
    return outcome.results


def columns_of(file, delimiter=",", decimal="."):
    with file.open(encoding="utf-8", newline="") as handle:
        rows = list(csv.DictReader(handle, delimiter=delimiter))
    return lambda name: np.array([float(row[name].replace(decimal, ".") or "nan") for row in rows])


def test_itsc_phase_currents(tmp_path):
    files = sorted((DATA / "itsc_phase_current").glob("*/*.csv"))
    assert len(files) == 25
    for item in ingested(tmp_path, files, "itsc"):
        run = Run(item.run)
        assert (run.sampling_rate_hz, run.n_samples, run.axes) == (1000, 5000, (1,))
        assert not item.missing
        currents = np.stack([*run.read(["axis1_a", "axis1_b", "axis1_c"]).values()])
        np.testing.assert_array_equal(
            currents, np.loadtxt(item.source, delimiter=",").T.astype(np.float32)
        )
        # three phases without a neutral line, a 60 Hz supply
        assert np.abs(currents.mean(axis=1)).max() < 0.01
        spectrum = np.abs(np.fft.rfft(currents[0]))
        assert np.argmax(spectrum[1:]) + 1 == 60 * 5


@pytest.mark.parametrize(
    ("name", "n_samples"),
    [
        ("RunTrajectory1", 1942),
        ("Trajectory1", 1942),
        ("joint_5_trapez", 5854),
        ("joint_6_trapez", 5832),
    ],
)
def test_kinova_joints(tmp_path, name, n_samples):
    file = DATA / "kinova_gen3" / f"{name}.csv"
    (item,) = ingested(tmp_path, [file], "kinova_gen3")
    run = Run(item.run)
    assert (run.sampling_rate_hz, run.n_samples) == (1000, n_samples)
    assert run.axes == (1, 2, 3, 4, 5, 6, 7)
    assert not item.missing
    assert item.stamps.even
    column = columns_of(file)
    for axis in run.axes:
        channels = run.channels(axis)
        assert not channels.phases
        for kind, source in (
            (channels.current, "Cur"),
            (channels.position, "Position"),
            (channels.velocity, "Velocity"),
            (channels.columns["temperature"], "Temp"),
        ):
            assert kind is not None
            values = run.read([kind])[kind]
            np.testing.assert_array_equal(values, column(f"{source}{axis}").astype(values.dtype))
        assert run.read([channels.position])[channels.position].dtype == np.float64


def test_kinova_velocity_is_the_derivative_of_position(tmp_path):
    (item,) = ingested(tmp_path, [DATA / "kinova_gen3" / "joint_5_trapez.csv"], "kinova_gen3")
    data = Run(item.run).read(["axis5_position", "axis5_velocity"])
    travelled = data["axis5_position"][-1] - data["axis5_position"][0]
    assert data["axis5_velocity"].sum() / 1000 == pytest.approx(travelled, rel=0.01)


def test_ur3_once_a_second(tmp_path):
    file = DATA / "ur3_cobotops" / "dataset_head1500.csv"
    (item,) = ingested(tmp_path, [file], "ur3_cobotops")
    run = Run(item.run)
    assert run.sampling_rate_hz == 1
    assert run.axes == (1, 2, 3, 4, 5, 6)
    assert run.info.started_at == "2022-10-26T08:17:21.847000Z"
    stamps = item.stamps
    assert not stamps.even
    assert (stamps.n_gaps, stamps.n_bridged) == (2, 5)
    assert stamps.longest_gap_s == pytest.approx(31.15)
    assert run.n_samples == 1549
    current = run.read(["axis2_current"])["axis2_current"]
    assert current[0] == pytest.approx(-2.024668694)
    # five rows without values, 38 seconds of gaps
    assert item.missing["axis2_current"] == np.isnan(current).sum() == 51
    source = columns_of(file, ";", ",")("Current_J1")
    assert np.nanmean(current) == pytest.approx(np.nanmean(source), abs=0.02)
