"""Lines without a name, over the angle and over time."""

from types import SimpleNamespace

import numpy as np
import pytest
from closing import joint_of, plain_fit

from opamc_cli.joint.explain.lines import AngleLine, Tone

RATE = 250.0


@pytest.fixture(scope="module")
def track():
    return plain_fit(joint_of("cyclic", None)).dataset.fine.track


def line(track, of, strength):
    noise = np.random.default_rng(1).normal(size=track.size)
    wave = np.sin(of(track) + 0.4)
    return np.where(track.moving, noise + strength * wave, 0.0)


def test_an_angle_line_has_both_phases_of_four_parts_side_by_side():
    angle = np.array([0.0, np.pi / 4, np.pi / 2])
    small = SimpleNamespace(
        size=3,
        machine_angle_rad=angle,
        velocity=np.array([1.0, -2.0, 0.0]),
        speed_scale=2.0,
        direction=np.array([1.0, -1.0, 0.0]),
        model_a=np.array([5.0, 6.0, 7.0]),
    )
    follows = {"speed": 1.0, "direction": 1.0, "current": 1.0}
    columns = AngleLine().columns(small, {"order": 2.0, **follows})
    cosine, sine = np.array([1.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0])
    speed = np.array([0.0, 0.5, -0.5])
    for k, part in enumerate(([1, 1, 1], speed, small.direction, small.model_a)):
        np.testing.assert_allclose(columns[:, 2 * k], part * cosine, atol=1e-12)
        np.testing.assert_allclose(columns[:, 2 * k + 1], part * sine, atol=1e-12)
    assert columns.shape == (3, 8)


@pytest.mark.parametrize("order", [12.0, 31.5])
def test_the_strongest_order_is_guessed(track, order):
    residual = line(track, lambda t: order * t.machine_angle_rad, 1.0)
    guesses = AngleLine().guesses(track, residual)
    assert guesses[0]["order"] == pytest.approx(order, abs=0.25)
    assert AngleLine().guesses(track, line(track, lambda t: t.time_s, 0.0)) == []


def test_two_strong_orders_are_two_guesses(track):
    residual = line(track, lambda t: 12 * t.machine_angle_rad, 1.5)
    residual += line(track, lambda t: 20 * t.machine_angle_rad, 1.0)
    # A travel of 2 rad tells orders apart that differ by 3.
    # Twice: by their height, and by what they stand out of.
    orders = [guess["order"] for guess in AngleLine().guesses(track, residual)]
    assert orders[:2] == pytest.approx([12.0, 20.0], abs=0.25)


def test_a_line_over_time_is_guessed_where_it_holds_two_per_cent(track):
    residual = line(track, lambda t: 2 * np.pi * 40.0 * t.time_s, 0.4)
    ((name, frequency),) = Tone().guesses(track, residual)[0].items()
    assert name == "frequency_hz"
    assert frequency == pytest.approx(40.0, abs=0.05)
    for strength in (0.0, 0.15):
        weak = line(track, lambda t: 2 * np.pi * 40.0 * t.time_s, strength)
        assert Tone().guesses(track, weak) == []


@pytest.mark.parametrize(
    ("frequency", "found"), [(0.8, False), (1.3, True), (119, True), (122, False)]
)
def test_a_line_over_time_is_sought_from_one_hertz_to_nearly_half_of_the_rate(
    track, frequency, found
):
    residual = np.where(track.moving, np.sin(2 * np.pi * frequency * track.time_s), 0.0)
    residual = residual + 1e-3 * line(track, lambda t: t.time_s, 0.0)
    # What leaks from outside of the band is no line inside.
    guessed = [guess["frequency_hz"] for guess in Tone().guesses(track, residual)]
    assert any(abs(one - frequency) < 0.05 for one in guessed) is found


def test_a_tone_is_cosine_and_sine_of_time():
    small = SimpleNamespace(time_s=np.array([0.0, 0.125, 0.25]), starts_s=np.zeros(1))
    columns = Tone().columns(small, {"frequency_hz": 2.0})
    np.testing.assert_allclose(columns, [[1, 0], [0, 1], [-1, 0]], atol=1e-12)


def test_limits_and_first_steps_are_half_of_what_can_be_told_apart(track):
    travel = np.ptp(track.machine_angle_rad[track.moving])
    assert AngleLine().first_steps(track, {})["order"] == pytest.approx(np.pi / travel)
    low, high = AngleLine().limits(track)["order"]
    assert low == 0.0
    assert high >= 1e4
    assert Tone().limits(track) == {"frequency_hz": (0.5, 0.49 * RATE)}
    seconds = np.ptp(track.time_s)
    assert Tone().first_steps(track, {}) == {"frequency_hz": pytest.approx(0.5 / seconds)}
    still = SimpleNamespace(run_time_s=np.zeros(1))
    assert np.isfinite(Tone().first_steps(still, {})["frequency_hz"])


@pytest.mark.parametrize("effect", [AngleLine(), Tone()])
def test_lines_are_fast_have_no_name_and_may_be_several(effect):
    assert effect.fast
    assert effect.several
    assert effect.unnamed
    assert effect.searched({effect.searches[0]: 1.0}) == 1
