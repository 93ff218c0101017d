"""Corners of the acceleration that a coarse encoder's smoothing rounds off."""

import numpy as np
import pytest
from closing import close_on
from simulator import simulate

from opamc_cli.joint.corners import clear_of_corners
from opamc_cli.joint.kinematics import Recording
from opamc_cli.joint.model import open_session
from opamc_cli.joint.recordings import grouped_track
from opamc_cli.joint.track import Joint


def session_of(made, current):
    recording = Recording("run", made.rate_hz, current_a=current, position_rad=made.position)
    track, grouping = grouped_track([recording], Joint(made.gear_ratio, made.pole_pairs))
    return open_session(track, grouping)


def test_fast_effects_are_looked_for_where_the_smoothed_acceleration_is_the_true_one():
    made = simulate(28, kind="trapezoid", rate=500.0, quantum=5e-4)
    session = session_of(made, made.current)
    error = np.abs(session.fine.track.acceleration - made.acceleration)
    clear, spoilt = session.sharp.fit, session.fine.fit & ~session.sharp.fit
    assert 0.2 < clear.sum() / session.fine.fit.sum() < 0.9
    assert np.quantile(error[clear], 0.9) < 0.2 * np.quantile(error[spoilt], 0.9)


def test_nothing_is_left_out_where_the_encoder_is_fine():
    made = simulate(28, kind="trapezoid", rate=500.0)
    session = session_of(made, made.current)
    assert session.sharp is session.fine
    assert clear_of_corners(session.fine.track) is None


@pytest.mark.parametrize("kind", ["trapezoid", "quintic"])
def test_speed_and_current_are_equally_smooth_on_the_coarse_grid(kind):
    made = simulate(28, kind=kind, rate=500.0, quantum=5e-4)
    # A current that is the speed itself: what differs is the smoothing.
    session = session_of(made, made.velocity)
    track, rows = session.coarse.track, session.coarse.fit
    error = np.std((track.velocity - track.current_a)[rows])
    assert error < 2e-3 * np.std(track.current_a[rows])


@pytest.mark.parametrize("seed", [17023, 17028, 17053, 17098])
def test_nothing_is_added_to_a_joint_with_a_coarse_encoder(seed):
    _, loop = close_on(seed, (), ratio=0.0, quantum=5e-4)
    assert loop.steps == ()
    assert loop.verdict == "nothing-missing"
