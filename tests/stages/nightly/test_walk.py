"""The short form of benchmarks/nightly/nightly_walk.py: nothing ends or fails without a word."""

import nightly_walk
import pytest

pytestmark = pytest.mark.long

HEALTHY = ("add", {"r1": "HH", "r2": "HH", "r3": "HH"})
WORN = ("add", {"r1": "FH", "r2": "HH", "r3": "HH"})


@pytest.mark.parametrize("seed", [9064, 9077])
def test_a_walk(seed):
    assert nightly_walk.walk(nightly_walk.generate(seed), loses=bool(seed % 2)) == ""


def test_a_joint_that_is_under_another_alarm_when_it_is_heard_that_the_first_is_over():
    start = ("start", "--quiet")
    ops = [*[HEALTHY] * 2, *[WORN] * 2, start, *[HEALTHY] * 9, ("add", {"r1": "GH"}), start]
    assert nightly_walk.walk(ops, loses=True) == ""


def test_a_walk_hears_a_start_that_says_nothing(monkeypatch):
    monkeypatch.setattr("opamc_cli.stages.nightly.morning.OVER", {})
    ops = [("robots", ["r1", "r2", "r4"]), HEALTHY, HEALTHY, ("start", "--quiet")]
    assert "r4 is newly not judged" in nightly_walk.walk(ops, loses=True)
