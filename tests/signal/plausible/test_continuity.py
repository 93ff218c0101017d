"""Samples that are missing between two, told by an angle's steps."""

import numpy as np
import pytest

from opamc_cli.signal.plausible.continuity import leaps

PLACE = np.arange(8000)
SWING = 1.2 * np.sin(2 * np.pi * PLACE / 2000)


@pytest.mark.parametrize("share", [0.003, 0.03])
def test_missing_samples_are_counted(share):
    kept = np.random.default_rng(0).random(PLACE.size) > share
    found = leaps(SWING[kept])
    assert found is not None
    assert found.wrap is None
    # Where the joint turns nothing tells.
    assert 0.6 < found.missing / np.count_nonzero(~kept) < 1.0


def test_a_whole_log_has_no_leaps():
    assert leaps(SWING) is None
    assert leaps(np.round(SWING / 1e-3) * 1e-3) is None  # A coarse encoder.
    assert leaps(SWING + np.random.default_rng(0).normal(0, 1e-3, PLACE.size)) is None
    assert leaps(np.zeros(PLACE.size)) is None
    assert leaps(SWING[:50]) is None
    gap = SWING.copy()
    gap[3000:3020] = np.nan
    assert leaps(gap) is None


def test_a_value_that_is_held_and_made_up_for_is_no_loss():
    late = SWING.copy()
    late[1::50] = late[:-1:50]
    assert leaps(late) is None


def test_a_stroke_shorter_than_the_median_lacks_no_sample():
    """Logged at 60 Hz, its steps of 3.5 to 6.8 mrad passed for twice a median of 3.5."""
    stroke = [-6.8, -4.3, -1.5, 0.6, 3.5, 5.0, 6.4, 6.8, 5.3, 3.0, 0.7, -0.6]
    steps = np.concatenate([np.diff(SWING[500:2501]), np.multiply(stroke, 1e-3)])
    assert leaps(np.cumsum(np.tile(steps, 4))) is None


@pytest.mark.parametrize("wrap", [1.0, 360.0, 4096.0])
def test_an_angle_that_wraps_leaps_back_by_one_size(wrap):
    turning = np.linspace(0, 5.5, PLACE.size) * wrap % wrap
    found = leaps(turning)
    assert found is not None
    assert found.wrap == pytest.approx(wrap, rel=0.01)
    assert found.places == 5


def test_a_whole_turns_jump_in_rad_is_none():
    assert leaps(np.angle(np.exp(1j * np.linspace(0, 40, PLACE.size)))) is None
