"""A recording that is wrong though it can be read: what `opamc model` and `segment` say of it."""

import json
import re

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from simulator import simulate

from opamc_cli.__main__ import main

RATE = 250.0
OWN, OTHER = (simulate(seed, rate=RATE, kind="trapezoid", cycles=6) for seed in (5, 4))


def write(path, robot=None, **columns):
    size = min(len(values) for values in columns.values())
    table = pa.table({name: pa.array(values[:size]) for name, values in columns.items()})
    record = json.dumps({"sampling_rate_hz": RATE, "robot": robot}).encode()
    pq.write_table(table.replace_schema_metadata({b"opamc": record}), path)
    return path


def opamc(*arguments):
    with pytest.raises(SystemExit) as stopped:
        main([str(argument) for argument in arguments])
    return int(stopped.value.code or 0)


@pytest.fixture
def model(tmp_path):
    def run(step="fit", *more, **columns):
        file = write(tmp_path / "run.parquet", **columns)
        return opamc("model", step, file, "--axis", "1", "--out", tmp_path / "out", *more)

    return run


def test_a_right_recording_has_no_note(model, capsys):
    assert model(axis1_current=OWN.current, axis1_position=OWN.position) == 0
    assert "run.parquet" not in capsys.readouterr().err


@pytest.mark.parametrize(("channel", "by"), [("current", 20.0), ("position", 0.1)])
def test_single_samples_that_leap_are_said(model, capsys, channel, by):
    """They were most of the error, and nobody heard of them."""
    columns = {"current": OWN.current, "position": OWN.position.copy()}
    values = columns[channel].astype(float)
    values[[400, 1300, 2100, 2500]] += by * np.std(values)
    columns[channel] = values
    code = model("fit", "--quiet", **{f"axis1_{name}": own for name, own in columns.items()})
    said = capsys.readouterr().err
    assert code == 0
    assert f"axis1_{channel} leaps in 4 single samples, the first at 1.6 s" in said


@pytest.mark.parametrize(
    ("robots", "other", "refused"),
    [
        (("a", "b"), 1.01, "the runs are of 2 robots (a, b)"),
        (("a", "a"), 1.0, "holds the same current as"),
        ((None, "a"), 1.01, None),
    ],
    ids=["robots", "copies", "one robot"],
)
def test_runs_that_are_not_of_one_joint_or_copies_are_refused(
    tmp_path, capsys, robots, other, refused
):
    """A copy had what is sealed in the other searched."""
    files = [
        write(
            tmp_path / f"{number}.parquet",
            robot=robot,
            axis1_current=OWN.current * (other if number else 1.0),
            axis1_position=OWN.position,
        )
        for number, robot in enumerate(robots)
    ]
    code = opamc("model", "fit", *files, "--axis", "1", "--out", tmp_path / "out", "--quiet")
    said = " ".join(capsys.readouterr().err.split())
    assert code == (0 if refused is None else 3)
    assert refused is None or refused in said


def test_another_joints_position_is_named(model, capsys):
    code = model(
        axis1_current=OWN.current,
        axis1_position=OTHER.position,
        axis2_current=OTHER.current,
        axis2_position=OWN.position,
    )
    assert code == 0
    said = capsys.readouterr().err
    assert "axis1_current follows the motion of axis2_position" in said


@pytest.mark.parametrize("noise", [0.0, 1e-7], ids=["copied", "in step"])
def test_one_position_in_two_columns_is_said(model, capsys, noise):
    """Joints that move in step differ in the last digits, and may be what they are called."""
    other = OWN.position + noise * np.random.default_rng(1).normal(size=OWN.position.size)
    assert model(axis1_current=OWN.current, axis1_position=OWN.position, axis2_position=other) == 0
    said = "axis1_position and axis2_position hold the same numbers" in capsys.readouterr().err
    assert said == (noise == 0)


def test_a_speed_of_another_joint_is_refused(model, capsys):
    speed = np.gradient(OTHER.position) * RATE
    code = model(axis1_current=OWN.current, axis1_position=OWN.position, axis1_velocity=speed)
    assert code == 3
    assert "axis1_velocity is not the rate of change of axis1_position" in capsys.readouterr().err


def test_a_speed_that_is_commanded_is_said_and_left_out(model, tmp_path, capsys):
    """The joint follows its command 30 ms late: samples in motion would be another's."""
    ahead = round(0.03 * RATE)
    speed = np.roll(np.gradient(OWN.position) * RATE, -ahead)[:-ahead]
    columns = {"axis1_current": OWN.current, "axis1_position": OWN.position}
    assert model("fit", "--quiet", axis1_velocity=speed, **columns) == 0
    said = capsys.readouterr().err
    assert re.search(r"axis1_velocity is \d+\.\d% off the rate of change of the position", said)
    beside = pq.read_table(tmp_path / "out" / "fit.parquet")
    assert model("fit", **{name: own[:-ahead] for name, own in columns.items()}) == 0
    assert pq.read_table(tmp_path / "out" / "fit.parquet").equals(beside)


def test_missing_samples_are_said_by_model_and_segment(model, tmp_path, capsys):
    kept = np.random.default_rng(0).random(OWN.position.size) > 0.03
    columns = {"axis1_current": OWN.current[kept], "axis1_position": OWN.position[kept]}
    assert model(**columns) == 0
    assert "samples seem to be missing" in capsys.readouterr().err
    file = write(tmp_path / "run.parquet", **columns)
    assert opamc("segment", file, "--out", tmp_path / "out", "--quiet") == 0
    assert opamc("segment", file, "--out", tmp_path / "other") == 0
    assert "samples seem to be missing" in capsys.readouterr().err


def test_an_angle_that_wraps_by_less_than_a_turn_is_refused(model, capsys):
    turns = OWN.position / (2 * np.pi)
    wrapped = (turns - np.median(turns)) % 1.0
    assert model(axis1_current=OWN.current, axis1_position=wrapped) == 3
    assert "an angle that wraps, in turns?" in capsys.readouterr().err


def test_two_clocks_and_a_late_position_are_said(model, capsys):
    place = np.arange(OWN.position.size)
    drifting = np.interp(place * 0.997, place, OWN.position)
    assert model(axis1_current=OWN.current, axis1_position=drifting) == 0
    assert "two clocks of different rates?" in capsys.readouterr().err
    late = np.interp(place - 0.2 * RATE, place, OWN.position)
    assert model(axis1_current=OWN.current, axis1_position=late) == 0
    assert re.search("comes (199|20.) ms after the motion", capsys.readouterr().err)


def test_numbers_that_few_joints_have_are_said(model, capsys):
    large = OWN.current * 300.0 / np.abs(OWN.current).max()
    times = np.where(np.arange(large.size) % 3 == 0, 1.0, 0.98)
    assert model(axis1_current=large * times, axis1_position=OWN.position) == 0
    assert "mA taken for A?" in capsys.readouterr().err
    kelvin = np.full(large.size, 300.0)
    columns = {"axis1_position": OWN.position, "axis1_temperature": kelvin}
    assert model(axis1_current=OWN.current, **columns) == 0
    assert "axis1_temperature is below -60 or above 250 °C in 100%" in capsys.readouterr().err


@pytest.mark.long
def test_a_current_that_reaches_its_limit_is_said(model, capsys):
    limit = 0.6 * np.abs(OWN.current).max()
    clipped = np.clip(OWN.current, -limit, limit)
    assert model(axis1_current=clipped, axis1_position=OWN.position) == 0
    assert "axis1_current is clipped in" in capsys.readouterr().err


def test_a_current_that_comes_less_often_than_the_samples_is_said(model, capsys):
    """An eccentric's was late by up to 0.1 s, and had the names of a payload and of a drag."""
    held = np.repeat(OWN.current[::10], 10)
    assert model(axis1_current=held, axis1_position=OWN.position) == 0
    said = "axis1_current holds each value for 10 samples, up to 0.04 s late beside the rest"
    assert said in " ".join(capsys.readouterr().err.split())


def test_gravity_of_another_scale_is_said_where_no_effect_explains_it(model, tmp_path, capsys):
    code = model("close", "--quiet", axis1_current=OWN.current, axis1_position=OWN.position / 100)
    assert code == 0
    (entry,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    (note,) = [note for note in entry["notes"] if "gravity in axis1_current" in note]
    assert entry["doubts"] == [note]
    assert f"opamc: {note}\n" in capsys.readouterr().err
