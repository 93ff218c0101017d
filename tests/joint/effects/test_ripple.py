"""One ripple stays one, however the drive answers it."""

from dataclasses import replace

import numpy as np
import pytest
from closing import close_recording
from scipy.signal import bilinear, lfilter
from simulator import simulate
from track_of import track_of

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.effects.ripple import Ripple, read_order
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.recordings import build_track
from opamc_cli.joint.motion.track import Joint, Track
from opamc_cli.stages.model.tables import order_ties

EVERYTHING = {"order": 2.0, "speed": 1.0, "direction": 1.0, "load": 1.0, "current": 1.0}
ANSWERED = EVERYTHING | {"answer": 2.0, "top_hz": 60.0}


@pytest.fixture(scope="module")
def track():
    made = simulate(3, rate=500.0, cycles=2, kind="quintic")
    recording = Recording("run", 500.0, current_a=made.current, position_rad=made.position)
    track = build_track([recording], Joint(made.gear_ratio, made.pole_pairs))
    return track.with_model(made.current, made.current, ())


@pytest.mark.parametrize("full", [EVERYTHING, ANSWERED])
def test_smaller_forms_keep_the_columns_that_they_compute(track, full):
    columns = Ripple().columns(track, full)
    forms = Ripple().variants(full)
    assert len({tuple(form.items()) for form, _ in forms}) == len(forms)
    for form, keep in forms:
        np.testing.assert_array_equal(Ripple().columns(track, form), columns[:, keep])


def resonant(wave, rate_hz, resonance_hz=12.0, damping=0.2):
    """A velocity loop that overshoots."""
    w = 2 * np.pi * resonance_hz
    return lfilter(*bilinear((2 * damping * w, w * w), (1, 2 * damping * w, w * w), rate_hz), wave)


@pytest.mark.long
def test_a_ripple_that_the_velocity_loop_shapes_is_one_line():
    left = []
    for seed in (5, 6, 8):
        made = simulate(seed, (), 0.0, rate=500.0, kind="quintic")
        wave = np.cos(2 * made.gear_ratio * made.position + 0.4)
        current = made.current + 8 * made.noise_rms * resonant(wave, made.rate_hz)
        _, loop = close_recording(made, current, seed=seed)
        assert [step.term.effect.name for step in loop.steps] == ["ripple"]
        assert loop.steps[0].term.parameters["order"] == pytest.approx(2.0, abs=1e-6)
        assert loop.verdict == "closed"
        left.append(loop.rmse_after_a / made.noise_rms)
    # Of the two sealed cycles of seven each: noise alone scatters by some 5 %.
    assert np.mean(left) < 1.1


@pytest.mark.long
@pytest.mark.parametrize("seed", [4, 8])
def test_a_ripple_in_proportion_to_the_current_is_one_line(seed):
    made = simulate(seed, (), 0.0, rate=500.0)
    made = replace(made, gear_ratio=None, pole_pairs=None)
    current = made.current * (1 + 0.2 * np.cos(160 * made.position + 0.4))
    _, loop = close_recording(made, current, seed=seed)
    assert [step.term.effect.name for step in loop.steps] == ["ripple"]
    assert loop.steps[0].term.parameters["order"] == pytest.approx(160.0, rel=1e-3)
    assert loop.rmse_after_a < 1.1 * made.noise_rms


def turned(joint: Joint, turns: float) -> Track:
    """A motor that turns so many times."""
    _, track = track_of(joint)
    own = np.ptp(track.machine_angle_rad[track.moving]) / (2 * np.pi)
    return replace(track, machine_angle_rad=track.machine_angle_rad * turns / own)


@pytest.mark.parametrize(
    ("order", "reading"),
    [
        (1.0, "eccentricity"),
        (2.0, "kinematic error, twice"),
        (2.02, "flexspline tooth damage (2(N+1)/N)"),
        (1.98, "flexspline tooth damage (2(N-1)/N)"),
        (4.0, "kinematic error, four"),
        (6.06, "flexspline tooth damage (2(N+1)/N)"),
        (5.0, "electrical, 1p"),
        (30.0, "electrical, 6p"),
        (60.0, "cogging of 12 slots"),
        (17.3, "unknown periodic source, order 17.3 per motor"),
    ],
)
def test_orders_are_read_with_gear_ratio_and_pole_pairs(order, reading):
    assert reading in read_order(order, turned(Joint(100.0, 5), 50.0)).text


@pytest.mark.parametrize("order", [1.94, 1.987, 2.0, 2.02, 2.06, 4.04])
def test_a_short_travel_shows_the_wave_generators_own_order_and_not_the_meshs(order):
    track = turned(Joint(100.0, 5), 6.0)
    assert "per wave generator turn" in read_order(order, track).text
    tied = order_ties(order, track)
    assert len(tied) == 2
    assert all("flexspline tooth damage" in name for name in tied)
    assert "line of the tooth mesh" in read_order(6.06, track, compared=False).text


def test_sidebands_of_the_mesh_are_read_where_the_travel_tells_them_from_order_2():
    assert "sideband" in read_order(2.01, turned(Joint(100.0, 5), 50.0)).text
    assert "kinematic error" in read_order(2.01, turned(Joint(100.0, 5), 20.0)).text


@pytest.mark.parametrize("order", [2.0, 4.0, 20 / 9, 16 / 9])
def test_a_joint_without_a_strain_wave_gear_has_none_of_its_lines(order):
    _, track = track_of(Joint(9.0, 21))
    assert "unknown periodic source" in read_order(order, track).text
    assert order_ties(order, track) == []
    assert "eccentricity" in read_order(1.0, track).text


@pytest.mark.parametrize(
    ("order", "effects"),
    [(5.0, ("sensor_offset",)), (10.0, ("sensor_gain",)), (30.0, ("dead_time",)), (17.3, ())],
)
def test_a_line_of_the_current_sensors_is_tied_with_them_where_they_tell_the_motion(order, effects):
    _, track = track_of(Joint(100.0, 5))
    assert Ripple().ties({"order": order}, track) == ()
    alone = replace(track, channels=track.channels - {"logged"})
    assert Ripple().ties({"order": order}, alone) == effects
    # Or where a drive answers the torque that they make of its current.
    assert Ripple().ties({"order": order, "answer": 0.5}, track) == effects


@pytest.mark.parametrize("order", [1.0, 1.98, 2.0, 2.01, 2.02, 4.0])
def test_lines_of_healthy_gears_are_called_so_without_a_comparison(order):
    _, track = track_of(Joint(100.0, 5))
    told = built_in_library()["ripple"].interpretation({"order": order}, track)
    assert "healthy gears" in told
    assert "earlier recording" in told
    assert "inspect" not in told
    assert "check" not in told


def test_orders_closer_than_the_resolution_are_tied():
    track = turned(Joint(100.0, 5), 30.0)
    assert "kinematic error (order 2)" in order_ties(2.02, track)
    assert order_ties(2.02, turned(Joint(100.0, 5), 60.0)) == []
    assert order_ties(3.3, track) == []
    assert order_ties(2.02, track_of(Joint())[1]) == []


def test_without_gear_ratio_orders_are_counted_per_joint_revolution():
    _, track = track_of(Joint())
    assert track.angle_kind == "joint"
    assert "per joint revolution" in read_order(202.0, track).text
