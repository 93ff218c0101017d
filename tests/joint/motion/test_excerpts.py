import numpy as np
import pytest

from opamc_cli.joint.motion import recordings
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.recordings import excerpts, grouped_track
from opamc_cli.joint.motion.track import Joint


def stroke(rest_s, seconds, name="run", rate=200.0):
    time = np.arange(round(seconds * rate)) / rate
    place = np.where(time < rest_s, 0.0, 1 - np.cos(2.0 * (time - rest_s)))
    return Recording(name, rate, current_a=np.sin(time), position_rad=place)


@pytest.fixture
def enough(monkeypatch):
    monkeypatch.setattr(recordings, "ENOUGH_SAMPLES", 4000)
    return 4000


def test_what_is_short_enough_is_taken_whole(enough):
    run = stroke(rest_s=2.0, seconds=enough / 200.0)
    track, _ = grouped_track([run], Joint())
    (found,) = excerpts([run], track)
    np.testing.assert_array_equal(found.position_rad, run.position_rad)


def test_of_one_long_run_so_much_is_taken_from_the_first_motion_on(enough):
    run = stroke(rest_s=30.0, seconds=90.0)
    track, _ = grouped_track([run], Joint())
    (found,) = excerpts([run], track)
    first = int(np.argmax(track.moving)) - 1
    assert first >= 30 * 200 - 10
    np.testing.assert_array_equal(found.current_a, run.current_a[first : first + enough])


def test_of_many_runs_whole_ones_are_taken_evenly(enough):
    runs = [stroke(rest_s=0.5, seconds=5.0, name=f"run {i}") for i in range(12)]
    track, _ = grouped_track(runs, Joint())
    found = excerpts(runs, track)
    assert [run.size for run in found] == [1000] * 4
    assert [run.name for run in found] == ["run 0", "run 4", "run 7", "run 11"]
