"""The course of the current as a witness: heard where it is sure, and ranking nobody."""

import numpy as np
import pytest

from opamc_cli.decision import judge as decision
from opamc_cli.decision.judge import Bundle
from opamc_cli.decision.witnesses.profiles import ProfileEvidence, profile_cell
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
