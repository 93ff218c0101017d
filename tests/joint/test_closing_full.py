"""The loop on a joint of configs/testbed.yaml with all its parts.

Its kinematic error moves the joint near the joint's own resonance, the gear winds up, and friction
follows load, speed and temperature. What the model does not declare may be found; what is not there
may not: the reported current is 0.5 ms late, and nothing else is.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from opamc_cli.config.testbed import load_testbed
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.explain.declared import Ways
from opamc_cli.joint.loop import close_loop
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Joint
from opamc_cli.testbed.robot import simulate

AXIS, RATE_HZ, SEED = 3, 2048.0, 1
RIGID = ("inertia", "gravity", "coulomb", "viscous")


@cache
def recording(cycles=5, rate_hz=RATE_HZ):
    config = load_testbed(Path(__file__).parents[2] / "configs" / "testbed.yaml")
    program = replace(
        config.program, axes=(AXIS,), cycles=cycles, dwell_jitter_s=0.0, speed_percent=30.0
    )
    made = simulate(config.robot, program, seed=SEED, sampling_rate_hz=rate_hz, axes=[AXIS]).axes[
        AXIS
    ]
    joint = config.robot.joints[AXIS - 1]
    known = Joint(joint.gear.ratio, joint.motor.pole_pairs)
    return known, Recording(
        "session",
        rate_hz,
        current_a=made.reported_a.astype(float),
        position_rad=made.position_rad,
        temperature_c=made.temperature_c.astype(float),
    )


def close(names, **options):
    known, session = recording(**options)
    library = built_in_library()
    declared = tuple((library[name], None) for name in names)
    return close_loop(Ways([session], known, lambda _: declared).best_fit(), library, SEED)


@pytest.mark.long
def test_vibration_that_the_model_does_not_hold_is_not_called_a_delay():
    loop = close(RIGID, cycles=2, rate_hz=512.0)
    assert "time_delay" not in {step.term.effect.name for step in loop.steps}
    assert loop.rmse_after_a < 0.3 * loop.rmse_before_a


@pytest.mark.long
def test_a_declared_effect_takes_the_best_of_its_forms():
    known, session = recording()
    library = built_in_library()
    declared = tuple((library[name], None) for name in (*RIGID, "load_friction"))
    fitted = Ways([session], known, lambda _: declared).best_fit()
    # Half of the inertia is the rotor's, whose torque does not pass the gear.
    assert fitted.terms[-1].parameters["inertia_share"] == pytest.approx(0.5)
