"""What forbids a comparison, rule by rule."""

from types import SimpleNamespace

import numpy as np
import pytest

from opamc_cli.stages.recordings.sessions import Sessions
from opamc_cli.stages.verdict.agreement.findings import (
    _all_filtered,
    _all_scaled,
    _coarser,
    _far_too_large,
    _other_steps,
    _other_unit,
    _still,
)
from opamc_cli.stages.verdict.agreement.measured import _changing, _noise, _steps
from opamc_cli.stages.verdict.agreement.unjudged import Unjudged


@pytest.mark.parametrize(
    ("usual", "tonight", "refused"),
    [(0.9, 0.1, True), (0.9, 0.4, False), (0.3, 0.05, False), (0.15, 0.8, False)],
)
def test_a_current_that_lost_its_steps_is_another_log_and_one_that_gained_some_may_knock(
    usual, tonight, refused
):
    own = SimpleNamespace(axis=2, changing=tonight)
    told = _coarser(own, SimpleNamespace(changing={2: usual}))
    assert (told is not None) == refused
    assert not refused or f"changes from sample to sample in {tonight:.0%} of them" in told


def test_values_that_are_each_logged_twice_change_in_no_two_samples():
    """It was a fault of the gear: they change in half as many samples, which a knock may."""
    noise = np.random.default_rng(3).normal(size=4000)
    assert _changing([noise]) == 1.0
    assert _changing([np.repeat(noise, 2)]) == 0.0
    knocking = np.where(np.random.default_rng(4).random(4000) < 0.5, noise, 0.0).cumsum()
    assert _changing([knocking]) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("usual", "tonight", "said"),
    [
        (0.0, 2.0, "comes in steps of 2, the baseline's in finer ones"),
        (0.5, 0.0, "comes in finer steps than the baseline's of 0.5"),
        (0.5, 0.5, None),
        (0.1, 2.0, "comes in steps of 2, the baseline's in finer ones"),
        (0.0, 0.1, None),
        (0.0, 0.0, None),
    ],
)
def test_a_current_in_other_steps_than_the_baselines_is_another_log(usual, tonight, said):
    def logged(step, seed):
        noise = np.random.default_rng(seed).normal(0, 0.25, 4000) * (1 + 3 * seed)
        return noise if step == 0 else np.round(noise / step) * step

    # what a fault shakes has larger steps, and comes in none
    (before, now) = ([logged(step, seed)] for seed, step in enumerate((usual, tonight)))
    own = SimpleNamespace(axis=2, steps=_steps(now), changing=_changing(now))
    baseline = SimpleNamespace(steps={2: _steps(before)}, changing={2: _changing(before)})
    told = _other_steps(own, baseline)
    assert (said is None) == (told is None)
    assert said is None or said in told


@pytest.mark.parametrize(
    ("times", "noise", "said"),
    [
        ((3.0, 3.2, 2.9), (1, 1, 1), "the currents of all its axes are 3 times the baseline's"),
        ((0.1, 0.1, 0.11), (1, 1, 1), "of all its axes are 0.1 times the baseline's: another unit"),
        ((3.0, 1.0, 3.0), (3, 3, 3), None),  # one axis is as it was: the others may be at fault
        ((1.3, 1.3, 1.3), (1, 1, 1), None),  # warmth does so
        ((1.42, 1.4, 1.41), (1.41, 1.45, 1.38), "and their noise, are 1.41 times the baseline's: "),
        ((0.7, 0.71, 0.72), (0.71, 0.7, 0.7), "another unit (root mean square for peak)?"),
        ((1.42, 1.4, 1.41), (1.41, 1.6, 1.38), "and their noise, are 1.41 times"),
        ((1.42, 1.4, 1.41), (1.41, 1.1, 1.38), None),
        ((1.42, 1.4, 1.41), (1.2, 1.2, 1.41), None),
        ((1.15, 1.15, 1.15), (1.15, 1.15, 1.15), None),
        ((3.0,), (3,), None),
    ],
)
def test_currents_that_are_all_of_another_size_are_of_another_unit(times, noise, said):
    """Ten times as large on all axes was tooth damage on two of them, from a healthy robot."""
    own = [
        SimpleNamespace(run="r", axis=axis, size={"current": 0.5 * axis * one}, noise=0.1 * own)
        for axis, (one, own) in enumerate(zip(times, noise, strict=True), start=1)
    ]
    sizes = {(one.axis, "current"): 0.5 * one.axis for one in own}
    usual = SimpleNamespace(size=sizes, noise=dict.fromkeys(range(1, len(times) + 1), 0.1))
    found = _all_scaled(own, usual)
    assert [one.axis for one in found] == ([one.axis for one in own] if said else [])
    assert all(said in one.why for one in found)


@pytest.mark.parametrize(
    ("times", "noise", "refused"),
    [
        (10.0, 10.0, True),
        (0.1, 0.1, True),
        (6.0, 6.0, False),
        (12.0, 3.0, False),
        (25.0, 3.0, True),
    ],
)
def test_a_current_that_is_scaled_down_to_its_noise_is_of_another_unit(times, noise, refused):
    """A grinding gear may ask for twelve times as much, but not of the sensor's noise."""
    own = SimpleNamespace(axis=2, size={"current": times}, steps=(0.0, 0.01 * noise), level=None)
    usual = SimpleNamespace(size={(2, "current"): 1.0}, steps={2: (0.0, 0.01)}, level={2: 0.0})
    assert (_other_unit(own, usual) is not None) == refused


@pytest.mark.parametrize(
    ("swings", "level", "refused"),
    [(44.0, 2.9, None), (44.0, 44.0, "44 times"), (1000.0, 30.0, "30 times"), (0.01, 1.0, "0.01")],
)
def test_a_steady_current_that_a_fault_makes_swing_is_of_the_same_unit(swings, level, refused):
    """A measured motor's drag asked for 2.9 times its current, 44 times its deviation from it."""
    own = SimpleNamespace(axis=1, size={"current": swings}, steps=(0.0, 0.1), level=5 * level)
    usual = SimpleNamespace(size={(1, "current"): 1.0}, steps={1: (0.0, 0.1)}, level={1: 5.0})
    told = _other_unit(own, usual)
    assert (refused in told) if refused else told is None


def test_a_speed_in_turns_a_minute_is_of_another_unit():
    own = SimpleNamespace(axis=2, size={"velocity": 9.55}, steps=(0.0, 0.0))
    usual = SimpleNamespace(size={(2, "velocity"): 1.0}, steps={2: (0.0, 0.0)})
    assert "another unit (degrees or rpm)" in str(_other_unit(own, usual))


@pytest.mark.parametrize(
    ("smooth", "times", "found"),
    [
        ((5, 5, 5), 1.0, True),  # a filter over five samples
        ((1, 1, 1), 3.0, True),
        ((5, 5, 1), 1.0, False),  # of two joints alone
        ((1, 1, 1), 1.5, False),
    ],
)
def test_what_all_currents_lose_or_gain_between_samples_is_no_joint_s(smooth, times, found):
    """A robot with three times the noise was not judged "for want of data"."""
    white = np.random.default_rng(5).normal(size=(3, 4000))
    now = [times * np.convolve(one, np.ones(k) / k) for one, k in zip(white, smooth, strict=True)]
    axes = [
        SimpleNamespace(run="r", axis=axis, noise=_noise([one])) for axis, one in enumerate(now)
    ]
    usual = SimpleNamespace(noise={axis: _noise([one]) for axis, one in enumerate(white)})
    told = _all_filtered(axes, usual)
    assert [one.axis for one in told] == ([0, 1, 2] if found else [])
    assert all(one.of_log and "another filter in drive or log" in one.why for one in told)
    assert _all_filtered(axes[:1], usual) == []
    assert _noise([np.full(9, np.nan)]) == 0.0


@pytest.mark.parametrize(
    ("current", "position", "said"),
    [
        (0.0, 0.5, "the current of axis 2 is 0.0% of the baseline's though its position moves"),
        (0.0, 0.0, "baseline's; the joint stands without load, or its sensor is dead"),
        (1.0, 0.0, "the position of axis 2 does not change though its current is 100%"),
    ],
)
def test_a_dead_sensor_is_no_joint_that_stands(current, position, said):
    """Of a current of 0 A it was said that no motion was found in the position, which moved."""
    own = SimpleNamespace(axis=2, signal=("x",), size={"current": current, "position": position})
    usual = SimpleNamespace(size={(2, "current"): 1.0, (2, "position"): 0.5})
    assert said in _still(own, usual)


@pytest.mark.parametrize(
    ("current", "position", "said"),
    [
        (1.0, 28.6, "the position of axis 2 is 57.2 times the baseline's: another unit (degrees)?"),
        (25.0, 0.0, "the current of axis 2 is 25 times the baseline's"),
        (1.0, 0.0, None),
        (1.0, 0.6, None),
    ],
)
def test_degrees_for_radians_are_no_joint_that_stands_still(current, position, said):
    """Of a program logged in degrees no motion is found: it would be too fast for any robot."""
    sizes = {"current": current, "position": position}
    own = SimpleNamespace(axis=2, size=sizes, steps=(0.0, 0.01), level=None)
    usual = SimpleNamespace(
        size={(2, "current"): 1.0, (2, "position"): 0.5}, steps={2: (0.0, 0.01)}, level={2: 0.0}
    )
    told = _far_too_large(own, usual)
    assert (told is None) == (said is None)
    assert said is None or told.startswith(said)


def test_a_session_of_the_baseline_without_a_joint_is_said():
    """Five recordings of one of six nights had no second joint, and nothing said so."""
    nights = {f"{n}/{k}": f"2026-03-0{n}" for n in (1, 2, 3) for k in "ab"}
    sides = SimpleNamespace(sessions=(Sessions(nights, ("night",)),))

    def said(*runs):
        found = Unjudged({}, (), unrecorded={2: {*runs}}).sessions_without(sides)
        return [(str(one), one.axes) for one in found]

    assert said("1/a") == said() == []  # the other half of the night has it
    assert said("2/a", "2/b") == [
        ("night 2026-03-02 of the baseline has no current of axis 2", (2,))
    ]
    assert said("1/a", "1/b", "2/a", "2/b") == []  # most lack it: it is rarely logged
