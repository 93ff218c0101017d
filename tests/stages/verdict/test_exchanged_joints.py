"""Two joints' currents exchanged: only a pair that is mutual, exclusive and close is one."""

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest

from opamc_cli.stages.verdict.agreement.exchanged_joints import exchanged_joints
from opamc_cli.storage.schemas import files

AXES, MOTIONS, PARTS = (1, 2, 3, 4), (0, 1, 2), 32
NOISE = 0.05


def courses(seed=0):
    rng = np.random.default_rng(seed)
    return {axis: rng.normal(0, 1, (len(MOTIONS), PARTS)) for axis in AXES}


def table(healthy, runs, seed, change=lambda run, axis, course: course):
    rng = np.random.default_rng(seed)
    rows = [
        {
            "run": run,
            "axis": axis,
            "motion": motion,
            "current_a": (change(run, axis, of) + rng.normal(0, NOISE, (len(MOTIONS), PARTS)))[
                motion
            ],
        }
        for run in runs
        for axis, of in healthy.items()
        for motion in MOTIONS
    ]
    return pa.Table.from_pylist(rows)


def asked(change, runs=("new",), bad=AXES, worn=None):
    healthy = courses()
    known = table(healthy, [f"night {one}" for one in range(6)], 1, worn or _same)
    sides = SimpleNamespace(
        baseline=SimpleNamespace(witnesses={files.PROFILES: known}),
        target=SimpleNamespace(witnesses={files.PROFILES: table(healthy, runs, 2, change)}),
    )
    states = [{"axis": axis, "state": "fault" if axis in bad else "healthy"} for axis in AXES]
    return exchanged_joints(sides, dict.fromkeys(AXES, runs), {"axes": states})


def _same(_run, _axis, course):
    return course


def swapped(one, other, runs=("new",)):
    healthy, place = courses(), {one: other, other: one}
    return lambda run, axis, of: healthy[place.get(axis, axis)] if run in runs else of


@pytest.mark.parametrize("pair", list(combinations(AXES, 2)))
def test_every_pair_that_is_exchanged_is_found_and_no_third(pair):
    assert set(asked(swapped(*pair))) == set(pair)


def test_a_lost_sample_exchanges_nothing():
    """Its part of the course held no number: an unknown distance passed for an infinite one."""

    def lost(_run, axis, course):
        return np.where(np.arange(PARTS) == 7, np.nan, course + 0.5 * (axis == 1))

    assert asked(lost) == {}
    assert asked(_same, worn=lost) == {}


def test_an_exchange_is_found_beside_a_lost_sample():
    def lost(run, axis, _course):
        return np.where(np.arange(PARTS) == 7, np.nan, swapped(1, 3)(run, axis, None))

    assert set(asked(lost)) == {1, 3}


def test_a_joint_far_from_its_own_course_follows_nobody():
    """Nearer to all others than to its own, as all of them are where theirs was disturbed."""

    def disturbed(_run, _axis, course):
        return -0.2 * course

    assert asked(disturbed) == {}


def test_one_way_is_no_exchange():
    healthy = courses()
    assert asked(lambda _run, axis, of: healthy[2] if axis == 1 else of) == {}


def test_what_could_be_any_of_three_is_none():
    """All follow the mean of all: the nearest is hardly nearer than the next."""
    healthy = courses()
    mean = np.mean(list(healthy.values()), axis=0)
    assert asked(lambda _run, _axis, _of: mean) == {}


def test_most_recordings_have_to_show_it():
    nights = ("one", "two", "three")
    assert set(asked(swapped(1, 2, nights[:2]), nights)) == {1, 2}
    assert asked(swapped(1, 2, nights[:1]), nights) == {}


def test_no_joint_is_asked_that_has_not_changed():
    assert asked(swapped(1, 2), bad=(3,)) == {}
