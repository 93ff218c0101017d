"""The loop on the virtual testbed: an effect that is switched on is the one that is found.

The joint of configs/closing.yaml holds the declared effects and hardly anything else; each test
switches on what the model does not declare. The recordings are those of one seed, taken before
anything was run on it.
"""

import pytest
from testbed_closing import (
    SENSING,
    close_on_testbed,
    declared_on_testbed,
    error_on,
    names_of,
)

from opamc_cli.joint.fit.model import Fit
from opamc_cli.joint.loop import Loop
from opamc_cli.joint.motion.track import Joint
from tests.marks import long

SEED = 100

FROM_CURRENT = "the motion comes from the phase currents themselves"
UNTESTABLE = {("elasticity", "phases"), ("time_delay", "phases")}
"""What recordings without a position cannot show."""

TIED = {"asymmetric_friction"}
"""The testbed's is a constant while the joint moves: nobody can tell it from an offset."""


CASES = [
    long("ripple", "position and current"),
    ("stribeck", "phases"),
    long("gravity", "position and current"),
    long("asymmetric_friction", "position and current"),
    long("thermal_viscous", "position and current"),
    long("elasticity", "position and current"),
    long("sensor_offset", "position and phases"),
    long("dead_time", "position and phases"),
    long("spring", "phases"),
]
"""One of every domain; `benchmarks/testbed_closings.py` has all."""


@pytest.fixture(scope="session")
def healthy() -> dict[str, Fit]:
    """The joint that lacks nothing, by what is logged."""
    return {sensing: declared_on_testbed(sensing, SEED) for sensing in SENSING}


def fall(loop: Loop, healthy: Fit) -> float:
    """Share of the sealed mean square above that of the healthy joint that is gone."""
    excess = loop.rmse_before_a**2 - error_on(healthy, loop) ** 2
    return float((loop.rmse_before_a**2 - loop.rmse_after_a**2) / excess)


@pytest.mark.parametrize("sensing", [SENSING[0], *map(long, SENSING[1:])])
def test_nothing_is_added_to_a_healthy_joint(sensing):
    loop = close_on_testbed((), sensing, SEED)
    assert loop.verdict == "nothing-missing"
    assert loop.steps == ()


@pytest.mark.parametrize(("effect", "sensing"), CASES)
def test_the_missing_effect_is_found_alone(effect, sensing, healthy):
    loop = close_on_testbed((effect,), sensing, SEED)
    assert len(loop.steps) == 1
    if effect in TIED:
        assert effect in names_of(loop)[0]
    else:
        assert loop.steps[0].term.effect.name == effect
    assert loop.verdict == "closed"
    assert loop.rmse_after_a < loop.rmse_before_a
    assert fall(loop, healthy[sensing]) > 0.85


@pytest.mark.long
@pytest.mark.parametrize(("effect", "sensing"), sorted(UNTESTABLE))
def test_what_the_phases_cannot_show_is_said_to_be_untestable(effect, sensing):
    loop = close_on_testbed((effect,), sensing, SEED)
    reasons = loop.untestable
    assert FROM_CURRENT in reasons[effect]
    assert effect not in set().union(*names_of(loop))


PAIRS = [
    (("load_friction", "warmup"), "position and current"),
    (("payload_change", "ripple"), "phases"),
]


@pytest.mark.long
@pytest.mark.parametrize(("pair", "sensing"), PAIRS)
def test_two_missing_effects_are_both_found(pair, sensing, healthy):
    loop = close_on_testbed(pair, sensing, SEED)
    for effect in pair:
        assert any(effect in names for names in names_of(loop))
    assert len(loop.steps) == 2
    assert fall(loop, healthy[sensing]) > 0.85


@pytest.mark.long
@pytest.mark.parametrize(
    ("effect", "domain", "sensing"),
    [
        pytest.param(
            "mains_hum",
            "frequency",
            "phases",
            marks=pytest.mark.xfail(reason="the unnamed tone does not turn against the field"),
        ),
        ("position_drag", "joint-angle", "position and current"),
    ],
)
def test_an_effect_that_the_library_lacks_is_not_given_another_s_name(effect, domain, sensing):
    loop = close_on_testbed((effect,), sensing, SEED, without=(effect,))
    assert loop.verdict == "not-in-library"
    assert loop.remaining_domain == domain
    assert not any(step.named for step in loop.steps)


def test_gravity_is_declared_without_gear_ratio_and_pole_pairs():
    fitted = declared_on_testbed("phases", SEED, Joint())
    (gravity,) = (term for term in fitted.terms if term.effect.name == "gravity")
    assert gravity.parameters["joint_rad_per_rad"] == pytest.approx(1 / 500, rel=0.02)
