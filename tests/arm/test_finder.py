"""Where the joints are: a small arm with a fault in one joint and an encoder's zero off."""

import arms
import numpy as np

from opamc_cli.arm.finder import Finder, chain_of
from opamc_cli.arm.torques import torques


def test_an_arm_is_found_from_all_currents():
    motion, torque, current = arms.small_arm()
    finder = Finder(motion, current)
    letters, ways = finder.found()
    found = torques(chain_of(letters, ways), motion)
    for joint, columns in enumerate(found):
        beside = np.hstack([columns, motion[2, joint][:, None]])  # Its rotor is beside.
        left = torque[joint] - beside @ np.linalg.lstsq(beside, torque[joint], rcond=1e-10)[0]
        assert np.std(left) < 0.02 * np.std(torque[joint])
    left = np.sqrt(finder.left(letters, ways))
    assert np.argmax(left) == 1  # The fault is no link's.
    assert np.delete(left, 1).max() < 0.05


def test_an_arm_on_a_slope_is_found_with_its_up():
    up = np.array([np.sin(0.4), 0.0, np.cos(0.4)])
    arm = arms.chain(up=tuple(up))
    rng = np.random.default_rng(1)
    motion = np.array(arms.waves(6, 100.0, rng)[1:])
    torque = arms.asked(arm, motion, arms.bodies(1))
    current = torque / torque.std(axis=1)[:, None]
    current += 0.1 * np.sign(motion[1]) + 0.01 * rng.normal(size=current.shape)
    finder = Finder(motion, current)
    letters, ways = finder.found()
    assert np.sqrt(finder.left(letters, ways)).max() < 0.02
    found = np.array(chain_of(letters, ways).up)
    # A letter's base is this one's, or turned by quarters, or mirrored.
    assert np.isclose(found[2] / np.linalg.norm(found), up[2], atol=0.01)


def test_joints_that_ask_nothing_of_each_other_leave_as_much_without_an_arm():
    rng = np.random.default_rng(4)
    motion = np.array(arms.waves(4, 100.0, rng)[1:])
    current = np.cos(motion[0]) + 0.3 * np.sign(motion[1]) + 0.05 * rng.normal(size=(4, 4000))
    finder = Finder(motion, current)
    left = finder.left(*finder.found())
    assert np.median(np.sqrt(finder.alone.min(axis=1) / left)) < 2
