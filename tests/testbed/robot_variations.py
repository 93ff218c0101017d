"""Variations of the robot for tests that look at one thing alone."""

from dataclasses import replace
from typing import Any

from opamc_cli.testbed.parameters import Joint, Robot


def with_joint(robot: Robot, axis: int, **parts: dict[str, Any]) -> Robot:
    """Change values of one joint: with_joint(robot, 3, gear={"ratio": 50.0})."""
    joint = robot.joints[axis - 1]
    changed: dict[str, Any] = {
        name: replace(getattr(joint, name), **values) for name, values in parts.items()
    }
    joints: tuple[Joint, ...] = (
        *robot.joints[: axis - 1],
        replace(joint, **changed),
        *robot.joints[axis:],
    )
    return replace(robot, joints=joints)


NO_ERROR = {
    "error_2_circular_rad": 0.0,
    "error_4_circular_rad": 0.0,
    "error_2_flexspline_rad": 0.0,
    "error_4_flexspline_rad": 0.0,
}
QUIET_GEAR = {**NO_ERROR, "tooth_mesh_torque_nm": 0.0, "hysteresis_torque_nm": 0.0}
QUIET_MOTOR = {"cogging_torque_nm": 0.0}
QUIET_FRICTION = {"fluctuation_nm": 0.0}
SMOOTH_ENCODER = {"encoder_counts_per_turn": 0.0}
