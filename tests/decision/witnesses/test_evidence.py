"""Evidence by patterns and spectra: fair to every session, whatever it is made of."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chisquare, kstest

from opamc_cli.decision.comparison import Joint, scales_of
from opamc_cli.decision.witnesses.evidence import (
    SessionDistances,
    session_distances,
    soft_maximum,
)
from opamc_cli.decision.witnesses.patterns import PatternEvidence
from opamc_cli.decision.witnesses.spectra import SpectrumEvidence
from tests.decision.fleet import Fleet, cells, judge, spectra
from tests.marks import long

SEEDS = range(40)


def turned(plan, seed, place):
    """The same sessions, another one of them the target."""
    patterns, powers = {}, {}
    order = np.r_[np.delete(np.arange(plan.n_baseline + 1), place), place]
    for axis, own in cells(plan, seed).items():
        patterns[axis] = []
        for cell in own:
            sessions = np.concatenate([cell.baseline, cell.target])[order]
            patterns[axis].append(replace(cell, baseline=sessions[:-1], target=sessions[-1:]))
    for axis, own in spectra(plan, seed).items():
        powers[axis] = [replace(c, sessions=c.sessions[order], cycles=c.cycles[order]) for c in own]
    return patterns, powers


def test_no_session_is_favoured_for_being_the_target():
    plan = Fleet(n_axes=2, n_baseline=4)
    for seed in range(3):
        ranks = []
        for place in range(5):
            patterns, powers = turned(plan, seed, place)
            joints = {
                axis: Joint(
                    {
                        "patterns": PatternEvidence(patterns[axis]),
                        "spectrum": SpectrumEvidence(powers[axis], 4),
                    },
                    4,
                    1,
                )
                for axis in patterns
            }
            scales = scales_of(joints.values())
            places = [joint.places(scales, {}) for joint in joints.values()]
            ranks += [[int((own > own[-1]).sum()) for own in places]]
        # over all choices of the target each rank occurs once, on every axis
        np.testing.assert_array_equal(np.sort(ranks, axis=0), np.tile(np.arange(5), (2, 1)).T)


@pytest.mark.long
def test_ranks_and_p_values_of_healthy_joints_are_uniform():
    plan = Fleet(n_axes=3, between_sessions=0.3)
    judged = [judge(cells(plan, s), spectra_by_axis=spectra(plan, s)) for s in SEEDS]
    p = np.array([j.p_value for joints in judged for j in joints.values()])
    assert kstest(p, "uniform").pvalue > 0.01
    assert chisquare(np.histogram(p, bins=7, range=(0, 1))[0]).pvalue > 0.01


@pytest.mark.parametrize(
    "plan",
    [
        Fleet(n_axes=1, n_baseline=3),
        long(Fleet(n_axes=12, n_motions=1)),
        Fleet(n_axes=2, n_baseline=4, n_target=3),
        long(Fleet(n_axes=3, between_sessions=0.4, influences=1)),
    ],
    ids=["lone joint", "twelve joints", "three targets", "wild sessions"],
)
def test_robots_of_any_make_stay_healthy(plan):
    judged = [judge(cells(plan, s), spectra_by_axis=spectra(plan, s)) for s in range(100, 115)]
    states = [j.state for joints in judged for j in joints.values()]
    assert len(states) - states.count("healthy") <= 1


@pytest.mark.parametrize("n_target_cycles", [long(1), 8])
def test_targets_of_fewer_or_more_cycles_keep_the_level(n_target_cycles):
    p = []
    for seed in SEEDS:
        patterns = cells(Fleet(n_axes=2, n_cycles=8, between_sessions=0.05), seed)
        for axis, own in patterns.items():
            for k, cell in enumerate(own):
                # eight cycles were drawn; either side counts the first of them
                sessions = cell.cycles.reshape(6, 8, -1)[:, : 4 if n_target_cycles == 8 else 8]
                target = cell.target_cycles[:n_target_cycles]
                patterns[axis][k] = replace(
                    cell, baseline=sessions.sum(axis=1), target=target.sum(axis=0, keepdims=True)
                )
        p += [j.p_value for j in judge(patterns).values()]
    # A single cycle scatters more than the baseline's sessions do, which p cannot know.
    assert np.mean(np.array(p) <= 0.01) <= 0.05
    assert 0.3 < np.median(p) < 0.7


def test_a_session_without_spectrum_leaves_the_patterns_to_decide():
    plan = Fleet(severity=1.0)
    powers = spectra(plan, 0)
    for own in powers.values():
        for cell in own:
            cell.sessions[2] = np.nan
            cell.cycles[2] = 0
    judged = judge(cells(plan, 0), spectra_by_axis=powers)
    alone = judge(cells(plan, 0))
    assert judged[plan.faulty].state == "fault"
    assert judged[1].p_value == alone[1].p_value


def test_two_sessions_are_judged_by_patterns_alone():
    plan = Fleet(n_baseline=2, n_axes=3, severity=1.0)
    judged, alone = judge(cells(plan, 0), spectra_by_axis=spectra(plan, 0)), judge(cells(plan, 0))
    assert [j.p_value for j in judged.values()] == [j.p_value for j in alone.values()]


def test_each_session_is_held_against_the_same_rest_as_the_target():
    plan = Fleet(n_axes=1, n_baseline=4, n_target=2)
    evidence = SpectrumEvidence(spectra(plan, 3)[1], 4)
    found = session_distances(evidence, 4, 2)["orthogonal"]
    assert (found.own.shape, found.target.shape, found.each.shape) == ((4,), (4, 2), (5,))
    without = [replace(c, sessions=c.sessions[1:], cycles=c.cycles[1:]) for c in evidence.cells]
    # the first target session beside baseline 1 to 3 is what `each` says of it without session 0
    fewer = session_distances(SpectrumEvidence(without, 3), 3, 2)["orthogonal"]
    assert fewer.each[-1] == pytest.approx(found.target[0, 0])


def test_a_ratio_is_of_geometric_means_beyond_and_of_arithmetic_ones_along():
    one = SessionDistances(np.log([1.0, 4.0]), np.log([[2.0], [8.0]]), np.zeros(3))
    assert one.log_ratio("orthogonal") == pytest.approx(np.log(4.0 / 2.0))
    assert one.log_ratio("score") == pytest.approx(np.log(5.0 / 2.5))


def test_a_soft_maximum_lies_between_the_mean_and_the_largest():
    values = np.array([[0.0, 5.0], [0.0, 0.0], [0.0, 0.0]])
    found = soft_maximum(values, [1, 1, 1])
    np.testing.assert_allclose(found, [0.0, np.log((np.exp(5.0) + 2) / 3)])
    heard = soft_maximum(values, [2, 1, 1])
    np.testing.assert_allclose(heard, [0.0, np.log((2 * np.exp(5.0) + 2) / 4)])
