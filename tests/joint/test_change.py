"""What changed between a baseline and a target, on the tests' own simulator."""

from dataclasses import replace

import numpy as np
import pytest
from simulator import simulate

from opamc_cli.joint.change import explain_change
from opamc_cli.joint.kinematics import Recording
from opamc_cli.joint.track import Joint


def change_of(kind, seed=1, colder=0.0):
    made = simulate(seed, (), 0.0, cycles=8, rate=250.0)
    half = made.current.size // 2
    q, v, a, noise = made.position, made.velocity, made.acceleration, made.noise_rms
    tooth = 2 * (made.gear_ratio + 1)
    shapes = {
        "nothing": np.zeros_like(v),
        "tooth": 1.5 * np.cos(tooth * q),
        "payload": 1.5 * (np.sin(q + 0.3) / np.std(np.sin(q + 0.3)) + 0.3 * a / a.std()),
        "friction": 1.5 * v / v.std(),
    }
    current = made.current.copy()
    current[half:] += noise * shapes[kind][half:]
    made = replace(made, current=current)

    def recording(name, rows, warmer=0.0):
        return Recording(
            name,
            made.rate_hz,
            current_a=made.current[rows],
            position_rad=made.position[rows],
            temperature_c=made.temperature[rows] + warmer,
        )

    return explain_change(
        [recording("before", slice(0, half))],
        [recording("after", slice(half, None), -colder)],
        Joint(made.gear_ratio, made.pole_pairs),
    )


def test_nothing_changed():
    change = change_of("nothing")
    assert change.causes == ()
    assert not change.benign


def test_tooth_damage_is_a_ripple_and_a_fault():
    change = change_of("tooth")
    assert change.causes[0].effect == "ripple"
    assert change.causes[0].share > 0.7
    assert "inspect the flexspline" in change.causes[0].interpretation
    assert not change.benign


@pytest.mark.parametrize(
    ("kind", "colder", "effect"),
    [("payload", 0.0, "payload_change"), ("friction", 15.0, "thermal_viscous")],
)
def test_payload_and_cold_grease_are_no_faults(kind, colder, effect):
    change = change_of(kind, colder=colder)
    assert change.causes[0].effect == effect
    assert change.benign


def test_more_friction_at_the_same_temperature_is_not_benign():
    change = change_of("friction")
    assert "viscous" in {change.causes[0].effect, *change.causes[0].ties}
    assert not change.benign
