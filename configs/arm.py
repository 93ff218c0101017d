"""What the links of an arm ask of one of its joints, from where its joints are.

For `opamc model` where all axes of an arm move at once. Write your robot's joints below, and in
`model.yaml`: `library: [arm.py]`, `effects: [arm, inertia, offset, coulomb, viscous]` and
`without: [coupling]`, which is what is searched where nobody tells the arm.
"""

import numpy as np

from opamc_cli.errors import ConfigError
from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.effects.payload_change import PayloadChange
from opamc_cli.joint.motion.track import Floats, Ints, Track

JOINTS = (
    ((0.0, 0.0, 0.1273), (0.0, 0.0, 0.0), (0, 0, 1)),
    ((0.0, 0.220941, 0.0), (0.0, np.pi / 2, 0.0), (0, 1, 0)),
    ((0.0, -0.1719, 0.612), (0.0, 0.0, 0.0), (0, 1, 0)),
    ((0.0, 0.0, 0.5723), (0.0, np.pi / 2, 0.0), (0, 1, 0)),
    ((0.0, 0.1149, 0.0), (0.0, 0.0, 0.0), (0, 0, 1)),
    ((0.0, 0.0, 0.1157), (0.0, 0.0, 0.0), (0, 1, 0)),
)
"""Axis 1, 2, ...: as in a robot's URDF, `xyz` in m and `rpy` in rad of the joint's `origin`, and
its `axis`. These are a UR10's. An axis that counts the other way has its `axis` negated, one whose
zero is elsewhere is turned by its `rpy`. Tool and payload belong to the last link."""

UP = (0.0, 0.0, 1.0)
"""Upwards in the base's frame: of an arm that hangs from the ceiling (0, 0, -1)."""

GRAVITY_M_S2 = 9.81
INDEPENDENT = 1e-9
"""Share of the strongest: weaker combinations of the links' parameters never reach the joint."""


class Arm(Effect):
    """Torque by the inertial parameters of every link from the joint outwards.

    It is linear in mass, first moments and inertias (Atkeson, An, Hollerbach, Estimation of
    inertial parameters of manipulator loads and links, 1986). Combinations that no motion tells
    apart are left out: the rest are the base parameters (Gautier, 1991), of which the singular
    values of a random motion's regressors tell.
    """

    name = "arm"
    domain = "acceleration"
    origin = "load"
    meaning = "what the arm's links ask: no fault"
    needs = ("position", "others")
    from_motion = True
    carries_load = True

    def columns_at(self, track: Track, parameters: Parameters, rows: Ints) -> Floats:
        """Regressors at some samples; ConfigError where not all axes are logged."""
        return _asked(track, rows, slice(None))


class Payload(PayloadChange):
    """Weight that the last link carries from some time on: its mass and first moments.

    The arm's own torques are known, so no place has to be passed twice to tell time from place.
    """

    needs = ("scale", "others")

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Return what a weight in the gripper asks of this joint while it is there."""
        held = np.hypot(*super().columns(track, parameters)[:, :2].T)
        return held[:, None] * _asked(track, np.arange(track.size), slice(-10, -6))


def _asked(track: Track, rows: Ints, some: slice) -> Floats:
    """Independent torques of the joint by some of the links' parameters, at some samples."""
    axes = range(1, len(JOINTS) + 1)
    own = [axis for axis in axes if axis not in track.other_axes]
    if track.others is None or len(own) != 1:
        msg = (
            f"effect 'arm' has {len(JOINTS)} joints, and the positions logged beside this one are "
            f"those of axes {', '.join(map(str, track.other_axes)) or 'none'}: log all"
        )
        raise ConfigError(msg)
    joint = own[0] - 1
    motion = np.empty((3, len(JOINTS), rows.size))
    motion[:, joint] = [
        part[rows] for part in (track.position_rad, track.velocity, track.acceleration)
    ]
    for place, axis in enumerate(track.other_axes):
        if axis in axes:
            motion[:, axis - 1] = track.others[rows, place :: len(track.other_axes)].T
    any_motion = np.random.default_rng(0).uniform(-3, 3, (3, len(JOINTS), 400))
    sample = torques(any_motion, joint)[:, some]
    size = np.linalg.norm(sample, axis=0)
    told = size > INDEPENDENT * size.max()
    _, strength, base = np.linalg.svd(sample[:, told] / size[told], full_matrices=False)
    base = base[strength > INDEPENDENT * strength[0]]
    # A closed model's coefficients are of these: the sign is not to depend on who computes them.
    largest = np.abs(base).argmax(axis=1)
    base *= np.sign(base[np.arange(len(base)), largest])[:, None] / size[told]
    return np.asarray(torques(motion, joint)[:, some][:, told] @ base.T)


def torques(motion: Floats, joint: int) -> Floats:
    """Torque about one joint, from 0, by each link's mass, first moments and inertias.

    Angles, speeds and accelerations of all joints have shape (3, joints, n), the torques
    (n, 10 * links): of each link from the joint outwards m, m x, m y, m z, Ixx, Ixy, Ixz, Iyy, Iyz,
    Izz about the origin of its joint's frame.
    """
    n = motion.shape[2]
    turn = np.broadcast_to(np.eye(3), (n, 3, 3))
    place, spin, spin_up = (np.zeros((n, 3)) for _ in range(3))
    lift = np.broadcast_to(GRAVITY_M_S2 * np.array(UP), (n, 3))
    found: list[Floats] = []
    for link, (xyz, rpy, axis) in enumerate(JOINTS):
        angle, speed, acceleration = motion[:, link, :, None]
        way = turn @ np.array(xyz)
        place = place + way
        lift = lift + _carried(spin, spin_up, way)
        turn = turn @ _turned(rpy)
        about = np.array(axis) / np.linalg.norm(axis)
        line = turn @ about
        spin_up = spin_up + line * acceleration + np.cross(spin, line) * speed
        spin = spin + line * speed
        # Rodrigues' formula.
        across = np.cross(np.eye(3), about)
        sin, cos = np.sin(angle)[..., None], np.cos(angle)[..., None]
        turn = turn @ (np.eye(3) + sin * across + (1 - cos) * (across @ across))
        if link == joint:
            own, origin = line, place
        if link >= joint:
            found.append(np.sum(own * np.cross(place - origin, lift), axis=1))
            for side in np.moveaxis(turn, 2, 0):
                moment = np.cross(side, lift)
                moment += np.cross(place - origin, _carried(spin, spin_up, side))
                found.append(np.sum(own * moment, axis=1))
            # What turns the link, in its own frame, where its inertia does not change.
            vectors = (own, spin_up, np.cross(own, spin), spin)
            a, b, c, d = (np.einsum("nkj,nk->nj", turn, vector) for vector in vectors)
            for one, two in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
                pair = a[:, one] * b[:, two] + c[:, one] * d[:, two]
                if one != two:
                    pair += a[:, two] * b[:, one] + c[:, two] * d[:, one]
                found.append(pair)
    return np.stack(found, axis=1)


def _carried(spin: Floats, spin_up: Floats, way: Floats) -> Floats:
    """Acceleration of a point that a turning body carries, less that of the body's origin."""
    return np.asarray(np.cross(spin_up, way) + np.cross(spin, np.cross(spin, way)))


def _turned(rpy: tuple[float, float, float]) -> Floats:
    """Turn about x, then y, then z of a fixed frame."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(rpy), np.sin(rpy)
    x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(z @ y @ x)
