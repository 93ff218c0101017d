"""What is said of a joint that is far out and yet called healthy."""

import pytest

from opamc_cli.config.models import ScoreConfig
from opamc_cli.stages.verdict.agreement.common import far_together


def verdict(*axes):
    entries = [
        {
            **{"axis": axis, "state": "healthy", "health_index": index},
            **{"p_adjusted": p_adjusted, "distance": {"effect": effect}},
        }
        for axis, (index, p_adjusted, effect) in enumerate(axes, 1)
    ]
    return {"axes": entries}


@pytest.mark.parametrize(
    ("p_adjusted", "effect", "said"),
    [
        # as a current's gain that is off by 6 %: to record it again shows the same
        (1e-9, 0.057, "is 5.7%, less than score.minimum_effect (10.0%)"),
        (0.2, 0.057, "does not suffice to call it changed"),
        (1e-9, 0.2, "does not suffice to call it changed"),
        (1e-9, None, "does not suffice to call it changed"),
    ],
)
def test_a_change_that_is_certain_and_small_is_called_small(p_adjusted, effect, said):
    found = far_together(verdict((40.0, p_adjusted, effect), (0.5, 0.8, 0.0)), ScoreConfig())
    assert list(found) == [1]
    assert said in found[1][0]


def test_joints_that_are_far_together_are_no_small_changes():
    found = far_together(verdict((40.0, 1e-9, 0.05), (50.0, 1e-9, 0.05)), ScoreConfig())
    assert list(found) == [1, 2]
    assert all("other joints lie as far" in why for (why,) in found.values())


def test_a_joint_near_its_baseline_is_nothing_to_tell():
    assert far_together(verdict((2.0, 0.3, 0.01)), ScoreConfig()) == {}
