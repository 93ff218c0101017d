"""One night among several that alone is at fault."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from opamc_cli.decision.judge import Bundle, judge
from opamc_cli.decision.sessions.each_session import LoneSession, apart, each_session
from opamc_cli.decision.witnesses.spectra import SpectrumEvidence
from tests.decision.fleet import Fleet, cells, spectra

NAMES = ("2026-03-10", "2026-03-11", "2026-03-12")


def folder(seed: int, damaged: int | None, n_baseline: int = 6) -> dict[int, Bundle]:
    """Three target sessions, of which one may have other spectra and patterns on axis 3."""
    plan = Fleet(n_baseline=n_baseline, n_target=3)
    found = {}
    known = spectra(plan, seed)
    for axis, own in cells(plan, seed).items():
        power = known[axis]
        if axis == 3 and damaged is not None:
            for cell, spectrum in zip(own, power, strict=True):
                cell.target[damaged] = cell.target[damaged][::-1]
                spectrum.sessions[n_baseline + damaged] += 1.5
        found[axis] = Bundle(own, {"spectrum": SpectrumEvidence(power, n_baseline)}, NAMES)
    return found


def at_fault(bundles: dict[int, Bundle]) -> list[tuple[int, str]]:
    return [
        (axis, one.session)
        for axis, each in each_session(bundles).items()
        for one in each
        if one.judgement.state == "fault"
    ]


@pytest.mark.parametrize("damaged", range(3))
def test_the_damaged_one_is_named_wherever_it_stands(damaged):
    assert at_fault(folder(1, damaged)) == [(3, NAMES[damaged])]


@pytest.mark.long
def test_healthy_folders_stay_healthy():
    assert [at_fault(folder(seed, None)) for seed in range(20)] == [[]] * 20


def test_a_session_alone_is_judged_as_if_the_others_were_not_there():
    bundles = folder(1, 2)
    alone = each_session(bundles)[3][2]
    own = {axis: bundle.of_target(2) for axis, bundle in bundles.items()}
    judged = judge(own)[3]
    assert alone.judgement.p_value == min(3 * judged.p_value, 1.0)
    assert alone.judgement.health_index == judged.health_index
    assert alone.judgement.n_target_sessions == 1
    assert alone.bundle.target_sessions == NAMES[2:]


def test_one_session_is_asked_once_only():
    own = {axis: bundle.of_target(0) for axis, bundle in folder(1, None).items()}
    assert each_session(own) == {axis: [] for axis in own}


def test_an_axis_that_rests_in_a_session_is_none_of_it():
    bundles = folder(1, 2)
    rested = replace(bundles[3].of_target(2), target_sessions=NAMES[2:])
    assert [one.session for one in each_session(bundles | {3: rested})[3]] == [NAMES[2]]


def test_cycles_of_other_sessions_are_left_out():
    own = cells(Fleet(n_target=2), 0)[1][0]
    number = np.repeat([0, 1], len(own.target_cycles) // 2)
    alone = replace(own, session_of_target_cycle=number).of_sessions(range(6), [7])
    assert np.array_equal(alone.target_cycles.sum(axis=0), own.target[1])


@pytest.mark.parametrize(
    ("far", "near", "named"),
    [
        ([8.0, 9.0], [1.2, 1.3], "ab"),
        ([8.0, 2.7], [1.2, 1.3], "ab"),
        # one sure enough and the next one not quite is no difference between them
        ([8.0, 2.5], [1.2, 1.3], ""),
        ([8.0, 9.0], [], ""),
        ([], [1.2, 1.3], ""),
    ],
)
def test_those_at_fault_are_named_where_they_lie_far_from_the_others(far, near, named):
    states = [*[("fault", ratio) for ratio in far], *[("healthy", ratio) for ratio in near]]
    each = [
        LoneSession(name, Bundle([]), SimpleNamespace(state=state, distance_ratio=ratio))
        for name, (state, ratio) in zip("abcd", states, strict=False)
    ]
    assert "".join(one.session for one in apart(each)) == named


def test_damaged_sessions_lie_apart():
    assert [one.session for one in apart(each_session(folder(1, 1))[3])] == [NAMES[1]]
    assert apart(each_session(folder(1, 1))[2]) == []
