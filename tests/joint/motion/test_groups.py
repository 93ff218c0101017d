import numpy as np
import pytest

from opamc_cli.joint.motion.groups import _mismatch, cycle_length, group_samples


def test_cycle_is_the_lag_at_which_the_path_repeats():
    rng = np.random.default_rng(3)
    cycle = np.convolve(rng.normal(size=1234), np.hanning(101), mode="same")
    assert cycle_length(np.tile(cycle, 5)) == 1234


def test_a_path_that_never_repeats_has_no_cycle():
    rng = np.random.default_rng(3)
    assert cycle_length(np.convolve(rng.normal(size=9000), np.hanning(101), "same")) is None


def test_a_motion_repeats_in_what_is_known_of_it():
    rng = np.random.default_rng(3)
    path = np.tile(np.convolve(rng.normal(size=500), np.hanning(101), mode="same"), 5)
    known = np.arange(path.size) % 500 > 60
    # Where the current was too small, one cycle's motion was guessed wrongly.
    path[1000:1061] += 10 * path.std()
    assert cycle_length(path) != 500
    assert cycle_length(path, known=known) == 500
    assert cycle_length(path, known=np.zeros(path.size, dtype=bool)) is None


def test_the_mismatch_is_that_of_the_pairs_that_are_known():
    rng = np.random.default_rng(4)
    path, known = rng.normal(size=90), rng.random(90) < 0.8
    found = _mismatch(path, known)
    for lag in range(0, 80, 7):
        both = known[: 90 - lag] & known[lag:]
        square = (path[lag:] - path[: 90 - lag])[both] ** 2
        assert found[lag] == pytest.approx(square.mean(), abs=1e-12)
    assert _mismatch(path, np.arange(90) < 40)[40] == np.inf


def test_several_joints_have_to_repeat_at_once():
    rng = np.random.default_rng(3)
    one, other = (np.convolve(rng.normal(size=n), np.hanning(51), "same") for n in (500, 750))
    assert cycle_length(np.tile(one, 9)) == 500
    assert cycle_length(np.tile(one, 9), np.tile(other, 6)) == 1500
    assert cycle_length(np.tile(one, 2), np.tile(other, 2)[:1000]) is None
    assert cycle_length(np.tile(one, 9), np.zeros(4500)) is None


def test_some_cycles_between_others_are_sealed():
    moving = np.ones(15_000, dtype=bool)
    grouping = group_samples(moving, ((0, 15_000),), 1000, 100.0, ("run",))
    assert grouping is not None
    assert grouping.kind == "cycles"
    assert [grouping.names[g] for g in grouping.sealed] == ["run:2", "run:5", "run:9", "run:14"]
    assert np.all(grouping.group[2000:3000] == 2)


def test_a_single_stroke_is_cut_into_blocks_and_some_of_its_middle_is_sealed():
    moving = np.ones(6000, dtype=bool)
    grouping = group_samples(moving, ((0, 6000),), None, 1000.0, ("run",))
    assert grouping is not None
    assert grouping.kind == "blocks"
    assert grouping.sealed == (2, 5, 9)


@pytest.mark.parametrize(
    ("count", "sealed"), [(4, "c"), (5, "c"), (6, "cf"), (10, "cfj"), (12, "cfj")]
)
def test_recordings_are_groups_where_nothing_repeats_inside_them(count, sealed):
    # The last of ten may be all that there is of a speed, every fourth of twelve of a program.
    moving = np.ones(count * 1000, dtype=bool)
    bounds = tuple((k * 1000, k * 1000 + 1000) for k in range(count))
    grouping = group_samples(moving, bounds, None, 100.0, tuple("abcdefghijkl"[:count]))
    assert grouping is not None
    assert grouping.kind == "recordings"
    assert "".join(grouping.names[g] for g in grouping.sealed) == sealed


@pytest.mark.parametrize("count", [2, 3])
def test_few_recordings_are_cut_into_blocks_of_which_each_has_open_ones(count):
    moving = np.ones(count * 1000, dtype=bool)
    moving[995:1010] = False
    bounds = tuple((k * 1000, k * 1000 + 1000) for k in range(count))
    grouping = group_samples(moving, bounds, None, 100.0, tuple("abc"[:count]))
    assert grouping is not None
    assert (grouping.kind, grouping.sealed, len(grouping.names)) == ("blocks", (2, 5, 9), 12)
    runs = [name[0] for name in grouping.names]
    assert runs == sorted(runs)
    for k, (start, stop) in enumerate(bounds):
        inside = np.unique(grouping.group[start:stop][moving[start:stop]])
        assert {runs[g] for g in inside} == {"abc"[k]}
        assert set(inside) - set(grouping.sealed)


def test_of_fewer_than_six_cycles_none_is_sealed_as_a_whole():
    moving = np.ones(4500, dtype=bool)
    kinds = [group_samples(moving, ((0, n),), 750, 100.0, ("run",)).kind for n in (4300, 4500)]
    assert kinds == ["blocks", "cycles"]


def test_recordings_of_few_cycles_are_groups_if_there_are_four():
    moving = np.ones(8000, dtype=bool)
    bounds = tuple((k * 2000, k * 2000 + 2000) for k in range(4))
    found = [group_samples(moving, bounds, n, 100.0, tuple("abcd")) for n in (500, 1500)]
    assert [grouping.kind for grouping in found] == ["cycles", "recordings"]
    assert [grouping.names[-1] for grouping in found] == ["d:3", "d"]
    assert [len(grouping.sealed) for grouping in found] == [4, 1]


def test_too_little_motion_seals_nothing():
    moving = np.zeros(6000, dtype=bool)
    moving[100:150] = True
    assert group_samples(moving, ((0, 6000),), None, 1000.0, ("run",)) is None
