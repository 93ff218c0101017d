"""Record the joint of configs/closing.yaml with effects switched on, and close the loop on it."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from opamc_cli.config.testbed import load_testbed
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.explain.declared import Ways
from opamc_cli.joint.fit.model import Fit
from opamc_cli.joint.loop import Loop, close_loop
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Joint
from opamc_cli.testbed.parameters import Effect
from opamc_cli.testbed.robot import AxisRecording, simulate

CONFIG = load_testbed(Path(__file__).parents[2] / "configs" / "closing.yaml")
RATE_HZ = CONFIG.recording.sampling_rate_hz
DECLARED = ("inertia", "gravity", "coulomb", "viscous")
KNOWN = Joint(CONFIG.robot.joints[0].gear.ratio, CONFIG.robot.joints[0].motor.pole_pairs)

SENSING = ("position and current", "position and phases", "phases")
"""What is logged: of position and current only what is named, and the temperature."""

EFFECTS = {
    "inertia": Effect("inertia", 1, 0.03),
    "gravity": Effect("gravity", 1, 0.5, {"angle_rad": 0.4}),
    "offset": Effect("offset", 1, 0.1),
    "coulomb": Effect("coulomb", 1, 0.1),
    "viscous": Effect("viscous", 1, 0.1),
    "stribeck": Effect("stribeck", 1, 0.15, {"velocity_rad_s": 0.3}),
    "quadratic_friction": Effect("quadratic_friction", 1, 0.3),
    "sublinear_friction": Effect("sublinear_friction", 1, 1.0, {"exponent": 0.5}),
    "asymmetric_friction": Effect("asymmetric_friction", 1, 0.1),
    "load_friction": Effect("load_friction", 1, 0.008),
    "thermal_viscous": Effect("thermal_viscous", 1, -0.01),
    "warmup": Effect("warmup", 1, 0.15, {"time_constant_s": 12.0}),
    "spring": Effect("spring", 1, 0.6, {"angle_rad": 0.3}),
    "payload_change": Effect("payload_change", 1, 0.15, {"start_s": 15.0}),
    "position_drag": Effect("position_drag", 1, 0.15, {"angle_rad": 0.4, "width_rad": 0.1}),
    "hysteresis": Effect("hysteresis", 1, 0.15, {"width_rad": 0.1}),
    "elasticity": Effect("elasticity", 1, 0.99),
    "ripple": Effect("ripple", 1, 0.04, {"order": 2.0}),
    "time_delay": Effect("time_delay", 1, 0.012),
    "sensor_offset": Effect("sensor_offset", 1, 0.1, {"phase": 1.0}),
    "sensor_gain": Effect("sensor_gain", 1, 0.06, {"phase": 2.0}),
    "dead_time": Effect("dead_time", 1, 0.4),
    "mains_hum": Effect("mains_hum", 1, 0.05),
}
"""Every effect of the vocabulary, about as large as what the declared model leaves without it."""


@cache
def record(names: tuple[str, ...], seed: int) -> AxisRecording:
    """One session of the joint with the named effects switched on."""
    effects = [EFFECTS[name] for name in names]
    program = replace(CONFIG.program, axes=(1,))
    recording = simulate(
        CONFIG.robot, program, seed=seed, sampling_rate_hz=RATE_HZ, axes=[1], effects=effects
    )
    return recording.axes[1]


def declared_on_testbed(
    sensing: str, seed: int, joint: Joint = KNOWN, names: tuple[str, ...] = ()
) -> Fit:
    """Fit the declared model, without the named effects, to a session that has them."""
    axis = record(names, seed)
    phases = sensing != "position and current"
    recording = Recording(
        "session",
        RATE_HZ,
        current_a=None if phases else axis.reported_a.astype(float),
        phases_a=axis.phases_a.astype(float) if phases else None,
        position_rad=None if sensing == "phases" else axis.position_rad,
        temperature_c=axis.temperature_c.astype(float),
    )
    library = built_in_library()
    terms = tuple((library[name], None) for name in DECLARED if name not in names)
    fitted = Ways([recording], joint, lambda dataset: terms).best_fit()
    assert fitted is not None
    return fitted


def close_on_testbed(
    names: tuple[str, ...], sensing: str, seed: int, without: tuple[str, ...] = ()
) -> Loop:
    """Close the loop on a session, with what `sensing` logs; what is missing is not declared."""
    fitted = declared_on_testbed(sensing, seed, names=names)
    return close_loop(fitted, built_in_library(without), seed)


def error_on(healthy: Fit, loop: Loop) -> float:
    """Error of a healthy session on the samples that judged another's loop.

    Which samples corners of the motion spoil, and which stand for all, depends on the noise of the
    current.
    """
    dataset, healthy = loop.after.opened.dataset, healthy.opened
    judged = dataset.fine.track.time_s[dataset.sharp.sealed]
    there = np.isin(np.rint(RATE_HZ * healthy.dataset.fine.track.time_s), np.rint(RATE_HZ * judged))
    return float(np.sqrt(np.mean(healthy.residual_a[there] ** 2)))


def names_of(loop: Loop) -> list[set[str]]:
    """Each step's effect with those that it ties with."""
    return [{step.term.effect.name, *step.ties} for step in loop.steps]
