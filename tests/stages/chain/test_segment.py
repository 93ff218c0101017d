"""Stage `segment` on run files: carriers, reported currents, never still, and what it refuses."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from carriers import Move, record

from opamc_cli.config import Config
from opamc_cli.errors import InputError
from opamc_cli.stages.chain import segment
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run, write_run
from opamc_cli.storage.schemas import files

SHARED = Path(__file__).parents[4] / "shared" / "data"
MOVES = [Move(157, 1), Move(157, -1), Move(100, 1), Move(157, -1)]


def columns(axis=1, moves=MOVES, **options):
    recording = record(moves, **{"noise": 0.02, **options})
    phases = dict(zip("abc", recording.phases, strict=True))
    return {f"axis{axis}_{k}": x for k, x in phases.items()}, recording


def config(**options):
    return Config.model_validate({"segment": options})


def run_stage(tmp_path, *runs, jobs=1, **options):
    return segment.run(list(runs), config(**options), tmp_path / "out", jobs=jobs)


def save(path, values, fs_hz=2048.0):
    save_run(path, RunInfo(sampling_rate_hz=fs_hz), values)
    return path


@pytest.fixture
def two_axes(tmp_path):
    first, recording = columns(1, seed=1)
    second, _ = columns(2, seed=2)
    return save(tmp_path / "a.parquet", {**first, **second}), recording


def test_rows_hold_what_the_moves_were(tmp_path, two_axes):
    path, recording = two_axes
    outcome = run_stage(tmp_path, path)
    assert outcome.errors == ()
    rows = outcome.table.to_pylist()
    assert [(r["axis"], r["segment"]) for r in rows] == [(a, s) for a in (1, 2) for s in range(4)]
    for row, (start, stop), move in zip(rows, recording.intervals, MOVES, strict=False):
        assert abs(row["start"] - start) < 60
        assert abs(row["stop"] - stop) < 60
        assert row["f_max_hz"] == pytest.approx(move.f_max_hz, rel=0.02)
        assert row["direction"] == move.direction
        inside = recording.phases[:, row["start"] : row["stop"]].astype(np.float64)
        assert row["variance"] == pytest.approx(inside.var(axis=1).mean())
        assert (row["kind"], row["signal"], row["edge"]) == ("motion", "phases", False)
        assert row["temperature_c"] is None


@pytest.mark.parametrize("seed", range(3))
def test_short_moves_are_found_every_time(tmp_path, seed):
    """Five turns of the current in a quarter of a second: its wavelets see half of that."""
    stroke = [Move(40, k, ramp_s=0.12, cruise_s=0.01, rest_s=0.35) for k in (1, -1, -1, 1)]
    values, recording = columns(moves=stroke * 3, seed=seed)
    rows = run_stage(tmp_path, save(tmp_path / "a.parquet", values)).table.to_pylist()
    assert [r["direction"] for r in rows] == [move.direction for move in stroke * 3]
    for row, (start, stop) in zip(rows, recording.intervals, strict=True):
        # a jerk-limited ramp of 0.12 s has turned by a hundredth in its first third
        assert start - 30 < row["start"] < start + 140
        assert stop - 140 < row["stop"] < stop + 30


def test_moves_shorter_than_asked_are_dropped(tmp_path):
    values, _ = columns(moves=[*MOVES, Move(157, 1, ramp_s=0.04, cruise_s=0.05)])
    path = save(tmp_path / "a.parquet", values)
    assert run_stage(tmp_path, path).table.num_rows == 5
    assert run_stage(tmp_path, path, min_motion_s=0.3).table.num_rows == 4


@pytest.mark.long
def test_result_does_not_depend_on_jobs_or_row_groups(tmp_path, two_axes):
    path, _ = two_axes
    alone = run_stage(tmp_path, path)
    bytes_alone = alone.path.read_bytes()
    assert run_stage(tmp_path, path, jobs=2).path.read_bytes() == bytes_alone

    other = tmp_path / "b" / "a.parquet"
    table = pq.read_table(path)
    other.parent.mkdir()
    with write_run(other, RunInfo(sampling_rate_hz=2048.0), table.schema) as writer:
        for start in range(0, table.num_rows, 999):
            writer.write_table(table.slice(start, 999))
    assert run_stage(tmp_path, other).table.equals(alone.table)


def test_one_phase_is_enough(tmp_path):
    values, recording = columns()
    path = save(tmp_path / "one.parquet", {"axis1_a": values["axis1_a"]})
    rows = run_stage(tmp_path, path).table.to_pylist()
    assert [r["signal"] for r in rows] == ["phase"] * 4
    assert [r["direction"] for r in rows] == [0] * 4
    off = [r["start"] - t[0] for r, t in zip(rows, recording.intervals, strict=True)]
    assert np.median(np.abs(off)) / 2048 < 0.02


def test_motions_cut_by_the_recording_are_marked(tmp_path):
    values, recording = columns()
    middle = sum(recording.intervals[0]) // 2
    end = sum(recording.intervals[3]) // 2
    path = save(tmp_path / "cut.parquet", {k: v[middle:end] for k, v in values.items()})
    rows = run_stage(tmp_path, path).table.to_pylist()
    assert [r["edge"] for r in rows] == [True, False, False, True]
    assert rows[0]["start"] < 60
    assert rows[-1]["stop"] > end - middle - 60


def test_a_recording_that_never_stands_still_is_cut_into_windows(tmp_path):
    t = np.arange(5000) / 1000.0
    values = {
        f"axis1_{p}": (8 * np.cos(2 * np.pi * 60 * t - k * 2 * np.pi / 3)).astype(np.float32)
        for k, p in enumerate("abc")
    }
    path = save(tmp_path / "steady.parquet", values, 1000.0)
    rows = run_stage(tmp_path, path).table.to_pylist()
    assert [(r["kind"], r["edge"]) for r in rows] == [("window", False)] * 4
    for row in rows:
        periods = (row["stop"] - row["start"]) * 60 / 1000
        assert abs(periods - round(periods)) < 0.1
    assert all(r["f_max_hz"] == pytest.approx(60, rel=0.01) for r in rows)
    assert len(run_stage(tmp_path, path, windows=2).table) == 2


@pytest.mark.parametrize("known", ["velocity", "position"])
def test_reported_current_is_cut_by_the_joints_motion(tmp_path, known):
    recording = record(MOVES, fs_hz=1000.0, lead_s=0.5)
    velocity = recording.frequency_hz * 2 * np.pi / 500  # joint side
    values = {
        "axis1_current": np.abs(recording.phases[0]) + np.float32(0.1),
        "axis1_velocity": velocity,
        "axis1_position": np.cumsum(velocity) / 1000.0,
        "axis1_temperature": np.full(velocity.size, 41.5),
    }
    del values["axis1_position" if known == "velocity" else "axis1_velocity"]
    path = save(tmp_path / "drive.parquet", values, 1000.0)
    joint = {"joint": {"gear_ratio": {1: 100, 7: 50}, "pole_pairs": 5}}
    outcome = segment.run([path], Config.model_validate(joint), tmp_path / "out")
    assert "joint.gear_ratio or joint.pole_pairs name axis 7, which no run has" in outcome.notes
    rows = outcome.table.to_pylist()
    assert [r["direction"] for r in rows] == [m.direction for m in MOVES]
    for row, (start, stop), move in zip(rows, recording.intervals, MOVES, strict=True):
        assert abs(row["start"] - start) < 40
        assert abs(row["stop"] - stop) < 40
        assert row["f_max_hz"] == pytest.approx(move.f_max_hz, rel=0.03)
        assert (row["signal"], row["temperature_c"]) == ("reported", 41.5)
    values["axis1_temperature"] = np.full(velocity.size, 850.0)
    broken = save(tmp_path / "broken.parquet", values, 1000.0)
    odd = segment.run([broken], Config.model_validate(joint), tmp_path / "odd")
    assert odd.table.column("temperature_c").null_count == odd.table.num_rows
    n = odd.table.num_rows
    told = f"axis1_temperature is below -60 or above 250 °C in {n} of {n} segments"
    assert any(told in note for note in odd.notes)


@pytest.mark.parametrize("encoder", ["turns", "stands", "missing", "absent"])
def test_a_position_tells_the_motions_that_a_coarse_speed_hides(tmp_path, encoder):
    recording = record(MOVES, fs_hz=1000.0, lead_s=0.5)
    velocity = recording.frequency_hz * 2 * np.pi / 500
    coarse = velocity + 0.4 * np.random.default_rng(0).standard_normal(velocity.size)
    positions = {
        "turns": np.cumsum(velocity) / 1000.0,
        "stands": np.zeros(velocity.size),
        "missing": np.full(velocity.size, np.nan),
    }
    values = {
        "axis1_current": np.abs(recording.phases[0]) + np.float32(0.1),
        "axis1_velocity": coarse,
        **({} if encoder == "absent" else {"axis1_position": positions[encoder]}),
    }
    path = save(tmp_path / "drive.parquet", values, 1000.0)
    if encoder == "turns":
        rows = run_stage(tmp_path, path).table.to_pylist()
        assert [r["direction"] for r in rows] == [m.direction for m in MOVES]
        # a screw's mm: "axis1_velocity is beyond 60 rad/s (up to 87.8)" of one that reaches 109
        by = 80 / np.abs(velocity).max()
        faster = {name: values[name] * (by if "axis1_c" not in name else 1) for name in values}
        notes = run_stage(tmp_path, save(tmp_path / "fast.parquet", faster, 1000.0)).notes
        assert any("column axis1_position (its speed) is beyond 60 rad/s" in n for n in notes)
        assert not any("column axis1_velocity is beyond" in n for n in notes)
        return
    with pytest.raises(InputError, match="no motion was found"):
        run_stage(tmp_path, path)


def test_engine_ssqueezepy_finds_the_same_motions(tmp_path, two_axes):
    path, _ = two_axes
    ours = run_stage(tmp_path, path).table
    theirs = run_stage(tmp_path, path, engine="ssqueezepy").table
    assert ours.column("start").equals(theirs.column("start"))
    assert np.allclose(ours.column("f_max_hz"), theirs.column("f_max_hz"), rtol=1e-3)


def test_some_missing_samples_are_noted_and_passed_over(tmp_path):
    values, _ = columns()
    values["axis1_b"] = values["axis1_b"].copy()
    values["axis1_b"][3000:3004] = [np.nan, np.inf, -np.inf, np.nan]
    outcome = run_stage(tmp_path, save(tmp_path / "gap.parquet", values))
    assert len(outcome.table) == 4
    assert "axis1_b has 4 samples that are no numbers" in outcome.notes[0]


def test_spikes_are_no_measurement_and_passed_over(tmp_path):
    values, _ = columns()
    clean = run_stage(tmp_path, save(tmp_path / "clean.parquet", values)).table
    values["axis1_b"] = values["axis1_b"].copy()
    values["axis1_b"][3000:3003] = [1e4, -2e4, 1500]
    outcome = run_stage(tmp_path, save(tmp_path / "spiked.parquet", values))
    assert "axis1_b has 3 samples of up to 2e+04 A, no measurement" in " ".join(outcome.notes)
    assert outcome.table["start"].equals(clean["start"])
    np.testing.assert_allclose(outcome.table["variance"], clean["variance"], rtol=0.01)


def test_a_clipped_phase_is_noted(tmp_path):
    values, _ = columns()
    values["axis1_a"] = np.clip(values["axis1_a"], -1, 1)
    outcome = run_stage(tmp_path, save(tmp_path / "clip.parquet", values))
    assert len(outcome.table) == 4
    assert "axis1_a looks clipped" in outcome.notes[0]


class TestRefused:
    def refused(self, tmp_path, values, fs_hz=2048.0, **options):
        path = save(tmp_path / "bad.parquet", values, fs_hz)
        with pytest.raises(InputError) as caught:
            run_stage(tmp_path, path, **options)
        assert not (tmp_path / "out" / files.SEGMENTS).exists()
        message = str(caught.value)
        assert "bad.parquet" in message
        assert "\n" not in message
        return message

    def test_constant_phase(self, tmp_path):
        values, recording = columns()
        values["axis1_c"] = np.full(recording.phases.shape[1], 0.5, dtype=np.float32)
        message = self.refused(tmp_path, values)
        assert "axis1_c is constant at 0.5 A" in message

    def test_phase_without_numbers(self, tmp_path):
        values, recording = columns()
        values["axis1_b"] = np.full(recording.phases.shape[1], np.nan, dtype=np.float32)
        assert "axis1_b holds no number" in self.refused(tmp_path, values)

    def test_sampling_rate_too_low_for_motions(self, tmp_path):
        values, _ = columns()
        message = self.refused(tmp_path, values, fs_hz=1.0)
        assert "sampling_rate_hz is 1" in message
        assert "at least 100 Hz" in message

    def test_carrier_too_fast_for_the_sampling_rate(self, tmp_path):
        values, _ = columns(moves=[Move(314)] * 3, fs_hz=700.0)
        message = self.refused(tmp_path, values, fs_hz=700.0)
        assert "record at 1400 Hz or faster" in message

    def test_carrier_too_fast_for_the_band(self, tmp_path):
        values, _ = columns()
        assert "raise segment.f_max_hz" in self.refused(tmp_path, values, f_max_hz=120.0)

    def test_band_beyond_the_sampling_rate(self, tmp_path):
        values, _ = columns()
        assert "at most 819.2" in self.refused(tmp_path, values, f_max_hz=1000.0)

    def test_nothing_moves(self, tmp_path):
        rng = np.random.default_rng(0)
        values = {f"axis1_{p}": rng.standard_normal(20_000) for p in "abc"}
        assert "no motion was found" in self.refused(tmp_path, values)

    def test_reported_current_alone(self, tmp_path):
        message = self.refused(tmp_path, {"axis1_current": np.arange(5000.0)})
        assert "axis1_velocity or axis1_position" in message


def test_one_bad_axis_does_not_stop_the_others(tmp_path):
    first, recording = columns(1)
    second, _ = columns(2)
    second["axis2_a"] = np.full(recording.phases.shape[1], np.nan, dtype=np.float32)
    outcome = run_stage(tmp_path, save(tmp_path / "a.parquet", {**first, **second}))
    assert outcome.table.column("axis").unique() == pa.array([1], pa.int16())
    assert [str(e).count("axis2_a") for e in outcome.errors] == [1]


def test_an_axis_that_stands_still_has_no_rows_and_no_error(tmp_path):
    first, recording = columns(1)
    rng = np.random.default_rng(3)
    for p, level in zip("abc", (1.0, -0.5, -0.5), strict=True):
        first[f"axis2_{p}"] = level + 0.02 * rng.standard_normal(recording.phases.shape[1])
    outcome = run_stage(tmp_path, save(tmp_path / "a.parquet", first))
    assert outcome.errors == ()
    assert set(outcome.table.column("axis").to_pylist()) == {1}


@pytest.mark.measured
@pytest.mark.skipif(not SHARED.exists(), reason="measured recordings are not at ../shared/data")
def test_measured_induction_motor_is_cut_into_windows_of_60_hz(tmp_path):
    file = SHARED / "itsc_phase_current" / "healthy" / "SC_HLT_001.csv"
    data = np.loadtxt(file, delimiter=",", dtype=np.float32)
    values = {f"axis1_{p}": data[:, i].copy() for i, p in enumerate("abc")}
    rows = run_stage(tmp_path, save(tmp_path / "m.parquet", values, 1000.0)).table.to_pylist()
    assert [r["kind"] for r in rows] == ["window"] * 4
    assert all(r["f_max_hz"] == pytest.approx(60, rel=0.03) for r in rows)
