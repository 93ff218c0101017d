"""The decision on made-up fleets: quiet on healthy joints, right about the faulty one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from opamc_cli.decision.judge import (
    HEALTHY_SHIFT_SPREAD,
    Bundle,
    Policy,
    Shift,
    common_log_ratio,
    one_session_log_ratio,
    one_session_shift,
)
from opamc_cli.decision.judge import judge as decide
from opamc_cli.decision.significance.spread import Spread, moderated_spread
from opamc_cli.decision.witnesses.spectra import SpectrumEvidence
from tests.decision import known_fleet
from tests.decision.fleet import Fleet, cells, judge, spectra
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


DIGITS = {
    "six sessions": """
healthy 0.8636 1 1 0 0.4778 -1.042 0 0 0 0.7849 0.8903 0.4989
fault 0.00145 0.0058 0.0058 0 6.136 6.335 0.4992 0 0 0.0007257 0.6929 0.5044
fault 9.25e-05 0.0004625 0.0004625 0 53.58 63.08 0 0.3973 0 0.7302 4.625e-05 0.4839
healthy 0.6659 1 1 0 0.6851 -0.6784 0 0 0.2669 0.6607 0.6705 0.0151
healthy 0.5603 1 1 0 0.9216 -0.4093 0.07622 0 0.08286 0.5736 0.5377 0.373
""",
    "six sessions, two lack a motion": """
healthy 0.7386 1 1 0.1779 0.5347 -0.8384 0 0 0 0.6994 0.7984 0.5072
healthy 0.01085 0.0434 0.0434 0 3.413 2.024 0.4947 0 0 0.005468 0.6903 0.5194
fault 0.0002022 0.001011 0.001011 0 75.45 66.33 0 0.3981 0 0.6975 0.0001011 0.4956
healthy 0.5563 1 1 0.194 0.8633 -0.5064 0 0 0.2663 0.5597 0.5531 0.01352
healthy 0.4048 1 1 0 1.182 -0.1418 0.07622 0.02145 0.08286 0.5828 0.3705 0.3513
""",
    "six sessions, all joints move": """
healthy 0.02082 0.06245 1 1.207 2.722 2.033 0.2698 0 0 0.01053 0.8903 0.4989
healthy 0.00145 0.0058 0.07005 1.001 8.643 9.149 0.4992 0 0 0.0007257 0.6929 0.5044
fault 9.207e-05 0.0004604 0.001925 1.001 37.88 45.34 0.2782 0.3973 0 0.009868 4.625e-05 0.4839
healthy 0.04878 0.09755 1 1.292 3.344 1.778 0.2481 0 0.2669 0.02531 0.6705 0.0151
healthy 0.5622 0.5622 1 1.207 0.911 -0.4278 0.07622 0 0.08286 0.5736 0.5377 0.373
""",
    "two sessions": """
healthy 0.7215 1 1 0 0.6538 -1.056 0.1325 0 0.09458 0.7215
healthy 0.002455 0.01227 0.01227 0 9.72 19.24 0.5761 0.05654 0.1022 0.002455
healthy 0.7048 1 1 0 0.669 -1.015 0.136 0.3937 0.1105 0.7048
healthy 0.6644 1 1 0 0.691 -0.9587 0.136 0.01837 0.3623 0.6644
healthy 0.5538 1 1 0 0.928 -0.4432 0.1723 0 0.1037 0.5538
""",
    "one session": """
healthy 0.4489 1 1 0 1.033 0.01236 0.2308 nan nan 0.4489
fault 5.395e-05 0.0002697 0.0002697 0 7.651 28.81 0.5543 nan nan 5.395e-05
healthy 0.541 1 1 0 0.9679 -0.2732 0.2296 nan nan 0.541
healthy 0.5687 1 1 0 0.9488 -0.3406 0.2251 nan nan 0.5687
healthy 0.5543 1 1 0 0.9576 -0.3085 0.2004 nan nan 0.5543
""",
    "three and two": """
healthy 0.6268 1 1 0 0.5447 -1.654 0 0 0.05592 0.5445 0.771 0.6415
healthy 0.004185 0.01674 0.01674 0 5.021 13.23 0.4746 0 0.05591 0.002098 0.7577 0.757
healthy 0.003198 0.01599 0.01599 0 19.93 56.13 0 0.3997 0.04294 0.5744 0.001604 0.863
healthy 0.6777 1 1 0 0.524 -1.684 0 0 0.2632 0.5901 0.6886 0.02028
healthy 0.7094 1 1 0 0.7562 -0.9165 0 0 0 0.6273 0.7853 0.9479
""",
    "four and two, one lacks a motion": """
healthy 0.9586 1 1 0 0.6902 -0.5642 0 0 0 0.9881 0.9235 0.8662
healthy 0.0228 0.09122 0.09122 0 3.559 1.998 0.4984 0 0 0.01154 0.9269 0.9155
healthy 0.009895 0.04947 0.04947 0 43.42 35.1 0 0.3926 0 0.9813 0.004973 0.9066
healthy 0.5455 1 1 0 0.7695 -0.4834 0 0 0.3265 0.6069 0.5784 0.01446
healthy 0.3632 1 1 0 0.8969 -0.3648 0.07147 0.0257 0 0.3053 0.3735 0.7227
""",
    "nine and three": """
healthy 0.9045 0.9748 0.9748 0.007165 0.6635 -0.6691 0 0 0 0.7157 0.9132 0.9887
healthy 0.05264 0.1579 0.1579 0 6.306 10.19 0.5164 0 0 6.528e-06 0.8608 0.8267
healthy 0.009054 0.03622 0.03622 0 88.05 148.8 0 0.3972 0 0.6066 1.769e-08 0.7572
changed 0.0002023 0.001012 0.001012 0 16.53 34.2 0 0 0.2976 0.8515 0.9008 6.745e-05
healthy 0.4874 0.9748 0.9748 0 1.006 -0.08878 0 0 0.03256 0.3363 0.5841 0.5856
""",
}
"""By plan, a line for each axis: state, p-value, adjusted, alone, common log ratio, distance ratio,
health index, effects by patterns, spectrum and profile, and p-values by those that were asked."""


@pytest.mark.parametrize("plan", known_fleet.PLANS)
def test_verdicts_of_a_fleet_without_chance_to_the_digit(plan):
    lines = DIGITS[plan].split("\n")[1:-1]
    for line, found in zip(lines, known_fleet.judged(plan).values(), strict=True):
        state, *numbers = line.split()
        assert found.state == state
        values = [
            *(found.p_value, found.p_adjusted, found.p_alone, found.common_log_ratio),
            *(found.distance_ratio, found.health_index),
            *found.effects.values(),
            *found.witnesses.values(),
        ]
        assert values == pytest.approx([float(v) for v in numbers], rel=1e-3, nan_ok=True)
        n_baseline, n_target, _, _ = known_fleet.PLANS[plan]
        assert (found.n_baseline_sessions, found.n_target_sessions) == (n_baseline, n_target)
        assert (found.n_baseline_cycles, found.n_target_cycles) == (4 * n_baseline, 4 * n_target)


def test_one_session_without_some_motions():
    """Motions that either side lacks say nothing; without any nothing is known."""
    whole = known_fleet.bundle(2, 1, 1, (), 0.0).cells
    no_baseline = replace(whole[1], baseline=0 * whole[1].baseline)
    no_target = replace(whole[1], target=0 * whole[1].target)
    alone = one_session_log_ratio(whole[:1])
    assert one_session_log_ratio([whole[0], no_baseline]) == alone
    assert one_session_log_ratio([whole[0], no_target]) == alone
    assert one_session_log_ratio(whole) != alone
    assert np.isnan(one_session_log_ratio([no_baseline, no_target]))


def test_cycles_are_counted_in_the_motion_that_has_most():
    cells = known_fleet.bundle(2, 6, 1, (), 0.0).cells
    fewer = replace(cells[1], cycles=cells[1].cycles[:20], target_cycles=cells[1].target_cycles[:3])
    found = decide({1: Bundle([cells[0], fewer])})[1]
    assert (found.n_baseline_cycles, found.n_target_cycles) == (24, 4)


def test_what_siblings_have_in_common_is_that_of_the_middle_one():
    def shifts(*ratios):
        spreads = (0.1, 0.2, 0.1, 0.4, 0.1)
        return {
            k: Shift(r, 1.0, Spread(s, 5))
            for k, (r, s) in enumerate(zip(ratios, spreads, strict=False))
        }

    # of two the lower one, as a ratio or in units of the spread, whichever is more
    assert common_log_ratio(shifts(9.0, 2.0, 3.0), 0) == pytest.approx(2.0)
    assert common_log_ratio(shifts(9.0, 2.0, 0.6), 0) == pytest.approx(0.6)
    assert common_log_ratio(shifts(9.0, 2.0, 0.6), 1) == pytest.approx(1.2)
    assert common_log_ratio(shifts(9.0, 2.0, 3.0), 0, largest=True) == 3.0
    assert common_log_ratio(shifts(9.0, -2.0, -3.0), 0, largest=True) == 0.0
    assert common_log_ratio(shifts(9.0, -2.0, -3.0), 0) == 0.0
    assert common_log_ratio(shifts(9.0, 2.0), 0) == 0.0
    assert common_log_ratio(shifts(9.0, 2.0, 3.0), 7) == 0.0


def test_a_joint_among_its_siblings_of_one_session():
    lone = one_session_shift({1: 0.7, 2: 0.1, 3: np.nan}, 1)
    prior = HEALTHY_SHIFT_SPREAD
    assert (lone.log_ratio, lone.unit) == (0.7, prior.scale)
    assert lone.spread.scale == pytest.approx(prior.scale * np.sqrt(1 + 1 / 6))
    # 0 stands for published joints beside the two siblings: median 0.1, deviations 0.1 and 0.2
    beside = one_session_shift({1: 0.7, 2: 0.1, 3: 0.3}, 1)
    assert beside.log_ratio == pytest.approx(0.6)
    blended = moderated_spread((1.4826 * 0.1) ** 2, 0.37 * 2, prior)
    assert beside.unit == blended.scale
    assert beside.spread == Spread(pytest.approx(blended.scale * np.sqrt(1 + 1 / 3)), blended.dof)


def test_a_robot_of_one_motion_is_judged():
    found = judge(cells(Fleet(n_motions=1, severity=0.5), 0))
    assert [axis for axis, one in found.items() if one.state != "healthy"] == [3]


def test_the_patterns_are_a_witness_by_name_and_alone_for_two_sessions():
    for n_baseline, names in ((3, ["patterns", "spectrum"]), (2, ["patterns"])):
        plan = Fleet(n_baseline=n_baseline)
        witness = SpectrumEvidence(spectra(plan, 0)[1], n_baseline)
        assert list(Bundle(cells(plan, 0)[1], {"spectrum": witness}).evidence()) == names
