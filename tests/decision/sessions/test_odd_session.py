"""A worn session among the baseline's."""

from dataclasses import replace

import numpy as np
import pytest

from opamc_cli.decision.judge import Bundle, Policy, judge, one_of_many
from opamc_cli.decision.sessions.odd_session import _odd_one, judge_without_odd, odd_sessions
from opamc_cli.decision.witnesses.spectra import SpectrumEvidence
from tests.decision.fleet import Fleet, cells, spectra


def robot(seed: int, *worn: int, n_baseline: int = 6) -> dict[int, Bundle]:
    """Six joints; of the third some baseline sessions, and the target, may have other spectra."""
    names = tuple(f"2026-03-0{day}" for day in range(1, n_baseline + 1))
    plan = Fleet(n_baseline=n_baseline)
    found, known = {}, spectra(plan, seed)
    for axis, own in cells(plan, seed).items():
        power = known[axis]
        if axis == 3 and worn:
            for cell, spectrum in zip(own, power, strict=True):
                cell.target[0] = cell.target[0][::-1]
                cell.baseline[[*worn]] = cell.baseline[[*worn]][:, ::-1]
                spectrum.sessions[[*worn, n_baseline]] += 1.5
        witnesses = {"spectrum": SpectrumEvidence(power, n_baseline)}
        found[axis] = Bundle(own, witnesses, ("2026-03-20",), names)
    return found


@pytest.mark.parametrize("worn", [0, 3, 5])
def test_a_worn_night_of_the_baseline_is_found_and_hides_no_fault_any_more(worn):
    """One of six was what healthy nights differ by, and the target's same fault was none."""
    bundles = robot(1, worn)
    before = judge(bundles)
    assert before[3].state == "healthy"
    odd = odd_sessions(bundles, before)
    assert odd == {3: (f"2026-03-0{worn + 1}",)}
    _, after, same = judge_without_odd(bundles)
    assert same == odd
    assert after[3].state == "fault"
    assert after[3].n_baseline_sessions == 5


@pytest.mark.parametrize(("by", "found"), [(3.0, True), (0.3, False)], ids=["filter", "hall"])
def test_what_moves_all_joints_of_a_night_as_no_hall_does_is_found(by, found):
    """Each excused the others, and a fault had to lie beyond what a changed filter does."""
    bundles = robot(1)
    for bundle in bundles.values():
        for spectrum in bundle.witnesses["spectrum"].cells:
            spectrum.sessions[2] += by
    odd = odd_sessions(bundles, judge(bundles))
    assert odd == (dict.fromkeys(bundles, ("2026-03-03",)) if found else {})


def test_beside_a_baseline_that_was_chosen_a_target_differs_by_more():
    """The session left out was the farthest of six: chance alone brings the rest nearer."""
    bundles = robot(1, 3)
    kept, after, _ = judge_without_odd(bundles)
    plain = judge(kept)
    assert after[3].p_adjusted == 6 * plain[3].p_adjusted
    assert after[3].p_alone == 6 * plain[3].p_alone
    assert {axis: after[axis] for axis in (1, 2, 4)} == {axis: plain[axis] for axis in (1, 2, 4)}
    uncertain = Policy(false_alarm_rate=3 * max(plain[3].p_adjusted, plain[3].p_alone))
    assert judge(kept, uncertain)[3].state == "fault"
    assert one_of_many(plain[3], 6, uncertain).state == "healthy"


@pytest.mark.parametrize(("n_baseline", "worn"), [(6, (4, 5)), (6, (3, 4, 5)), (8, (5, 6, 7))])
def test_worn_nights_at_the_end_of_a_baseline_do_not_hide_each_other(n_baseline, worn):
    """None is odd alone: a joint that began to wear while its baseline was recorded was healthy."""
    bundles = robot(1, *worn, n_baseline=n_baseline)
    before = judge(bundles)
    assert before[3].state == "healthy"
    assert _odd_one(bundles, before, Policy()) == {}
    odd = odd_sessions(bundles, before)
    assert odd == {3: tuple(f"2026-03-0{night + 1}" for night in worn)}
    after = judge(bundles | {3: bundles[3].without(odd[3])})
    assert after[3].state == "fault"
    assert after[3].n_baseline_sessions == n_baseline - len(worn)


def test_the_end_of_a_baseline_is_that_in_time():
    bundles = robot(1, 0, 3)
    names = bundles[3].baseline_sessions
    before = judge(bundles)
    assert odd_sessions(bundles, before) == {}
    in_time = [*names[1:3], *names[4:], names[0], names[3]]
    assert odd_sessions(bundles, before, in_time=in_time) == {3: (names[0], names[3])}


def test_two_of_four_sessions_do_not_tell_which_two_are_worn():
    bundles = robot(1, 2, 3, n_baseline=4)
    assert odd_sessions(bundles, judge(bundles)) == {}


@pytest.mark.long
def test_healthy_baselines_hang_together():
    """At the level of 1 % a robot."""
    found = [odd_sessions(one, judge(one)) for one in (robot(seed) for seed in range(30))]
    assert sum(map(bool, found)) <= 1


def test_three_sessions_do_not_tell_which_of_them_is_odd():
    bundles = robot(1, 2, n_baseline=3)
    assert odd_sessions(bundles, judge(bundles)) == {}


def test_a_session_that_is_held_out_is_judged_as_a_target_of_the_others():
    bundle = robot(2)[1]
    held_out = bundle.held_out(4)
    names = bundle.baseline_sessions
    assert (held_out.baseline_sessions, held_out.target_sessions) == (
        (*names[:4], names[5]),
        (names[4],),
    )
    cell, own = held_out.cells[0], bundle.cells[0]
    np.testing.assert_array_equal(cell.target, own.baseline[[4]])
    np.testing.assert_array_equal(cell.baseline, own.baseline[[0, 1, 2, 3, 5]])
    spectrum, whole = (one.witnesses["spectrum"] for one in (held_out, bundle))
    assert (spectrum.n_baseline, whole.n_baseline) == (5, 6)
    rows = [0, 1, 2, 3, 5, 4]
    np.testing.assert_array_equal(spectrum.cells[0].sessions, whole.cells[0].sessions[rows])
    # who has no names is asked nothing
    unnamed = replace(bundle, baseline_sessions=())
    assert odd_sessions({1: unnamed}, judge({1: unnamed})) == {}


@pytest.mark.parametrize("severity", [0.0, 0.15, 1.0])
def test_without_the_effects_of_healthy_joints_a_judgement_is_the_same(severity):
    for seed in range(5):
        made = cells(Fleet(severity=severity), seed)
        bundles = {axis: Bundle(tuple(own)) for axis, own in made.items()}
        plain, unsized = judge(bundles), judge(bundles, sized=False)
        for axis, judged in plain.items():
            improbable = max(judged.p_adjusted, judged.p_alone) <= Policy().false_alarm_rate
            effects = judged.effects if improbable else dict.fromkeys(judged.effects, np.nan)
            assert repr(unsized[axis]) == repr(replace(judged, effects=effects))
        assert (plain[3].state == "fault") == (severity == 1.0)
