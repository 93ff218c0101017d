"""Where the joints are: a small arm with a fault in one joint and an encoder's zero off."""

import arms
import numpy as np

from opamc_cli.robot.arm.finder import Finder, chain_of
from opamc_cli.robot.arm.torques import torques


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
