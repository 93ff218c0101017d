"""Torques of an arm's joints by the inertial parameters of its links."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]
GRAVITY_M_S2 = 9.81
PARAMETERS = 10
"""Of a link."""


@dataclass(frozen=True)
class JointPlace:
    """Where a joint is in the link before it, as in a robot's URDF.

    An axis that counts the other way has its `axis` negated, one whose zero is elsewhere is turned
    by its `rpy`.
    """

    xyz: Vector
    """Origin, in m."""
    rpy: Vector
    """Turns about x, then y, then z of the frame before, in rad."""
    axis: Vector
    """Of any length but 0, in the joint's own frame."""


@dataclass(frozen=True)
class KinematicChain:
    """An arm's joints from the base outwards; tool and payload belong to the last link."""

    joints: tuple[JointPlace, ...]
    up: Vector = (0.0, 0.0, 1.0)
    """Upwards in the base's frame: of an arm that hangs from the ceiling (0, 0, -1)."""


def torques(chain: KinematicChain, motion: Floats, first: int = 0) -> list[Floats]:
    """Regressors of the torque about each joint, from `first` on.

    They are linear in mass, first moments and inertias (Atkeson, An, Hollerbach, Estimation of
    inertial parameters of manipulator loads and links, 1986): speeds and accelerations go outwards
    from link to link, each in its own frame, and what a link asks is laid on each joint before it.

    Parameters
    ----------
    chain
        Where the joints are.
    motion
        Angles (rad), speeds and accelerations of all joints, (3, joints, n).
    first
        Joint from which on they are wanted, counted from 0.

    Returns
    -------
    list of ndarray
        Of each joint, (n, 10 * links): Nm by m, m x, m y, m z, Ixx, Ixy, Ixz, Iyy, Iyz, Izz of each
        link from the joint outwards, about the origin of its joint's frame.
    """
    n = motion.shape[2]
    up = np.array(chain.up) / np.linalg.norm(chain.up)
    spin, spin_up = np.zeros((3, n)), np.zeros((3, n))
    lift = np.broadcast_to(GRAVITY_M_S2 * up[:, None], (3, n))
    # Of each joint wanted: its axis, and the cross product of that with the way from it.
    lines = levers = np.zeros((3, 0, n))
    found: list[list[Floats]] = []
    for link, joint in enumerate(chain.joints):
        angle, speed, acceleration = motion[:, link]
        way, about = np.array(joint.xyz), np.array(joint.axis) / np.linalg.norm(joint.axis)
        lift = lift + np.einsum("kjn,j->kn", _carrying(spin, spin_up), way)
        levers = levers + _cross(lines, way)
        carried = np.concatenate(
            [np.stack([spin, spin_up, lift], axis=1), lines, levers], axis=1
        ).reshape(3, -1)
        carried = (turned(joint.rpy).T @ carried).reshape(3, -1, n)
        carried = _turned_back(about, angle, carried)
        spin, spin_up, lift = carried[:, 0], carried[:, 1], carried[:, 2]
        lines, levers = np.split(carried[:, 3:], 2, axis=1)
        spin_up = spin_up + about[:, None] * acceleration + _cross(spin, about) * speed
        spin = spin + about[:, None] * speed
        if link >= first:
            own = np.broadcast_to(about[:, None, None], (3, 1, n))
            lines = np.concatenate([lines, own], axis=1)
            levers = np.concatenate([levers, 0 * own], axis=1)
            found.append([])
        force, moment = _asked(lift, spin, spin_up)
        both = sum(line[:, None] * one for line, one in zip(lines, moment, strict=True))
        for lever, one in zip(levers, force, strict=True):
            both[:, :4] += lever[:, None] * one
        for blocks, block in zip(found, both, strict=True):
            blocks.append(block)
    return [np.concatenate(blocks).T for blocks in found]


def _carrying(spin: Floats, spin_up: Floats) -> Floats:
    """By a way in a turning body: its point's acceleration less the origin's, (3, 3, n)."""
    (u, v, w), (x, y, z) = spin, spin_up
    uv, vw, wu = u * v, v * w, w * u
    uu, vv, ww = u * u, v * v, w * w
    return np.array(
        [
            [-vv - ww, uv - z, wu + y],
            [uv + z, -uu - ww, vw - x],
            [wu - y, vw + x, -uu - vv],
        ]
    )


def _asked(lift: Floats, spin: Floats, spin_up: Floats) -> tuple[Floats, Floats]:
    """Force by mass and first moments, (3, 4, n), and moment by all parameters, (3, 10, n)."""
    (u, v, w), (x, y, z), (f, g, h) = spin, spin_up, lift
    none = np.zeros_like(u)
    uv, vw, wu = u * v, v * w, w * u
    uu, vv, ww = u * u, v * v, w * w
    force = np.concatenate([lift[:, None], _carrying(spin, spin_up)], axis=1)
    # Euler's equations, of each inertia alone.
    moment = np.array(
        [
            [none, none, h, -g, x, y - wu, z + uv, -vw, vv - ww, vw],
            [none, -h, none, f, wu, x + vw, ww - uu, y, z - uv, -wu],
            [none, g, -f, none, -uv, uu - vv, x - vw, uv, y + wu, z],
        ]
    )
    return force, moment


def _turned_back(about: Floats, angle: Floats, vectors: Floats) -> Floats:
    """Vectors, (3, k, n), as a frame sees them that has turned: Rodrigues' formula."""
    along = np.tensordot(about, vectors, axes=1)
    ahead = about[:, None, None] * ((1 - np.cos(angle)) * along)
    return np.asarray(np.cos(angle) * vectors + np.sin(angle) * _cross(vectors, about) + ahead)


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product over the first axis: numpy's own takes thrice as long."""
    (u, v, w), (x, y, z) = a, b
    return np.array([v * z - w * y, w * x - u * z, u * y - v * x])


def turned(rpy: Vector) -> Floats:
    """Turn about x, then y, then z of a fixed frame, (3, 3)."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(rpy), np.sin(rpy)
    x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(z @ y @ x)
