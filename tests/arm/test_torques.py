"""The torques of an arm's joints: published formulas, energies, and another way to the same."""

import arms
import numpy as np
import pytest

from opamc_cli.arm.torques import torques


def test_two_links_on_parallel_axes_are_the_planar_elbow():
    # Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, 2006, section 7.3; y is up.
    places = [((x, 0.0, 0.0), (0.0, 0.0, 0.0), (0, 0, 1)) for x in (0.0, 0.7)]
    arm = arms.chain(places, up=(0.0, 1.0, 0.0))
    motion = np.random.default_rng(0).uniform(-2, 2, (3, 2, 50))
    (q1, q2), (v1, v2), (a1, a2) = motion
    m1, m2, c1, c2, i1, i2, l1, g = 3.0, 2.0, 0.3, 0.4, 0.2, 0.1, 0.7, 9.81
    b, s = m2 * l1 * c2 * np.cos(q2), m2 * l1 * c2 * np.sin(q2)
    far = m2 * c2**2 + i2
    upper = (m1 * c1**2 + i1 + m2 * l1**2 + far + 2 * b) * a1 + (far + b) * a2
    upper += -s * v2**2 - 2 * s * v1 * v2 + (m1 * c1 + m2 * l1) * g * np.cos(q1)
    upper += m2 * c2 * g * np.cos(q1 + q2)
    lower = (far + b) * a1 + far * a2 + s * v1**2 + m2 * c2 * g * np.cos(q1 + q2)
    first = np.array([m1, m1 * c1, 0, 0, 0, 0, 0, 0, 0, m1 * c1**2 + i1])
    second = np.array([m2, m2 * c2, 0, 0, 0, 0, 0, 0, 0, far])
    found = torques(arm, motion)
    assert np.allclose(found[0] @ np.r_[first, second], upper)
    assert np.allclose(found[1] @ second, lower)


@pytest.mark.parametrize("seed", range(4))
def test_newton_and_euler_find_the_same(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 8))
    places = zip(*rng.uniform(-1, 1, (3, count, 3)).tolist(), strict=True)
    axes = [(xyz, rpy, np.divide(axis, np.linalg.norm(axis))) for xyz, rpy, axis in places]
    arm = arms.chain(axes, up=(0.6, 0.0, 0.8))
    links = [*arms.bodies(seed), *arms.bodies(seed + 9)][:count]
    motion = rng.uniform(-3, 3, (3, count, 5))
    slow = np.array([arms.newton_euler(arm, links, *one) for one in np.moveaxis(motion, 2, 0)])
    assert np.allclose(arms.asked(arm, motion, links), slow.T, rtol=1e-9, atol=1e-9)
    last = torques(arm, motion, first=count - 1)
    assert len(last) == 1
    assert np.array_equal(last[0], torques(arm, motion)[-1])


def test_an_arm_keeps_its_energy_and_its_weight_has_a_potential():
    arm, links, rng = arms.chain(), arms.bodies(1), np.random.default_rng(2)
    q, v = rng.uniform(-2, 2, (2, 6))
    still, unit, step = np.zeros(6), np.eye(6), 1e-5

    def torque(q, v, a):
        return arms.asked(arm, np.array([q, v, a])[:, :, None], links)[:, 0]

    def inertia(q):
        return np.array([torque(q, still, one) - torque(q, still, still) for one in unit])

    def weight(q):
        return torque(q, still, still)

    assert np.allclose(inertia(q), inertia(q).T)
    assert np.linalg.eigvalsh(inertia(q)).min() > 0
    slopes = np.array([(weight(q + step * e) - weight(q - step * e)) / (2 * step) for e in unit])
    assert np.allclose(slopes, slopes.T, atol=1e-6)
    assert np.abs(slopes).max() > 1
    # What speeds alone ask changes the kinetic energy by as much as the pose changes the inertia.
    turning = torque(q, v, still) - weight(q)
    changing = (inertia(q + step * v) - inertia(q - step * v)) / (2 * step)
    assert np.isclose(v @ turning, 0.5 * v @ changing @ v, rtol=1e-6)
