"""The decision on made-up fleets: quiet on healthy joints, right about the faulty one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from opamc_cli.decision.judge import Policy
from tests.decision.fleet import Fleet, cells, judge
from tests.marks import long

SEEDS = range(40)


def p_values(plan, seeds=SEEDS):
    return np.array([[j.p_value for j in judge(cells(plan, seed)).values()] for seed in seeds])


@pytest.mark.parametrize(
    "plan",
    [
        Fleet(),
        long(Fleet(n_baseline=8, between_sessions=0.4, influences=2)),
        long(Fleet(n_baseline=5, n_target=5, n_axes=3)),
        long(Fleet(n_baseline=4, n_target=3, n_axes=3, between_sessions=0.3)),
    ],
    ids=["six sessions", "wild sessions", "five and five", "four and three"],
)
def test_p_values_of_healthy_joints_are_uniform(plan):
    p = p_values(plan).ravel()
    assert kstest(p, "uniform").pvalue > 0.01
    assert (p <= 0.01).mean() <= 0.03


@pytest.mark.parametrize(
    ("n_baseline", "between_sessions"),
    [(1, 0.3), long(1, 0.0), long(2, 0.3), long(3, 0.1), long(6, 0.0), long(6, 0.3)],
)
def test_healthy_joints_stay_healthy(n_baseline, between_sessions):
    plan = Fleet(n_baseline=n_baseline, between_sessions=between_sessions)
    states = [j.state for seed in SEEDS for j in judge(cells(plan, seed)).values()]
    # One session cannot know that sessions differ as much as a medium effect (w = 0.3) does.
    allowed = 0.02 * len(states) if n_baseline == 1 and between_sessions == 0.3 else 1
    assert len(states) - states.count("healthy") <= allowed


@pytest.mark.parametrize("n_baseline", [long(1), 2, long(3), long(6)])
def test_a_gross_fault_is_found_on_its_own_joint_only(n_baseline):
    plan = Fleet(n_baseline=n_baseline, severity=1.0)
    found, others = [], []
    for seed in SEEDS:
        judgements = judge(cells(plan, seed))
        found.append(judgements[3].state)
        others += [j.state for axis, j in judgements.items() if axis != 3]
        assert max(judgements, key=lambda axis: judgements[axis].health_index) == 3
    # From two sessions, which have one divergence between them, no spread can be had.
    assert found.count("fault") >= (35 if n_baseline == 2 else 40)
    assert others.count("healthy") >= len(others) - 1


@pytest.mark.long
def test_the_health_index_is_zero_for_healthy_sessions_and_grows_with_severity():
    healthy = [j.health_index for seed in SEEDS for j in judge(cells(Fleet(), seed)).values()]
    assert abs(np.mean(healthy)) < 0.2
    assert np.std(healthy) == pytest.approx(1.0, abs=0.35)
    by_severity = [
        np.median([judge(cells(Fleet(severity=s), seed))[3].health_index for seed in range(10)])
        for s in (0.0, 0.2, 0.4, 0.8)
    ]
    assert (np.diff(by_severity) > 0).all()


@pytest.mark.long
def test_what_moves_all_joints_together_is_not_a_fault():
    plan = Fleet(common=0.4)
    lone = replace(plan, n_axes=1)
    together = [j for seed in SEEDS for j in judge(cells(plan, seed)).values()]
    assert np.median([j.p_adjusted for j in together]) < 0.01
    assert np.mean([j.state == "healthy" for j in together]) > 0.97
    alone = [judge(cells(lone, seed))[1].state for seed in SEEDS]
    assert alone.count("healthy") < len(alone) / 3


def test_a_failing_joint_of_three_excuses_no_other():
    plan = Fleet(n_axes=3, severity=1.0)
    for seed in range(5):
        judged = judge(cells(plan, seed))
        assert judged[plan.faulty].state == "fault"
        assert max(judged[axis].common_log_ratio for axis in (1, 2)) < 0.7


@pytest.mark.long
def test_a_faulty_joint_stands_out_from_a_common_shift():
    plan = Fleet(common=0.15, severity=1.0)
    found = [judge(cells(plan, seed)) for seed in SEEDS]
    assert np.mean([judged[3].state == "fault" for judged in found]) > 0.9
    assert (
        np.mean([j.state == "healthy" for judged in found for a, j in judged.items() if a != 3])
        > 0.97
    )


def test_a_certain_change_that_is_too_small_to_matter_is_not_reported():
    plan = Fleet(between_sessions=0.0, between_cycles=0.0, severity=0.04, independent=40_000)
    judgement = judge(cells(plan, 0))[3]
    assert judgement.p_adjusted < 0.01
    assert judgement.state == "healthy"
    assert judge(cells(plan, 0), Policy(minimum_effect=0.01))[3].state == "changed"


def test_without_data_nothing_is_claimed():
    plan = Fleet(n_baseline=1, n_cycles=1, n_axes=2)
    judged = judge({**cells(plan, 0), 9: []})
    assert {j.state for j in judged.values()} == {"insufficient-data"}
    assert all(np.isnan(j.p_value) for j in judged.values())


def test_a_session_that_lacks_a_motion_counts_with_the_others():
    drawn = cells(Fleet(severity=1.0), 0)
    holes = {}
    for axis, own in drawn.items():
        baseline = own[0].baseline.copy()
        baseline[2] = 0
        holes[axis] = [replace(own[0], baseline=baseline), *own[1:]]
    judged = judge(holes)
    assert judged[3].state == "fault"
    assert all(np.isfinite(j.p_value) for j in judged.values())


def test_identical_recordings_are_healthy():
    plan = Fleet(n_axes=2)
    same = {
        axis: [replace(cell, target=cell.baseline[:1].copy()) for cell in own]
        for axis, own in cells(plan, 0).items()
    }
    assert {j.state for j in judge(same).values()} == {"healthy"}
    frozen = {
        axis: [
            replace(
                cell,
                baseline=np.repeat(cell.baseline[:1], 6, axis=0),
                target=cell.baseline[:1].copy(),
            )
            for cell in own
        ]
        for axis, own in cells(plan, 0).items()
    }
    assert {j.state for j in judge(frozen).values()} == {"healthy"}


def test_the_decision_does_not_depend_on_the_order_of_sessions():
    drawn = cells(Fleet(severity=0.5, n_target=2), 1)
    turned = {
        axis: [replace(c, baseline=c.baseline[::-1], target=c.target[::-1]) for c in own]
        for axis, own in drawn.items()
    }
    for axis, judgement in judge(drawn).items():
        assert judge(turned)[axis].p_value == pytest.approx(judgement.p_value)
