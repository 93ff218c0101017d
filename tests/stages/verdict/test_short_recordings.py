"""What is said of a recording that fits no motion: that it is short, before anything else."""

from pathlib import Path
from types import SimpleNamespace

import pyarrow as pa
import pytest

from opamc_cli.stages.verdict.agreement.findings import Finding
from opamc_cli.stages.verdict.agreement.unjudged import Side, unjudged
from opamc_cli.stages.verdict.agreement.whole import not_whole


def side(role, spans, findings=()):
    rows = [
        {
            **{"run": run, "axis": 1, "cycle": cycle, "start": start, "stop": stop},
            **{"reference": False, "edge": False},
        }
        for run, cycle, start, stop in spans
    ]
    measured = [
        SimpleNamespace(run=run, path=Path(run), axis=1, moves=True)
        for run in dict.fromkeys(row["run"] for row in rows)
    ]
    return Side(role, measured, findings, pa.Table.from_pylist(rows))


@pytest.mark.parametrize(
    ("stop", "says"),
    [
        (
            700,
            "or the joint stops: its motions of axis 1 last 18% as long as those of the shortest",
        ),
        (3000, "fit no motion of the baseline's cycle: another program or speed"),
    ],
)
def test_a_recording_that_is_much_shorter_is_told_so_first(stop, says):
    nights = [("a", 0, 0, 2000), ("a", 1, 2000, 4000), ("b", 0, 0, 5000), ("broken", -1, 0, 9)]
    target = side("target", [("new", -1, 0, 400), ("new", -1, 400, stop)])
    (why,) = unjudged(side("baseline", nights), target).axes[1]
    assert says in why
    assert why.startswith("The target: ")


BAD_SENSOR = Finding("new", 1, "axis1_a keeps one value")
OTHER_SIGN = Finding("new", 1, "the sign is inverted", of_log=True)


@pytest.mark.parametrize(
    ("normal", "finding", "foreign"),
    [
        (0, (), {1}),  # no motion fits
        (0, (OTHER_SIGN,), {1}),
        (0, (BAD_SENSOR,), set()),
        (-1, (), set()),  # nor does any of the baseline itself
    ],
)
def test_another_program_or_log_is_told_from_a_bad_sensor(normal, finding, foreign):
    baseline = side("baseline", [("a", normal, 0, 2000), ("b", normal, 0, 2000)])
    found = unjudged(baseline, side("target", [("new", -1, 0, 2000)], finding))
    assert found.axes.keys() == {1}
    assert found.foreign == foreign


def moved(role, motions, fits):
    """Return a recording of four cycles, of motions of some hundred samples at 100 Hz each."""
    rows, stop = [], 0
    for cycle in range(4):
        for motion, length in enumerate(motions):
            start, stop = stop + 50, stop + 50 + 100 * length
            rows.append(
                {
                    **{"run": role, "axis": 1, "cycle": cycle if fits else -1, "motion": motion},
                    **{"start": start, "stop": stop, "sampling_rate_hz": 100.0, "edge": False},
                    **{"variance": 1.0, "f_max_hz": 9.0, "direction": 1},
                    "reference": fits and cycle == 0,
                }
            )
    measured = [SimpleNamespace(run=role, path=Path(role), axis=1, moves=True)]
    return Side(role, measured, (), pa.Table.from_pylist(rows))


@pytest.mark.parametrize(
    ("motions", "says"),
    [
        ([2, 9, 4, 16], "one motion less: the baseline's motion 3, which lasts 6 s, is not there;"),
        (
            [2, 9, 4, 6, 1, 16],
            "one motion more than the baseline's, its number 4, which lasts 1 s;",
        ),
        ([3, 5, 10, 20, 7], "another program or speed"),
    ],
)
def test_a_motion_more_or_less_in_each_cycle_is_told(motions, says):
    baseline = moved("baseline", [2, 9, 4, 6, 16], fits=True)
    (why,) = unjudged(baseline, moved("target", motions, fits=False)).axes[1]
    assert says in why


def recorded(role, **runs):
    """Return recordings of two axes whose cycles have three motions, a letter for each.

    `c` is a cycle, `x` a motion of none; axis 2 does what axis 1 does, unless it has a text of its
    own behind a slash.
    """
    rows = []
    for run, text in runs.items():
        parts = text.split("/")
        for axis, own in ((1, parts[0]), (2, parts[-1])):
            places = []
            for letter in own:
                cycle = 1 + max((c for c, _ in places), default=-1)
                places += [(cycle, m) for m in range(3)] if letter == "c" else [(-1, -1)]
            rows += [
                {
                    **{"run": run, "axis": axis, "cycle": cycle, "motion": motion},
                    **{"start": 100 * k, "stop": 100 * k + 90, "sampling_rate_hz": 100.0},
                }
                for k, (cycle, motion) in enumerate(places)
            ]
    measured = [
        SimpleNamespace(run=run, path=Path(run), axis=axis, moves=True)
        for run in runs
        for axis in (1, 2)
    ]
    return Side(role, measured, (), pa.Table.from_pylist(rows))


def told(target, *baseline):
    nights = recorded("baseline", **{f"n{k}": text for k, text in enumerate(baseline)})
    return [str(error) for error in not_whole(nights, recorded("target", new=target))]


def test_a_recording_that_ends_early_is_told():
    cut = "new: holds {} where the baseline's recordings hold {} (its motion ends at {} s)"
    assert told("ccx", "ccccc", "ccccc") == [cut.format("2 cycles", "5", 6.9)]
    assert told("c", "ccccc", "cccc") == [cut.format("1 cycle", "4 to 5", 2.9)]
    assert told("cccc", "ccccc", "ccccc") == []
    # of three cycles, the fourth cut, two are not few; half as many motions are
    assert told("ccx", "cccxx", "cccxx") == []
    (said,) = told("ccx", "cccxxx", "cccxxx")
    assert said.startswith("new: holds 7 segments where the baseline's recordings hold 12 (")


@pytest.mark.parametrize(
    ("target", "baseline"),
    [
        ("c", ("ccccc", "ccc")),  # of no usual length
        ("c", ("ccccc",)),  # nor is that of one recording
        ("c/ccccc", ("ccccc", "ccccc")),  # a joint whose motions fit no more
    ],
)
def test_a_recording_that_may_be_meant_to_be_short_is_not_told(target, baseline):
    assert told(target, *baseline) == []


def test_a_recording_of_which_half_is_another_program_is_told():
    odd = "of axis 1 (axis 2 likewise) fit no motion of the baseline's cycle and are not judged"
    for text in ("cccxxxxxxxxx", "xxxxxxxxxccc", "cxxxcxxxcxxx"):
        (said,) = told(text, "ccccc", "ccccc")
        assert said.startswith(f"new: 9 of 18 segments {odd}: another program"), text
    (said,) = told("ccc/cccxxxxxxx", "ccc", "ccc")
    assert said.startswith("new: 7 of 16 segments of axis 2 fit")


def test_cycles_that_the_edges_cut_are_no_other_program():
    assert told("xxcxx", "xxcxx", "cc") == []
    assert told("xxcxx", "ccc", "ccc") != []  # but the recording is cut
    # nor are motions that noise has made
    assert told("xcxxcxxcx/ccc", "ccc", "ccc") == []
    assert told("xcxxcxxcx", "ccc", "xcxxcxxcx") == []
    # nor is what the baseline's recordings hold as well
    assert told("cxxxcxxx", "cxxxcxxx", "cxxxcxxx") == []


def test_a_large_part_is_one_beyond_the_baselines_own():
    """Waits at random leave half of a stranger's healthy recordings unmatched, in shorter parts."""
    assert told("xxcccxxxxxx", "xxcccxxxxxx", "ccccc", "ccccc") == []
    assert told("xxcxxx", "xxcxx", "xxcxx") == []
    assert told("xxcxxxxxxx", "xxcxx", "xxcxx") != []


def test_a_stop_of_most_joints_within_their_cycles_is_told():
    """A segment that a stop has made is no large part, and no baseline recording holds one."""
    (said,) = told("cxcc", "ccc", "ccc")
    assert said.startswith("new: within the cycles of axes 1, 2 segments fit no motion (from 3 s")
    assert told("cxcc/ccc", "ccc", "ccc") == []
    assert told("cxcc", "ccc", "ccxc") == []
    assert told("xcccx", "ccc", "ccc") == []
