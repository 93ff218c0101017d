"""An arm, its links, its motions and its runs, and what its joints bear by another way."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from opamc_cli.arm.torques import JointPlace, KinematicChain, torques, turned

UR10 = (
    ((0.0, 0.0, 0.1273), (0.0, 0.0, 0.0), (0, 0, 1)),
    ((0.0, 0.220941, 0.0), (0.0, np.pi / 2, 0.0), (0, 1, 0)),
    ((0.0, -0.1719, 0.612), (0.0, 0.0, 0.0), (0, 1, 0)),
    ((0.0, 0.0, 0.5723), (0.0, np.pi / 2, 0.0), (0, 1, 0)),
    ((0.0, 0.1149, 0.0), (0.0, 0.0, 0.0), (0, 0, 1)),
    ((0.0, 0.0, 0.1157), (0.0, 0.0, 0.0), (0, 1, 0)),
)


def chain(places=UR10, up=(0.0, 0.0, 1.0)):
    return KinematicChain(tuple(JointPlace(*place) for place in places), up)


def bodies(seed, count=6):
    """Mass, centre and inertia about it of solid links: a sum of point masses each."""
    rng = np.random.default_rng(seed)
    found = []
    for mass in (7.8, 12.9, 3.9, 2.0, 2.0, 1.5)[:count]:
        points = rng.normal(0, 0.15, (8, 3))
        centre, share = points.mean(axis=0), mass / 8
        off = points - centre
        found.append((mass, centre, share * sum(p @ p * np.eye(3) - np.outer(p, p) for p in off)))
    return found


def parameters(links):
    """The same as the regressors take them, (links, 10)."""
    found = []
    for mass, c, inertia in links:
        about = inertia + mass * (c @ c * np.eye(3) - np.outer(c, c))
        found.append([mass, *(mass * c), *about[np.triu_indices(3)]])
    return np.array(found)


def asked(arm, motion, links):
    """Torques of all joints by the regressors; (joints, n)."""
    own = parameters(links)
    columns = torques(arm, motion)
    return np.array([one @ own[joint:].ravel() for joint, one in enumerate(columns)])


def newton_euler(arm, links, q, v, a):
    """Torques of all joints at one sample: forces and moments in the base's directions.

    Outwards speeds and accelerations of each centre of mass, inwards what they need (Luh, Walker,
    Paul, 1980).
    """
    turn, spin, spin_up = np.eye(3), np.zeros(3), np.zeros(3)
    lift, kept = 9.81 * np.array(arm.up), []
    for joint, (mass, c, inertia), angle, speed, faster in zip(
        arm.joints, links, q, v, a, strict=True
    ):
        way = turn @ joint.xyz
        lift = lift + np.cross(spin_up, way) + np.cross(spin, np.cross(spin, way))
        k = np.cross(np.eye(3), np.array(joint.axis, float))
        turn = turn @ turned(joint.rpy)
        line = turn @ joint.axis
        turn = turn @ (np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)
        spin_up = spin_up + line * faster + np.cross(spin, line) * speed
        spin = spin + line * speed
        centre, turning = turn @ c, turn @ inertia @ turn.T
        force = mass * (lift + np.cross(spin_up, centre) + np.cross(spin, np.cross(spin, centre)))
        moment = turning @ spin_up + np.cross(spin, turning @ spin)
        kept.append((way, line, centre, force, moment))
    pull, twist, found, next_way = np.zeros(3), np.zeros(3), [], np.zeros(3)
    for way, line, centre, force, moment in reversed(kept):
        twist = twist + np.cross(next_way, pull) + moment + np.cross(centre, force)
        pull, next_way = pull + force, way
        found.append(line @ twist)
    return found[::-1]


def waves(joints, rate, rng):
    """Time, and angles, speeds and accelerations of 40 s of random motions, (joints, n)."""
    t, many = np.arange(int(40 * rate)) / rate, (joints, 5, 1)
    speed, phase = rng.uniform(0.2, 3.0, many), rng.uniform(0, 6, many)
    size, angle = rng.uniform(0.1, 0.4, many), speed * t + phase
    q = (size * np.sin(angle)).sum(1)
    v = (size * speed * np.cos(angle)).sum(1)
    return t, q, v, -(size * speed**2 * np.sin(angle)).sum(1)


def saved(path, rate, columns):
    """Write a run."""
    record = json.dumps({"sampling_rate_hz": rate}).encode()
    table = pa.table(columns).replace_schema_metadata({b"opamc": record})
    pq.write_table(table, path)
    return str(path)


SMALL = chain(
    # An elbow beyond a shoulder's offset, and a wrist that turns the other way about the forearm.
    (
        ((0.0, 0.0, 0.3), (0.0, 0.0, 0.0), (0, 0, 1)),
        ((0.15, 0.0, 0.2), (0.0, 0.0, 0.0), (0, 1, 0)),
        ((0.0, 0.0, 0.6), (0.0, 0.0, 0.0), (0, 1, 0)),
        ((0.35, 0.0, 0.1), (0.0, 0.0, 0.0), (-1, 0, 0)),
    )
)


def small_arm(rate=100.0):
    """Angles, speeds and accelerations of an arm of four axes, what they ask, and its currents."""
    rng = np.random.default_rng(5)
    _, q, v, a = waves(4, rate, rng)
    motion = np.array([q, v, a])
    torque = asked(SMALL, motion, bodies(6, 4))
    current = torque + 0.5 * a + np.sign(v) + 0.5 * v
    current[1] += 3 * np.sin(20 * q[1])  # A fault in one of them.
    current += 0.02 * rng.normal(size=current.shape)
    motion[0, 2] += 0.06  # An encoder whose zero is off.
    return motion, torque, current


def small_run(folder, payload_kg=0.0):
    """Write a run of it, which carries something from half of its time on."""
    motion, _, current = small_arm()
    held = np.array([1.0, 0.3, 0.1, 0.1, *(0.1, 0.0, 0.0, 0.1, 0.0, 0.1)]) * payload_kg
    late = np.arange(current.shape[1]) > current.shape[1] // 2
    current += late * [one[:, -10:] @ held for one in torques(SMALL, motion)]
    columns = {f"axis{k + 1}_position": motion[0, k] for k in range(4)}
    columns |= {f"axis{k + 1}_current": current[k] for k in range(4)}
    return saved(folder / "run.parquet", 100.0, columns)
