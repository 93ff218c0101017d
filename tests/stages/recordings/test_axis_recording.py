"""One axis of a run, as a model needs it."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from opamc_cli.errors import InputError
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.stages.recordings.axis_recording import read_recording, resisted, with_signs
from opamc_cli.stages.recordings.mistaken import mistaken
from opamc_cli.storage.runs.run import Run

ANGLE = 2 * np.pi * 7 * np.arange(4000) / 1000
PHASES = {name: np.cos(ANGLE - k * 2 * np.pi / 3) for k, name in enumerate("abc")}


def logged(path, **columns):
    table = pa.table({f"axis1_{name}": pa.array(own) for name, own in columns.items()})
    record = json.dumps({"sampling_rate_hz": 1000.0}).encode()
    pq.write_table(table.replace_schema_metadata({b"opamc": record}), path)
    return path


@pytest.mark.parametrize("left_out", list(PHASES))
def test_two_phases_are_three(tmp_path, left_out):
    """A motor has no neutral conductor; what is wrong with one of two is said of that one."""
    two = {name: own.copy() for name, own in PHASES.items() if name != left_out}
    with Run(logged(tmp_path / "run.parquet", **two)) as run:
        read = read_recording(run, 1)
    np.testing.assert_allclose(read.phases_a, np.stack(list(PHASES.values()), axis=1), atol=1e-12)
    spiked = min(two)
    two[spiked][[700, 1900, 3100]] += 20.0
    with Run(logged(tmp_path / "spiked.parquet", **two)) as run:
        notes = mistaken(run, 1, read_recording(run, 1))
    assert [note.split()[1] for note in notes if "leaps" in note] == [f"axis1_{spiked}"]


def test_a_logged_current_is_taken_before_two_phases(tmp_path):
    two = {name: PHASES[name] for name in "ab"}
    file = logged(tmp_path / "run.parquet", current=PHASES["c"], position=ANGLE, **two)
    with Run(file) as run:
        read = read_recording(run, 1)
    assert read.phases_a is None
    np.testing.assert_array_equal(read.current_a, PHASES["c"])


def test_one_phase_is_refused(tmp_path):
    with (
        Run(logged(tmp_path / "run.parquet", a=PHASES["a"], position=ANGLE)) as run,
        pytest.raises(InputError, match=r"has 1 phase current.*or two phases or three"),
    ):
        read_recording(run, 1)


def test_a_current_that_keeps_its_sign_in_one_recording_is_no_modulus(tmp_path):
    """Of one of six the model got a current with the speed's sign, and friction + 30 % no cause."""
    speed = np.tile(np.r_[np.zeros(100), np.sin(np.linspace(0, 2 * np.pi, 400))], 4)
    friction, place = 2.0 * np.sign(speed) + 0.3 * speed, np.cumsum(speed) / 100.0

    def read(*currents):
        found = []
        for number, current in enumerate(currents):
            file = logged(tmp_path / f"{number}.parquet", current=current, position=place)
            with Run(file) as run:
                found.append(read_recording(run, 1))
        return [one.current_a for one in with_signs(found)]

    for logs in ([abs(friction), friction, friction], [abs(friction), friction]):
        for own, logged_as in zip(read(*logs), logs, strict=True):
            np.testing.assert_allclose(own, logged_as, atol=1e-6)
    for own in read(abs(friction), abs(friction), friction):
        assert own.min() < -1.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_current_that_would_be_driven_by_friction_is_turned_round(sign):
    """A brake that dragged was called a lost preload: less of a friction below nought."""
    rng, time = np.random.default_rng(4), np.arange(4000) / 200
    place, speed = np.sin(time), np.cos(time)
    resists = 0.5 * np.sign(speed) + 0.2 * speed + 2 * np.sin(place) + rng.normal(0, 0.05, 4000)
    found = resisted([Recording("run", 200.0, current_a=sign * resists, position_rad=place)])
    np.testing.assert_array_equal(found[0].current_a, resists)
    # the place alone tells which way is which
    alone = Recording("run", 200.0, current_a=-resists, velocity_rad_s=speed)
    assert resisted([alone]) == [alone]
