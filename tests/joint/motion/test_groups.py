import numpy as np
import pytest

from opamc_cli.joint.motion.groups import group_samples


def test_some_cycles_between_others_are_sealed():
    moving = np.ones(15_000, dtype=bool)
    grouping = group_samples(moving, ((0, 15_000),), 1000, 100.0, ("run",))
    assert grouping is not None
    assert grouping.kind == "cycles"
    assert [grouping.names[g] for g in grouping.sealed] == ["run:2", "run:5", "run:9", "run:13"]
    assert np.all(grouping.group[2000:3000] == 2)


def test_a_single_stroke_is_cut_into_blocks_and_some_of_its_middle_is_sealed():
    moving = np.ones(6000, dtype=bool)
    grouping = group_samples(moving, ((0, 6000),), None, 1000.0, ("run",))
    assert grouping is not None
    assert grouping.kind == "blocks"
    assert grouping.sealed == (2, 5, 9)


@pytest.mark.parametrize(
    ("count", "sealed"), [(4, "c"), (5, "c"), (6, "ce"), (10, "cfi"), (12, "cfj")]
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
