"""A baseline of one session: what siblings and published joints say of how healthy ones differ."""

from dataclasses import replace

import numpy as np
import pytest

from opamc_cli.decision.judge import Policy
from opamc_cli.decision.one_session import (
    HEALTHY_SHIFT_SPREAD,
    one_session_log_ratio,
    one_session_shift,
)
from opamc_cli.decision.significance.spread import Spread, moderated_spread
from tests.decision import known_fleet
from tests.decision.fleet import judge


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


def test_what_a_single_baseline_session_would_have_shown_lies_between_what_it_shows_and_not():
    found = known_fleet.judged("one session")
    assert found[2].state == "fault"
    seen = found[2].effects["patterns"]
    for axis in (1, 3, 5):
        assert found[axis].effects["patterns"] < found[axis].least_effect < seen
    strict = judge(
        {axis: known_fleet.bundle(axis, 1, 1, (), 0.0).cells for axis in range(1, 6)},
        Policy(false_alarm_rate=1e-4),
    )
    assert strict[1].least_effect > found[1].least_effect
    assert np.isnan(known_fleet.judged("six sessions")[1].least_effect)
