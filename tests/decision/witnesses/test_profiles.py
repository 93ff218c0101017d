"""The course of the current as a witness."""

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
    assert np.median([one.p_adjusted for one in found]) < 1e-3
    assert min(one.health_index for one in found) > 1
    assert sum(judged(seed, 0.8, course=False)[3].state != "healthy" for seed in range(8)) == 0


def test_a_course_that_moved_on_all_joints_is_the_fault_of_none():
    found = [judged(seed, 0.8, everyone=True) for seed in range(5)]
    states = [one.state for joints in found for one in joints.values()]
    assert states.count("healthy") >= len(states) - 1


@pytest.mark.long
def test_healthy_sessions_seldom_have_a_sure_course():
    p = [judged(seed, 0.0)[3].witnesses["profile"] for seed in range(40)]
    assert np.mean(np.array(p) < 0.1) < 0.25
    assert min(p) > 1e-3


def test_a_course_by_hand():
    courses = np.array([[1.0, 3.0], [3.0, 5.0], [6.0, 8.0]])
    cell = profile_cell(7, courses, np.array([0, 0, 2]), 3)
    # sessions' means 2, 4 and 6, 8; their mean 4, 6, of root mean square 26 ** 0.5
    rms = 26**0.5
    np.testing.assert_allclose(cell.course * rms, [[2, 4], [np.nan, np.nan], [6, 8]])
    assert (cell.motion, cell.rms_a, cell.cycles.tolist()) == (7, pytest.approx(rms), [2, 0, 1])
    np.testing.assert_allclose(cell.within * rms**2, [2, 2])
    np.testing.assert_allclose(cell.scale[[0, 2]], [32 / 52, 72 / 52])
