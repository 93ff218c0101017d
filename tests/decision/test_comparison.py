"""The joints of a diagnosis side by side."""

import numpy as np
import pytest
from scipy.stats import kstest

from opamc_cli.decision.comparison import FAR_OUT, Joint, compare_sessions
from opamc_cli.decision.significance.multiplicity import harmonic_mean
from opamc_cli.decision.significance.spread import spliced_p_value
from opamc_cli.decision.witnesses.evidence import soft_maximum
from opamc_cli.decision.witnesses.patterns import Cell, PatternEvidence
from opamc_cli.decision.witnesses.profiles import ProfileEvidence, profile_cell
from opamc_cli.decision.witnesses.spectra import SpectrumCell, SpectrumEvidence
from tests.decision.fleet import Fleet, cells, spectra

BINS = 40


def joint(
    seed: int, *, colder: float = 0.0, spectrum: float = 0.0, patterns: float = 0.0, n_target=1
):
    """Six nights that a hidden temperature moves, and the target's; the patterns bend with it."""
    rng = np.random.default_rng(seed)
    n = 6 + n_target
    cold = rng.normal(size=n)
    cold[6:] = colder
    is_target = (np.arange(n) >= 6)[:, np.newaxis]
    shapes = np.random.default_rng(1).normal(size=(3, BINS))
    power = 0.1 * cold[:, np.newaxis] * shapes[0]
    power = power + is_target * spectrum * shapes[2] + 0.05 * rng.normal(size=(n, BINS))
    bent = 0.1 * cold[:, np.newaxis] * shapes[0] + 0.02 * cold[:, np.newaxis] ** 2 * shapes[1]
    odds = np.exp((bent + is_target * patterns * shapes[2])[:, :24])
    counts = rng.multinomial(16000, odds / odds.sum(axis=1, keepdims=True)).astype(float)
    session = np.repeat(np.arange(n), 4)
    course = 1 + 0.05 * cold[session, np.newaxis] * shapes[0][:20]
    course = course + 0.005 * rng.normal(size=course.shape)
    within = np.full(BINS, 4 * 0.05**2)
    return {
        "patterns": PatternEvidence(
            [Cell(0, 4, 1, counts[:6], counts[6:], counts[:6], counts[6:], 1.0)]
        ),
        "spectrum": SpectrumEvidence(
            [SpectrumCell(0, power, np.full(n, 4.0), within, 4, 10, 1.0)], 6
        ),
        "profile": ProfileEvidence([profile_cell(0, course, session, n)], 6),
    }


def compared(joints, n_target: int = 1):
    sizes = dict.fromkeys(joints, (6, n_target))
    return compare_sessions(joints, sizes, permutations=200, seed=0)


def test_a_night_of_unusual_weather_is_excused_and_a_change_is_not():
    p = {}
    for name, case in {"usual": {}, "cold": {"colder": 4.0}, "changed": {"patterns": 0.3}}.items():
        p[name] = [compared({1: joint(s, **case)})[1].witnesses["patterns"] for s in range(20)]
    assert np.mean(np.array(p["usual"]) < 0.05) <= 0.15
    assert np.median(p["cold"]) > 0.05
    assert np.median(p["changed"]) < 1e-3


def test_conditions_that_siblings_tell_of_excuse_what_bends_and_no_fault():
    def p_alone(siblings_colder: float, spectrum: float) -> list[float]:
        return [
            compared(
                {
                    1: joint(100 * seed + 1, colder=-5.0, spectrum=spectrum),
                    **{axis: joint(100 * seed + axis, colder=siblings_colder) for axis in (2, 3)},
                }
            )[1].p_alone
            for seed in range(6)
        ]

    assert np.median(p_alone(siblings_colder=0.0, spectrum=0.3)) < 0.01
    assert np.median(p_alone(siblings_colder=-5.0, spectrum=0.3)) > 0.05
    assert np.median(p_alone(siblings_colder=-5.0, spectrum=2.0)) < 1e-4


def test_unusual_weather_is_told():
    told = {
        c: [compared({1: joint(s, colder=c)})[1].unusual_log_ratio for s in range(9)]
        for c in (0, 4)
    }
    assert np.median(told[0]) < 0.5
    assert np.median(told[4]) > 1


def test_the_witnesses_are_joined_by_the_harmonic_mean_of_their_voices():
    found = compared({1: joint(0, spectrum=0.3)})[1]
    # four voices, the profile's two among them; the spectrum, which is the least, weighs half
    assert min(found.witnesses, key=found.witnesses.__getitem__) == "spectrum"
    assert found.p_value <= 2 * found.witnesses["spectrum"]
    assert found.p_value >= harmonic_mean(list(found.witnesses.values())) / 3


def test_what_all_joints_share_is_taken_off():
    joints = {axis: joint(axis, spectrum=0.3) for axis in range(1, 5)}
    for one in compared(joints).values():
        assert one.p_value < 0.01
        assert one.common_log_ratio > 1
        assert one.p_alone > 0.05
    joints = {axis: joint(axis, spectrum=0.3 if axis == 2 else 0.0) for axis in range(1, 5)}
    found = compared(joints)
    assert found[2].p_alone < 0.01
    assert found[1].p_value > 0.01


def test_the_order_of_joints_and_the_place_of_a_joint_do_not_count():
    joints = {axis: joint(axis, spectrum=0.1 * axis) for axis in (1, 2, 3)}
    turned = compared({axis: joints[axis] for axis in (3, 1, 2)})
    for axis, one in compared(joints).items():
        assert turned[axis].p_value == pytest.approx(one.p_value)
        assert turned[axis].p_alone == pytest.approx(one.p_alone)


def test_the_first_of_all_sessions_is_in_the_lowest_step_and_no_deeper_by_its_rank():
    for seed in range(20):
        found = compared({1: joint(seed)})[1]
        if found.p_value < 0.5 / 7:
            # below half a step the tails' own word is needed
            assert min(found.witnesses.values()) < 0.5 / 7


def test_several_targets_are_exchanged_as_whole_sessions():
    changed = compared({1: joint(3, spectrum=0.3, n_target=3)}, n_target=3)[1]
    healthy = compared({1: joint(3, n_target=3)}, n_target=3)[1]
    assert changed.p_value < 0.01
    assert healthy.p_value > 0.01


def test_the_first_of_all_labellings_is_in_the_lowest_step_and_no_deeper_by_its_rank():
    """Ten labellings of three sessions against three: how far apart they lie says no more."""
    plan, first = Fleet(n_baseline=3, n_target=3, n_axes=3, n_motions=1, influences=1), 0
    for seed in range(20):
        patterns, powers = cells(plan, seed), spectra(plan, seed)
        joints = {
            axis: {
                "patterns": PatternEvidence(own),
                "spectrum": SpectrumEvidence(powers[axis], 3),
            }
            for axis, own in patterns.items()
        }
        found = compare_sessions(joints, dict.fromkeys(joints, (3, 3)), 1000, 0)
        for one in found.values():
            first += one.p_value <= 1 / 10
            assert one.p_value >= min(0.5 / 10, min(one.witnesses.values()))
    assert first


def test_how_far_in_a_healthy_session_lies_is_uniform_below_the_last_rank():
    own = Joint(joint(0), 6, 1)
    weights, rng = own.weights(own.voices), np.random.default_rng(0)
    p = []
    for draw in range(2000):
        voices = rng.normal(size=(len(weights), 4 + draw % 6))
        places = soft_maximum(voices - np.median(voices, axis=1, keepdims=True), weights)
        places -= np.median(places)
        p.append(spliced_p_value(places[:-1], places[-1], FAR_OUT, below=own.far_in()))
    inner = np.array([one for one in p if one > 0.5])
    assert kstest(2 * inner - 1, "uniform").pvalue > 0.01
    assert np.mean(inner > 0.95) == pytest.approx(0.1, abs=0.025)


def test_two_sessions_of_the_same_few_patterns_are_not_certain_of_a_third():
    """Ten patterns a motion, which a drive repeats; one of them is another in the target."""
    same = np.zeros((2, 24))
    same[:, :5] = 2
    target = same[:1].copy()
    target[0, :2] = 1, 3
    joints = {
        axis: {"patterns": PatternEvidence([Cell(0, 4, 1, same, last, same, last, 1.0)])}
        for axis, last in {1: target, 2: same[:1], 3: same[:1]}.items()
    }
    found = compare_sessions(joints, dict.fromkeys(joints, (2, 1)), 1000, 0)
    assert found[1].p_value > 0.05
    assert found[2].p_value > 0.2


def test_three_sessions_of_the_same_patterns_leave_the_word_to_others():
    same = np.zeros((3, 24))
    same[:, :5] = 2
    target = same[:1].copy()
    target[0, :2] = 1, 3
    patterns = PatternEvidence([Cell(0, 4, 1, same, target, same, target, 1.0)])
    plan = Fleet(n_baseline=3, n_axes=1, n_motions=1)
    powers = SpectrumEvidence(spectra(plan, 0)[1], 3)
    both, alone = (
        compare_sessions({1: own}, {1: (3, 1)}, 1000, 0)[1]
        for own in ({"patterns": patterns, "spectrum": powers}, {"spectrum": powers})
    )
    assert both.p_value == alone.p_value
    assert np.isnan(both.witnesses["patterns"])


def test_patterns_that_vary_more_than_is_expected_make_few_false_alarms():
    """Each session's patterns have moved a way of their own, some hardly and some far."""
    rng, alarms = np.random.default_rng(0), 0
    for _ in range(250):
        far = 0.02 * np.sqrt(rng.chisquare(1, 6))[:, np.newaxis]
        moved = np.full((6, 24), 1 / 24) * np.exp(far * rng.normal(size=(6, 24)))
        counts = 1e7 * moved / moved.sum(axis=1, keepdims=True)
        cell = Cell(0, 4, 1, counts[:5], counts[5:], counts[:5], counts[5:], 1.0)
        found = compare_sessions({1: {"patterns": PatternEvidence([cell])}}, {1: (5, 1)}, 1000, 0)
        alarms += found[1].witnesses["patterns"] <= 0.01
    assert alarms <= 3
