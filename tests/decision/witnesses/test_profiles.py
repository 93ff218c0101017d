"""The course of the current as a witness: heard where it is sure, and ranking nobody."""

import numpy as np
import pytest

from opamc_cli.decision import judge as decision
from opamc_cli.decision.judge import Bundle
from opamc_cli.decision.significance.permutation import relabellings
from opamc_cli.decision.witnesses.deviation import PRIOR_DOF
from opamc_cli.decision.witnesses.profiles import (
    LEAST_SHARE,
    ProfileEvidence,
    between_groups,
    profile_cell,
)
from opamc_cli.decision.witnesses.spectra import SpectrumEvidence
from tests.decision.fleet import Fleet, cells, spectra

PLAN = Fleet(n_axes=4)
MEAN_A = np.sin(np.linspace(0, 3, 32)) + 1.5


def courses(seed: int, raised: float, everyone: bool = False) -> dict[int, ProfileEvidence]:
    """Draw courses whose size wanders by 2 % a session; the target's is raised, A."""
    rng = np.random.default_rng([seed, 2])
    n_sessions = PLAN.n_baseline + PLAN.n_target
    session = np.repeat(np.arange(n_sessions), PLAN.n_cycles)
    found = {}
    for axis in range(1, PLAN.n_axes + 1):
        size = rng.normal(1, 0.02, n_sessions)[session, np.newaxis]
        rows = MEAN_A * size + rng.normal(0, 0.01, (len(session), 32))
        if everyone or axis == PLAN.faulty:
            rows += np.where(session >= PLAN.n_baseline, raised, 0.0)[:, np.newaxis]
        found[axis] = ProfileEvidence([profile_cell(0, rows, session, n_sessions)], PLAN.n_baseline)
    return found


def judged(seed: int, raised: float, *, course: bool = True, everyone: bool = False):
    patterns, powers = cells(PLAN, seed), spectra(PLAN, seed)
    by_course = courses(seed, raised, everyone)
    return decision.judge(
        {
            axis: Bundle(
                own,
                {"spectrum": SpectrumEvidence(powers[axis], PLAN.n_baseline)}
                | ({"profile": by_course[axis]} if course else {}),
            )
            for axis, own in patterns.items()
        }
    )


def test_a_course_that_moved_for_sure_is_found_though_nothing_else_did():
    found = [judged(seed, 0.8)[PLAN.faulty] for seed in range(8)]
    assert sum(one.state != "healthy" for one in found) >= 7
    assert np.median([one.health_index for one in found]) > 10
    assert sum(judged(seed, 0.8, course=False)[3].state != "healthy" for seed in range(8)) == 0


@pytest.mark.parametrize("seed", range(3))
def test_a_course_that_is_not_sure_changes_no_rank(seed):
    with_it, without = judged(seed, 0.0), judged(seed, 0.0, course=False)
    step = 1 / (PLAN.n_baseline + 1)
    for axis, one in without.items():
        if one.p_value > step and with_it[axis].p_value > step:
            assert with_it[axis].p_value == one.p_value
            assert with_it[axis].distance_ratio == one.distance_ratio


def test_a_course_that_moved_on_all_joints_is_the_fault_of_none():
    found = [judged(seed, 0.8, everyone=True) for seed in range(5)]
    states = [one.state for joints in found for one in joints.values()]
    assert states.count("healthy") >= len(states) - 1


def test_healthy_sessions_seldom_have_a_sure_course():
    p = [judged(seed, 0.0)[3].witnesses["profile"] for seed in range(40)]
    assert np.mean(np.array(p) < 0.1) < 0.25
    assert min(p) > 1e-3


def slow_between(sessions, is_target):
    """The definition, labelling by labelling and part by part."""
    known = np.isfinite(sessions).all(axis=1)
    found = []
    for row in is_target:
        a, b = sessions[known & row], sessions[known & ~row]
        dof = len(a) + len(b) - 2
        if not (len(a) and len(b)) or dof < 1:
            found.append(np.nan)
            continue
        squares = ((a - a.mean(axis=0)) ** 2).sum(axis=0) + ((b - b.mean(axis=0)) ** 2).sum(axis=0)
        own = squares / dof
        variance = (PRIOR_DOF * own.mean() + dof * own) / (PRIOR_DOF + dof)
        variance = np.maximum(variance, LEAST_SHARE**2) * (1 / len(a) + 1 / len(b))
        found.append(((a.mean(axis=0) - b.mean(axis=0)) ** 2 / variance).mean())
    return np.array(found)


@pytest.mark.parametrize(
    ("n_baseline", "n_target", "scatter"), [(5, 2, 0.3), (3, 1, 1.0), (4, 3, 0)]
)
def test_groups_differ_by_their_definition(n_baseline, n_target, scatter):
    rng = np.random.default_rng(n_baseline)
    sessions = 2.0 + scatter * rng.normal(size=(n_baseline + n_target, 6)) * np.arange(1, 7)
    sessions[1] = np.nan
    labels = relabellings(n_baseline, n_target)
    expected = slow_between(sessions, labels)
    np.testing.assert_allclose(between_groups(sessions, labels), expected, rtol=1e-9, atol=1e-12)
    # two groups of one session each have no scatter to be judged by
    assert np.isnan(between_groups(sessions[[0, 2]], np.array([[False, True]]))).all()


def test_sessions_that_agree_have_a_thousandth_for_a_scatter():
    sessions = np.array([[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.002, 0.001]])
    distance = between_groups(sessions, np.array([[False, False, False, True]]))
    assert distance == pytest.approx([2.5 / (1 + 1 / 3)])
