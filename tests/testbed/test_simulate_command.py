"""`opamc simulate` and its configuration, from the outside."""

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from opamc_cli.__main__ import app, main
from opamc_cli.config.testbed import load_testbed
from opamc_cli.errors import ConfigError, ExitCode
from opamc_cli.storage.runs.finding import find_runs
from opamc_cli.storage.runs.run import Run

CONFIGS = Path(__file__).parents[2] / "configs"
SMALL = """
based_on: {base}
program: {{axes: [2, 3], cycles: 1}}
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(SMALL.format(base=CONFIGS / "testbed.yaml"))
    return path


def _simulate(config: Path, out: Path, *options: str):
    arguments = ["simulate", "--config", str(config), "--out", str(out), *options]
    return CliRunner().invoke(app, arguments, catch_exceptions=False)


def test_it_writes_runs_and_the_truth(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    options = ["--seed", "5", "--fault", "3:0.5", "--sessions", "2", "--json"]
    options += ["--set", "effects=[{axis: 2, name: ripple, magnitude: 0.1}]"]
    result = _simulate(config, out, *options)
    assert result.exit_code == 0
    assert len(json.loads(result.stdout)["runs"]) == 2
    truth = json.loads((out / "truth.json").read_text())
    assert truth["seed"] == 5
    first = truth["runs"][0]
    assert [fault["severity"] for fault in first["faults"]] == [0.5]
    assert first["effects"][0]["parameters"]["order"] == 2.0
    assert len(first["segments"]) == 8
    signals = pq.read_table(out / first["signals"])
    assert signals.num_rows == first["n_samples"]
    assert "axis3_iq_a" in signals.column_names
    # the truth's own tables are not taken for runs
    assert [name for name, _ in find_runs([out])] == ["session-000", "session-001"]
    with Run(out / "session-000.parquet") as run:
        assert run.axes == (1, 2, 3, 4, 5, 6)
        assert run.info.sampling_rate_hz == 2048.0
        assert run.info.speed_percent == 100.0
        assert not any("position" in column for column in run.columns)


@pytest.mark.long
def test_workers_do_not_change_the_bytes(config: Path, tmp_path: Path) -> None:
    for name, jobs in (("one", "1"), ("two", "2")):
        result = _simulate(config, tmp_path / name, "--sessions", "2", "--jobs", jobs)
        assert result.exit_code == 0
    written = [path for path in (tmp_path / "one").rglob("*.*") if path.suffix != ".lock"]
    assert len(written) == 5  # two runs, two truth tables, truth.json
    for path in written:
        twin = tmp_path / "two" / path.relative_to(tmp_path / "one")
        assert path.read_bytes() == twin.read_bytes()


def test_drive_reported_runs(config: Path, tmp_path: Path) -> None:
    columns = "recording.columns=[current, position, velocity, temperature]"
    assert _simulate(config, tmp_path / "out", "--set", columns).exit_code == 0
    with Run(tmp_path / "out" / "session-000.parquet") as run:
        channels = run.channels(3)
        assert channels.phases == ()
        assert channels.current == "axis3_current"
        assert channels.position == "axis3_position"
        values = run.read(["axis3_current", "axis3_temperature"])
    assert values["axis3_current"].min() < -0.5 < 0.5 < values["axis3_current"].max()


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("program.cycels=3", "did you mean 'cycles'"),
        ("robot.damage.shar=0.2", "did you mean 'share'"),
        ("program.speed_percent=130", "must lie in 1..100"),
        ("program.payload_kg=-1", "must be 0 or more"),
        ("faults=[{axis: 9}]", "axis 9 does not exist"),
        ("faults=[{axis: 3, severity: 2}]", "severity"),
        ("effects=[{axis: 1, name: ripple}]", "magnitude"),
        ("robot.sensor.noise_a=many", "noise_a"),
        ("program.waypoints_rad=[0.0]", "waypoints_rad"),
        ("robot.joint.gear.ratio=0", "must be positive"),
        ("robot.sensor.noise_a=-1", "must be 0 or more"),
        ("robot.joint.motor.resistance_ohm=.nan", "must be finite"),
        ("program.axes=[3, 3]", "every axis that moves once"),
        ("effects=[{axis: 1, name: gremlin, magnitude: 1}]", "known: asymmetric_friction"),
        (
            "effects=[{axis: 1, name: hysteresis, magnitude: 1, parameters: {width_rad: 0}}]",
            "width_rad is 0; it must be positive",
        ),
        (
            "effects=[{axis: 1, name: sensor_gain, magnitude: 1, parameters: {phase: 3}}]",
            "0, 1 or 2",
        ),
        ("effects=[{axis: 1, name: elasticity, magnitude: 1}]", "below 1"),
    ],
)
def test_what_cannot_be_simulated_is_refused(override: str, message: str) -> None:
    with pytest.raises(ConfigError, match=r"^[^\n]*$") as caught:
        load_testbed(CONFIGS / "testbed.yaml", [override])
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "options",
    [
        ["--set", "effects=[{axis: 1, name: gremlin, magnitude: 1}]"],
        ["--set", "effects=[{axis: 2, name: thermal_viscous, magnitude: 50}]"],
        ["--fault", "three"],
        ["--fault", "3:much"],
    ],
)
def test_refusals_end_in_the_usage_exit_code(
    config: Path, tmp_path: Path, options: list[str]
) -> None:
    out = tmp_path / "o"
    with pytest.raises(SystemExit) as ended:
        main(["simulate", "--config", str(config), "--out", str(out), *options])
    assert ended.value.code == ExitCode.USAGE
    assert not list(out.glob("*.parquet"))


def test_the_shipped_configurations_are_valid() -> None:
    for name in ("testbed.yaml", "samples.yaml"):
        assert load_testbed(CONFIGS / name).robot.joints
