"""Recordings of one joint together: groups, cycles, places that are revisited, excerpts."""

from dataclasses import replace

import numpy as np
import pytest

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.motion import recordings
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.recordings import (
    FEWEST_MOVING_SAMPLES,
    excerpts,
    grouped_track,
    is_moving,
)
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


def test_a_joint_moves_if_enough_samples_do_and_it_gets_somewhere():
    track, _ = grouped_track([stroke(rest_s=1.0, seconds=6.0)], Joint())
    assert is_moving(track)
    few = np.zeros(track.size, dtype=bool)
    few[300 : 300 + FEWEST_MOVING_SAMPLES] = True
    assert is_moving(replace(track, moving=few))
    few[300] = False
    assert not is_moving(replace(track, moving=few))
    assert not is_moving(replace(track, position_rad=track.position_rad * 4e-5))


def test_cycles_are_counted_over_all_recordings():
    time = np.arange(4000) / 200.0
    runs = [
        Recording(f"run {k}", 200.0, current_a=np.sin(time), position_rad=np.sin(np.pi / 2 * time))
        for k in range(2)
    ]
    _, grouping = grouped_track(runs, Joint())
    assert grouping is not None
    assert grouping.kind == "cycles"
    assert grouping.names[:2] == ("run 0:0", "run 0:1")


@pytest.mark.parametrize(("strokes", "known"), [(1, False), (2, False), (4, True)])
def test_places_are_revisited_where_the_path_is_three_times_the_travel(strokes, known):
    part = np.linspace(0, np.pi, 800)
    place = np.concatenate([(1 - np.cos(part)) / 2 * (-1) ** k + k % 2 for k in range(strokes)])
    track, _ = grouped_track(
        [Recording("run", 200.0, current_a=np.sin(place), position_rad=place)], Joint()
    )
    assert ("revisits" in track.channels) == known


@pytest.mark.parametrize(
    ("beside", "known"),
    [
        (lambda t: 0.001 * np.sin(0.31 * t), True),  # stands, all but
        (lambda t: np.sin(0.131 * t), False),
        (lambda t: np.sin(np.pi * t + 1), True),
    ],
)
def test_an_arm_comes_back_where_all_joints_that_move_do(beside, known):
    time = np.arange(6000) / 200.0
    place = np.sin(np.pi / 2 * time)
    others = {2: beside(time), 3: 0.4 * np.cos(np.pi * time)}
    run = Recording("run", 200.0, current_a=place, position_rad=place, others_rad=others)
    track, _ = grouped_track([run], Joint())
    assert ("revisits" in track.channels) == known
    # a joint that warms up asks its own places alone: 6.0 times the noise was left of one
    assert "returns" in track.channels
    warmup, payload = (built_in_library()[name] for name in ("warmup", "payload_change"))
    assert warmup.untestable(track) is None
    assert (payload.untestable(track) is None) == known


def test_an_arm_comes_back_in_another_recording_of_its_program():
    time = np.arange(4000) / 200.0
    place = np.sin(2 * time)
    others = {2: np.sin(0.31 * time), 3: np.cos(0.23 * time + 1)}
    runs = [
        Recording(f"run {k}", 200.0, current_a=place, position_rad=place, others_rad=others)
        for k in range(2)
    ]
    for some, known in ((runs[:1], False), (runs, True)):
        assert ("revisits" in grouped_track(some, Joint())[0].channels) == known


@pytest.mark.parametrize(("second", "known"), [(1, True), (-1, False)])
def test_a_second_run_of_a_stroke_passes_its_places_again_and_the_way_back_does_not(second, known):
    """A payload changed between two runs of a program, and could not be asked for."""
    first = stroke(rest_s=0.0, seconds=1.5, name="run 0")
    other = replace(first, name="run 1", position_rad=first.position_rad[::second])
    track, _ = grouped_track([first, other], Joint())
    assert ("revisits" in track.channels) == known


def test_a_motion_repeats_where_all_joints_that_move_repeat():
    time = np.arange(6000) / 200.0
    place = 1 - np.cos(2 * np.pi * time / 5)
    noise = 1e-5 * np.random.default_rng(0).normal(size=time.size)
    beside = {2: 0.5 * np.cos(2 * np.pi * time / 2.5), 3: noise}
    run = Recording("run", 200.0, current_a=np.sin(time), position_rad=place, others_rad=beside)
    assert grouped_track([run], Joint())[1].kind == "cycles"
    never = replace(run, others_rad=beside | {4: np.sin(0.31 * time)})
    assert grouped_track([never], Joint())[1].kind == "blocks"
