"""Torques of an arm's joints by the inertial parameters of its links."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]
GRAVITY_M_S2 = 9.81
PARAMETERS = 10
"""Of a link."""
_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


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
    spin, spin_up = np.zeros((3, n)), np.zeros((3, n))
    up = np.array(chain.up) / np.linalg.norm(chain.up)
    lift = np.broadcast_to(GRAVITY_M_S2 * up[:, None], (3, n))
    lines: list[tuple[Floats, Floats]] = []
    """Of each joint wanted: its axis, and the axis' cross product with the way from it."""
    found: list[list[Floats]] = []
    for link, joint in enumerate(chain.joints):
        angle, speed, acceleration = motion[:, link]
        way, about = np.array(joint.xyz), np.array(joint.axis) / np.linalg.norm(joint.axis)
        lift = lift + _cross(spin_up, way) + _cross(spin, _cross(spin, way))
        lines = [(line, lever + _cross(line, way)) for line, lever in lines]
        back = turned(joint.rpy).T
        carried = [back @ one for one in (spin, spin_up, lift, *(v for ab in lines for v in ab))]
        spin, spin_up, lift, *rest = _turned_back(about, angle, np.stack(carried, axis=1))
        lines = list(zip(rest[::2], rest[1::2], strict=True))
        spin_up = spin_up + about[:, None] * acceleration + _cross(spin, about) * speed
        spin = spin + about[:, None] * speed
        if link >= first:
            lines.append((np.broadcast_to(about[:, None], (3, n)), np.zeros((3, n))))
            found.append([])
        force, moment = _asked(lift, spin, spin_up)
        for (line, lever), blocks in zip(lines, found, strict=True):
            both = (line[:, None] * moment).sum(axis=0)
            both[:4] += (lever[:, None] * force).sum(axis=0)
            blocks.append(both)
    return [np.concatenate(blocks).T for blocks in found]


def _asked(lift: Floats, spin: Floats, spin_up: Floats) -> tuple[Floats, Floats]:
    """Force by mass and first moments, (3, 4, n), and moment by all parameters, (3, 10, n)."""
    n = spin.shape[1]
    force, moment = np.zeros((3, 4, n)), np.zeros((3, PARAMETERS, n))
    force[:, 0] = lift
    for k, side in enumerate(np.eye(3)):
        force[:, k + 1] = _cross(spin_up, side) + _cross(spin, _cross(spin, side))
        moment[:, k + 1] = -_cross(lift, side)
    for place, (one, two) in enumerate(_PAIRS, start=4):
        turning, rate = np.zeros((3, n)), np.zeros((3, n))
        turning[one], rate[one] = spin[two], spin_up[two]
        turning[two], rate[two] = spin[one], spin_up[one]
        moment[:, place] = rate + _cross(spin, turning)
    return force, moment


def _turned_back(about: Floats, angle: Floats, vectors: Floats) -> Floats:
    """Vectors, (3, k, n), as a frame sees them that has turned, (k, 3, n): Rodrigues' formula."""
    sin, cos = np.sin(angle), np.cos(angle)
    across = _cross(vectors, about)
    along = np.tensordot(about, vectors, axes=1)
    turned = cos * vectors + sin * across + about[:, None, None] * ((1 - cos) * along)
    return turned.swapaxes(0, 1)


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product over the first axis: numpy's own takes thrice as long."""
    (u, v, w), (x, y, z) = a, b
    return np.stack([v * z - w * y, w * x - u * z, u * y - v * x])


def turned(rpy: Vector) -> Floats:
    """Turn about x, then y, then z of a fixed frame, (3, 3)."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(rpy), np.sin(rpy)
    x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(z @ y @ x)
