"""Recordings of other programs, and the maps that are guessed for them, end in the same run."""

from pathlib import Path

import foreign
import numpy as np
import pytest
import yaml

from opamc_cli.errors import ConfigError, InputError
from opamc_cli.stages.recordings import ingest
from opamc_cli.storage.ingest.guess.write import guess_map
from opamc_cli.storage.ingest.map.load import load_map
from opamc_cli.storage.runs.run import Run

LATE = 0.6
"""Of a sample's period: what the logger's clock comes early or late by, from end to end."""


def by_map(tmp_path, text, files, *overrides, out="out"):
    path = tmp_path / "map.yaml"
    path.write_text(text)
    return ingest.run(files, load_map(path, overrides), tmp_path / out)


def only_run(outcome):
    assert not outcome.errors, outcome.errors
    (item,) = outcome.results
    return Run(item.run)


def check(run, recorded, current_within=0.1):
    """Check six axes against what was recorded, at the stamps of the run's own grid."""
    assert run.axes == (1, 2, 3, 4, 5, 6)
    grid = recorded.time_s[0] + np.arange(run.n_samples) / run.sampling_rate_hz
    inner = slice(5, -5)
    for axis in run.axes:
        data = run.read([f"axis{axis}_position", f"axis{axis}_current"])
        angle = np.interp(grid, recorded.time_s, recorded.angle[:, axis - 1])
        np.testing.assert_allclose(data[f"axis{axis}_position"][inner], angle[inner], atol=2e-3)
        current = np.interp(grid, recorded.time_s, recorded.current[:, axis - 1])
        error = data[f"axis{axis}_current"][inner] - current[inner]
        assert np.sqrt(np.mean(error**2)) < current_within


def test_a_log_of_a_universal_robot(tmp_path):
    recorded = foreign.recording(jitter=LATE)
    file = foreign.ur_csv(tmp_path / "log.csv", recorded)
    text = guess_map([file])
    guessed = yaml.safe_load(text.replace("{n-1}", "N").replace("{n}", "N"))
    assert guessed["columns"]["axisN_current"] == {"source": "actual_current_N", "unit": "A"}
    assert guessed["columns"]["axisN_position"]["unit"] == "rad"
    assert guessed["columns"]["axisN_velocity"]["source"] == "actual_qd_N"
    assert guessed["time"] == {"source": "timestamp", "unit": "s"}
    assert guessed["resample_hz"] == pytest.approx(125, rel=0.01)
    assert "target_q" in text  # said to be passed over
    run = only_run(by_map(tmp_path, text, [file]))
    check(run, recorded)
    assert run.info.current_unit == "A"


def test_shipped_maps_are_known_by_name_and_optional_channels_may_lack(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recorded = foreign.recording(jitter=LATE)
    file = foreign.ur_csv(tmp_path / "log.csv", recorded)
    text = file.read_text().replace("joint_temperatures", "other")
    file.write_text(text)
    run = only_run(ingest.run([file], load_map(Path("ur_rtde")), tmp_path))
    check(run, recorded)
    assert not any("temperature" in name for name in run.columns)
    with pytest.raises(ConfigError, match=r"not shipped; shipped maps: .*ur_rtde"):
        load_map(Path("ur_rtd"))


@pytest.mark.parametrize("ending", ["parquet", "feather"])
def test_tables_of_lists_in_degrees_and_milliampere(tmp_path, ending):
    recorded = foreign.recording(jitter=LATE)
    file = foreign.foreign_parquet(tmp_path / f"log.{ending}", recorded)
    text = guess_map([file])
    assert "axis{n}_current: {source: motor_current, index: {n-1}, unit: mA}" in text
    assert "axis{n}_position: {source: joint_angle, index: {n-1}, unit: deg}" in text
    assert "axis{n}_velocity: {source: joint_speed, index: {n-1}, unit: deg/s}" in text
    run = only_run(by_map(tmp_path, text, [file], 'metadata.robot={source: "@robot"}'))
    check(run, recorded)
    assert run.info.robot == "arm 7"
    assert run.info.started_at.startswith("2026-03-01T08:00:00")


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_ros_bags_map_by_themselves_and_their_effort_is_a_torque(tmp_path, storage):
    recorded = foreign.recording(jitter=0.05)
    bag = foreign.bag(tmp_path / "bag", recorded, storage=storage)
    outcome = ingest.run([bag], load_map(Path("ros_joint_state")), tmp_path / "out")
    run = only_run(outcome)
    check(run, recorded)
    assert run.info.current_unit == "Nm"
    assert run.info.started_at.startswith("2026-02-25")
    assert outcome.results[0].sources["axis3_current"] == "elbow/effort"
    declared = load_map(Path("ros_joint_state"), ["columns.axis{n}_current.unit=A"])
    run = only_run(ingest.run([bag], declared, tmp_path / "declared"))
    assert run.info.current_unit == "A"


def test_joints_of_a_bag_are_guessed_by_their_names(tmp_path):
    recorded = foreign.recording(jitter=0.05)
    bag = foreign.bag(tmp_path / "bag", recorded, topic="/arm/states")
    text = guess_map([bag])
    assert "axis3_current: {source: /arm/states/elbow/effort, unit: Nm}" in text
    assert "axis4_position: {source: /arm/states/wrist_1/position, unit: rad}" in text
    check(only_run(by_map(tmp_path, text, [bag])), recorded)


def test_measurement_files_of_asam(tmp_path):
    recorded = foreign.recording()
    file = foreign.mdf(tmp_path / "log.mf4", recorded)
    text = guess_map([file])
    assert "axis{n}_position: {source: Axis{n}_Angle, unit: deg}" in text
    run = only_run(by_map(tmp_path, text, [file]))
    check(run, recorded)
    assert run.sampling_rate_hz == 125
    assert run.info.started_at is not None


@pytest.mark.parametrize("name", ["log.parquet", "log.feather", "log.mcap", "log.bag", "log.mf4"])
def test_rubbish_is_refused_in_a_sentence(tmp_path, name):
    file = tmp_path / name
    file.write_bytes(b"not one of these")
    text = "time: {source: t, unit: s}\ncolumns: {axis1_a: {source: x, unit: A}}\n"
    outcome = by_map(tmp_path, text, [file])
    (error,) = outcome.errors
    assert isinstance(error, InputError)
    assert str(file) in str(error)


def test_a_missing_library_is_named_with_its_extra(tmp_path, monkeypatch):
    import sys

    recorded = foreign.recording(seconds=1)
    bag = foreign.bag(tmp_path / "bag", recorded)
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    outcome = ingest.run([bag], load_map(Path("ros_joint_state")), tmp_path / "out")
    assert "pip install 'opamc[ros]'" in str(outcome.errors[0])


@pytest.mark.long
def test_recordings_whose_rates_differ_by_jitter_end_at_one(tmp_path):
    rates = (93.3, 96.0)
    files = [
        foreign.ur_csv(tmp_path / f"{rate}.csv", foreign.recording(rate, jitter=LATE))
        for rate in rates
    ]
    plain = load_map(Path("ur_rtde"))
    outcome = ingest.run(files, plain, tmp_path / "plain")
    note = ingest.rates_note(outcome.results)
    assert "93.3" in note
    assert "resample_hz=94.6" in note
    for item, rate in zip(outcome.results, rates, strict=True):
        assert item.sampling_rate_hz == pytest.approx(rate, rel=1e-3)
    text = guess_map(files)
    outcome = by_map(tmp_path, text, files, out="guessed")
    assert ingest.rates_note(outcome.results) is None
    for item, rate in zip(outcome.results, rates, strict=True):
        check(Run(item.run), foreign.recording(rate, jitter=LATE))


def test_even_stamps_and_rows_without_stamps_are_resampled_too(tmp_path):
    recorded = foreign.recording(100)
    file = foreign.ur_csv(tmp_path / "log.csv", recorded, start=0.0)
    run = only_run(
        ingest.run([file], load_map(Path("ur_rtde"), ["resample_hz=96"]), tmp_path / "a")
    )
    assert run.sampling_rate_hz == 96
    check(run, recorded)
    overrides = ["resample_hz=96", "time=null", "sampling_rate_hz=100"]
    run = only_run(ingest.run([file], load_map(Path("ur_rtde"), overrides), tmp_path / "b"))
    check(run, recorded)
    outcome = ingest.run([file], load_map(Path("ur_rtde"), ["resample_hz=50"]), tmp_path / "c")
    assert "would alias" in str(outcome.errors[0])


def test_what_is_done_is_skipped_and_what_has_changed_is_not(tmp_path):
    recorded = foreign.recording(seconds=2)
    file = foreign.ur_csv(tmp_path / "log.csv", recorded)
    channels = load_map(Path("ur_rtde"))
    first = ingest.run([file], channels, tmp_path / "out")
    written = first.results[0].run.stat().st_mtime_ns
    again = ingest.run([file], channels, tmp_path / "out")
    assert again.results[0].skipped
    assert again.results[0].n_samples == first.results[0].n_samples
    assert first.results[0].run.stat().st_mtime_ns == written
    other = ingest.run([file], load_map(Path("ur_rtde"), ["resample_hz=120"]), tmp_path / "out")
    assert not other.results[0].skipped
    assert other.results[0].replaced
    foreign.ur_csv(file, foreign.recording(seconds=3))
    assert not ingest.run([file], channels, tmp_path / "out").results[0].skipped


def test_folders_patterns_and_addresses(tmp_path):
    folder = tmp_path / "logs"
    (folder / "monday").mkdir(parents=True)
    (folder / "tuesday").mkdir()
    recorded = foreign.recording(seconds=2)
    for day in ("monday", "tuesday"):
        foreign.ur_csv(folder / day / "log.csv", recorded)
    (folder / "notes.docx").write_text("no recording")
    channels = load_map(Path("ur_rtde"), ["metadata.program=pick"])
    outcome = ingest.run([folder], channels, tmp_path / "out")
    assert not outcome.errors
    expected = {tmp_path / "out" / day / "log.parquet" for day in ("monday", "tuesday")}
    assert {item.run for item in outcome.results} == expected
    outcome = ingest.run([f"{folder}/mon*/*.csv"], channels, tmp_path / "pattern")
    assert [item.run for item in outcome.results] == [tmp_path / "pattern" / "log.parquet"]
    address = f"file://{folder}"
    outcome = ingest.run([address], channels, tmp_path / "remote")
    assert not outcome.errors
    assert {item.source for item in outcome.results} == {
        f"{address}/{day}/log.csv" for day in ("monday", "tuesday")
    }
    with pytest.raises(InputError, match="nothing matches"):
        ingest.run([f"{folder}/*.mat"], channels, tmp_path / "none")
    with pytest.raises(InputError, match="cannot be reached"):
        ingest.run([f"file://{tmp_path}/none.csv"], channels, tmp_path / "none")


def test_guesses_that_cannot_be_made_are_refused(tmp_path):
    text = tmp_path / "letter.csv"
    text.write_text("Dear Sir,\nno numbers here\n")
    with pytest.raises(InputError, match="no rows of numbers"):
        guess_map([text])
    text.write_text("time,height\n0.00,1\n0.01,2\n0.02,3\n0.03,4\n")
    with pytest.raises(InputError, match="no channel looks like a motor current"):
        guess_map([text])
    text.write_text("")
    with pytest.raises(InputError, match="is empty"):
        guess_map([text])
    with pytest.raises(InputError, match=r"none.csv: no such file; check the path"):
        guess_map([tmp_path / "none.csv"])
    with pytest.raises(InputError, match="ending does not tell"):
        guess_map([tmp_path / "log.xyz"])


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("axis{n}_a: {source: x, unit: A}", "{n} stands on one side only"),
        ("axis1_a: {source: 'x_{n}', unit: A}", "{n} stands on one side only"),
        ("axis{n}_foo: {source: 'x_{n}', unit: A}", "is not a column of a run"),
        ("axis1_a: {source: x, unit: Nm}", "a torque stands for axisN_current alone"),
        (
            "axis1_current: {source: x, unit: Nm}\n  axis2_current: {source: y, unit: A}",
            "is a torque, columns.axis2_current a current",
        ),
    ],
)
def test_maps_that_cannot_be(tmp_path, text, part):
    path = tmp_path / "map.yaml"
    path.write_text(f"sampling_rate_hz: 100\ncolumns:\n  {text}\n")
    with pytest.raises(ConfigError) as refused:
        load_map(path)
    assert part in str(refused.value)


def test_a_guess_leaves_channels_that_were_logged_at_another_rate(tmp_path):
    from asammdf import MDF, Signal

    recorded = foreign.recording()
    file = foreign.mdf(tmp_path / "log.mf4", recorded)
    slow = recorded.time_s[::50]
    with MDF(file) as log:
        log.append([Signal(30 + slow, slow, unit="degC", name="Axis1_Temp")])
        log.save(tmp_path / "two.mf4", overwrite=True)
    text = guess_map([tmp_path / "two.mf4"])
    assert "# not used: Axis#_Temp" in text
    check(only_run(by_map(tmp_path, text, [tmp_path / "two.mf4"])), recorded)
