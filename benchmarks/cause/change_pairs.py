"""Pairs of baseline and target recordings of one joint, whose change is known.

Half of them come from the virtual testbed (phases with or without position beside them), half
from the tests' own simulator, which shares no code with the package.
"""

import sys
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "sources"))
from simulator import simulate as simulate_joint

from opamc_cli.config.testbed import load_testbed
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Joint
from opamc_cli.testbed.parameters import Effect
from opamc_cli.testbed.robot import simulate as simulate_robot

ROOT = Path(__file__).resolve().parents[2]
RATE_HZ = 2048.0
SPEEDS_PERCENT = (100.0, 50.0, 20.0)
BASELINE_SESSIONS, TARGET_SESSIONS = 6, 2
SCALE = 1.12
OTHER_ORDER = 3.3
"""A ripple order that no part of a strain wave gear has."""


@dataclass(frozen=True)
class Pair:
    """Recordings before and after a known change.

    Attributes
    ----------
    name : str
        What changed.
    baseline, target : list of Recording
        One joint.
    joint : Joint
        Constants given to the method.
    """

    name: str
    baseline: list[Recording]
    target: list[Recording]
    joint: Joint


ROBOT_CHANGES = (
    "nothing", "flexspline 0.5", "flexspline 1", "colder", "payload", "coulomb", "ripple",
    "offset", "scale",
)  # fmt: skip
"""What happens to the virtual robot's joint between baseline and target."""


def robot_pair(change: str, seed: int) -> Pair:
    """Record one joint of the virtual robot in several sessions before and after a change.

    Parameters
    ----------
    change : str
        One of `ROBOT_CHANGES`.
    seed : int
        Of the robot; axis and speed follow from it.

    Returns
    -------
    Pair
        With phases, position and temperature.
    """
    config = load_testbed(ROOT / "configs" / "testbed.yaml")
    robot = config.robot
    # a payload matters where it hangs: shoulder, elbow, wrist
    axes = (2, 3, 5) if change == "payload" else (1, 2, 3, 4, 5, 6)
    axis = axes[seed % len(axes)]
    speed = SPEEDS_PERCENT[seed // 6 % len(SPEEDS_PERCENT)]
    program = replace(config.program, axes=(axis,), cycles=3, speed_percent=speed)
    joint = robot.joints[axis - 1]
    constant = joint.motor.torque_constant_nm_per_a
    faults, effects, changed = {}, [], program
    if change.startswith("flexspline"):
        faults = {axis: replace(robot.damage, severity=float(change.split()[1]))}
    elif change == "colder":
        colder = replace(joint.thermal, ambient_c=joint.thermal.ambient_c - 15.0)
        new = replace(joint, thermal=colder)
        robot_after = replace(
            robot, joints=tuple(new if k == axis - 1 else j for k, j in enumerate(robot.joints))
        )
    elif change == "payload":
        changed = replace(program, payload_kg=program.payload_kg + 1.0)
    elif change == "coulomb":
        effects = [_effect(axis, "coulomb", 0.3 * joint.friction.coulomb_nm / constant)]
    elif change == "ripple":
        size = 0.5 * joint.friction.coulomb_nm / constant
        effects = [_effect(axis, "ripple", size, order=OTHER_ORDER)]
    elif change == "offset":
        effects = [_effect(axis, "offset", joint.friction.coulomb_nm / constant)]
    if change != "colder":
        robot_after = robot

    def record(after: bool, session: int) -> Recording:
        made = simulate_robot(
            robot_after if after else robot,
            changed if after else program,
            seed=seed,
            session=session,
            sampling_rate_hz=RATE_HZ,
            axes=[axis],
            faults=faults if after else {},
            effects=effects if after else [],
        ).axes[axis]
        return Recording(
            name=f"session-{session:03d}",
            rate_hz=RATE_HZ,
            phases_a=made.phases_a.astype(np.float64)
            * (SCALE if change == "scale" and after else 1),
            position_rad=made.position_rad,
            temperature_c=made.temperature_c.astype(np.float64),
        )

    sessions = range(BASELINE_SESSIONS + TARGET_SESSIONS)
    recordings = [record(k >= BASELINE_SESSIONS, k) for k in sessions]
    return Pair(
        change,
        recordings[:BASELINE_SESSIONS],
        recordings[BASELINE_SESSIONS:],
        Joint(joint.gear.ratio, joint.motor.pole_pairs),
    )


def _effect(axis: int, name: str, magnitude: float, **parameters: float) -> Effect:
    return Effect(axis=axis, name=name, magnitude=magnitude, parameters=parameters)


JOINT_CHANGES = (
    "nothing", "tooth", "ripple", "colder", "payload", "coulomb", "viscous", "offset",
    "position drag", "scale",
)  # fmt: skip
"""What happens to the tests' own joint between baseline and target."""

JOINT_RATE_HZ = 1000.0
CYCLES_PER_SESSION = 2


def joint_pair(change: str, seed: int, position: bool) -> Pair:
    """Cut a simulated joint's motion into sessions that differ, the last of them changed.

    Friction differs by 5 % from session to session, the current's gain by 1 %, the ripple's phase
    and the phases' zero are each session's own.

    Parameters
    ----------
    change : str
        One of `JOINT_CHANGES`.
    seed : int
        Of trajectory, joint and noise.
    position : bool
        Whether position and temperature are logged with a signed current; three phases if not.
    """
    count = BASELINE_SESSIONS + TARGET_SESSIONS
    made = simulate_joint(seed, (), 0.0, rate=JOINT_RATE_HZ, cycles=CYCLES_PER_SESSION * count)
    rng = np.random.default_rng([seed, 1])
    q, v, noise = made.position, made.velocity, made.noise_rms
    ratio, poles = made.gear_ratio, made.pole_pairs
    if not position:
        # the phases' carrier has to stay well below half the rate
        poles, ratio = 4, 50.0
    fitted, *_ = np.linalg.lstsq(made.columns, made.current, rcond=None)
    inertia, sine, cosine, dry, wet = (made.columns * fitted).T
    span = float(np.ptp(q))
    place = rng.uniform(q.min() + 0.25 * span, q.max() - 0.25 * span)
    edges = np.linspace(0, v.size, count + 1).astype(int)
    sides: tuple[list[Recording], list[Recording]] = ([], [])
    for k, (start, stop) in enumerate(pairwise(edges)):
        rows = slice(start, stop)
        new = k >= BASELINE_SESSIONS
        phase = rng.uniform(0, 2 * np.pi)
        order = {"tooth": 2 * (ratio + 1) / ratio, "ripple": OTHER_ORDER}.get(change, 0.0)
        swell = 1.0 + 0.4 * np.sign(v[rows])  # a damaged mesh is felt one way more than the other
        shape = {
            "nothing": 0.0,
            "scale": (SCALE - 1) * made.current[rows],
            "tooth": 1.5 * noise * swell * np.cos(order * ratio * q[rows] + phase),
            "ripple": 1.5 * noise * np.cos(order * ratio * q[rows] + phase),
            "colder": 0.35 * wet[rows],
            "payload": 0.3 * (inertia + sine + cosine)[rows],
            "coulomb": 0.3 * dry[rows],
            "viscous": 0.35 * wet[rows],
            "offset": 0.5 * float(np.abs(dry).mean()),
            "position drag": 0.7
            * dry[rows]
            * np.exp(-0.5 * ((q[rows] - place) / (0.08 * span)) ** 2),
        }[change]
        current = made.current[rows] + new * shape
        current = current + 0.05 * (rng.normal() * dry[rows] + rng.normal() * wet[rows])
        current *= 1.0 + 0.01 * rng.normal()
        field = poles * ratio * q[rows] + rng.uniform(0, 2 * np.pi)
        phases = np.stack([current * np.cos(field - j * 2 * np.pi / 3) for j in range(3)], axis=1)
        phases += 0.3 * noise * rng.normal(size=phases.shape)
        degrees = made.temperature[rows] - made.temperature.mean() + 25.0 + 2.0 * rng.normal()
        sides[int(new)].append(
            Recording(
                name=f"session-{k}",
                rate_hz=made.rate_hz,
                current_a=current if position else None,
                phases_a=None if position else phases,
                position_rad=q[rows] if position else None,
                temperature_c=degrees - 15.0 * new * (change == "colder") if position else None,
            )
        )
    return Pair(change, *sides, Joint(ratio, poles))
