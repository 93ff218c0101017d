"""What an effect is unless it says otherwise."""

from types import SimpleNamespace

import numpy as np
import pytest

from opamc_cli.joint.effects.base import Effect, geometric, stack

TRACK = SimpleNamespace(size=3, channels={"position", "logged"})


class Named(Effect):
    name, domain, meaning = "named", "velocity", "what it means"
    searches = ("a", "b")
    per = ("rad/s", "", "current")

    def limits(self, track):
        return {"a": (0.1, 10.0), "b": (0.0, 2.0), "c": (4.0, 5.0), "d": (1.0, 5.0)}


def test_a_channel_that_is_needed_and_absent_is_told():
    effect = Named()
    assert effect.untestable(TRACK) is None
    effect.needs = ("position", "temperature")
    assert effect.untestable(TRACK) == "no temperature channel"
    effect.needs = ("humidity",)
    assert effect.untestable(TRACK) == "no humidity"


def test_a_first_step_is_four_tenths_or_a_twentieth_of_narrow_limits():
    steps = Named().first_steps(TRACK, {"a": 2.0, "c": 4.2})
    assert steps == pytest.approx({"a": 0.8, "b": 0.1, "c": 0.05, "d": 0.2})


def test_searched_parameters_are_counted_where_they_are_given():
    assert Named().searched({"a": 1.0, "form": 1.0}) == 1
    assert Named().searched({}) == 0


def test_units_repeat_the_last_one_and_follow_the_current():
    assert Named().coefficient_units({}, 5, "Nm") == ["Nm per rad/s", "Nm", "", "", ""]
    assert Named().coefficient_units({}, 1) == ["A per rad/s"]
    assert Effect().coefficient_units({}, 2) == ["A per regressor"] * 2


def test_friction_resists_and_all_else_may_do_as_it_likes():
    effect = Named()
    assert effect.plausible(np.array([-1.0]), {})
    effect.resists = True
    assert not effect.plausible(np.array([-1.0, 2.0]), {})
    assert not effect.plausible(np.array([0.0]), {})
    assert effect.plausible(np.array([0.1, -2.0]), {})


def test_the_rest_is_nothing_special():
    effect = Named()
    assert effect.guesses(TRACK, np.zeros(3)) == [{}]
    assert effect.variants({}) == []
    assert effect.settled({"a": 1.0}, TRACK) == {"a": 1.0}
    assert effect.interpretation({}, TRACK) == "what it means"
    assert not effect.is_constant({})
    assert effect.origin == "joint"
    effect.origin, effect.from_motion = "load", True
    assert effect.origin != "joint"
    assert effect.is_constant({})
    with pytest.raises(NotImplementedError):
        effect.columns(TRACK, {})


def test_regressors_lie_side_by_side_each_in_one_piece():
    columns = stack(np.arange(3.0), np.ones(3))
    np.testing.assert_array_equal(columns, [[0, 1], [1, 1], [2, 1]])
    assert columns[:, 0].flags.contiguous
    np.testing.assert_allclose(geometric(1.0, 100.0, 3), [1, 10, 100])
