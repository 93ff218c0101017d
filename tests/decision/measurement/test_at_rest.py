"""Noise at standstill, where a fault of the gear does not show."""

import numpy as np
import pytest

from opamc_cli.decision.measurement.at_rest import (
    BLOCK_S,
    Fluctuation,
    about_course,
    fluctuation,
    growth_at_rest,
)

RATE_HZ = 500.0
NOISE_A = 0.02


def recording(
    seed: int, noise: float = 1.0, gear: float = 0.0, hum: float = 0.0, hunting: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Current and position of three moves with pauses; sizes in units of the usual noise."""
    rng = np.random.default_rng(seed)
    still, way = np.zeros(400), 1 - np.cos(np.linspace(0, np.pi, 400))
    position = np.concatenate([still, way, still + 2, 2 - way, still, way, still + 2])
    t = np.arange(position.size) / RATE_HZ
    speed = np.gradient(position) * RATE_HZ
    current = 0.5 * np.tanh(speed / 0.1) + 0.3 * position + 0.2 * speed
    sizes = noise * rng.normal(size=t.size) + hum * np.sqrt(2) * np.sin(2 * np.pi * 50 * t)
    sizes += gear * np.sqrt(2) * np.sin(200 * position) * (np.abs(speed) > 0)
    shaking = hunting * np.sqrt(2) * np.sin(2 * np.pi * 35 * t)
    position = np.round((position + 1e-6 * shaking) / 1e-7) * 1e-7
    return current + NOISE_A * (sizes + shaking), position


def measured(seed: int, **sizes: float) -> Fluctuation:
    found = fluctuation(*recording(seed, **sizes), RATE_HZ)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def baseline() -> list[Fluctuation]:
    return [measured(seed) for seed in range(6)]


def test_noise_is_measured_where_the_joint_stands():
    found = measured(1)
    assert found.at_rest == pytest.approx(NOISE_A**2, rel=0.1)
    assert measured(1, gear=5.0).at_rest == pytest.approx(found.at_rest, rel=1e-9)
    assert measured(1, gear=5.0).in_motion > 4 * found.in_motion


@pytest.mark.parametrize("sizes", [{"noise": 3.0}, {"hum": 3.0}])
def test_a_sensors_trouble_has_grown_at_rest_as_well(baseline, sizes):
    grown = growth_at_rest(baseline, [measured(9, **sizes)])
    assert grown is not None
    assert grown.times == pytest.approx(np.hypot(1, 3) if "hum" in sizes else 3, rel=0.1)
    assert grown.share > 0.8


@pytest.mark.parametrize(
    "sizes",
    [{}, {"gear": 3.0}, {"gear": 20.0}, {"noise": 3.0, "gear": 10.0}, {"hunting": 5.0}],
    ids=["healthy", "gear", "much", "both", "a loop that hunts moves the joint"],
)
def test_no_sensor_is_suspected(baseline, sizes):
    assert growth_at_rest(baseline, [measured(9, **sizes)]) is None


def test_who_has_too_few_recordings_or_pauses_is_told_nothing(baseline):
    noisy = measured(9, noise=3.0)
    assert growth_at_rest(baseline[:2], [noisy]) is None
    assert growth_at_rest(baseline, []) is None
    current, position = recording(1)
    assert fluctuation(current[400:800], position[400:800], RATE_HZ) is None
    assert fluctuation(current[:400], position[:400], RATE_HZ) is None
    assert fluctuation(np.full_like(current, np.nan), position, RATE_HZ) is None
    assert fluctuation(current[:3], position[:3], RATE_HZ) is None


def test_phases_fluctuate_as_the_current_that_they_are():
    """A vector of length zero fluctuates upwards alone: at rest each phase is asked."""
    current, position = recording(1)
    angle = 7 * 100 * position[:, None] + 2 * np.pi / 3 * np.array([0, 1, 2])
    rng = np.random.default_rng(3)
    clean = recording(1, noise=0.0)[0][:, None] * np.cos(angle)
    noisy = clean + NOISE_A * np.sqrt(1.5) * rng.normal(size=clean.shape)
    one, three = fluctuation(current, position, RATE_HZ), fluctuation(noisy, position, RATE_HZ)
    assert one is not None
    assert three is not None
    assert three.at_rest == pytest.approx(one.at_rest, rel=0.15)
    assert three.in_motion == pytest.approx(one.in_motion, rel=0.3)


def test_a_course_is_a_cubic():
    """Against numpy's own fit, stretch by stretch."""
    rng = np.random.default_rng(0)
    stretches = rng.normal(size=(5, round(BLOCK_S * 120), 2))
    slow = np.empty((5, 2))
    time = np.arange(stretches.shape[1])
    for n, k in np.ndindex(slow.shape):
        left = stretches[n, :, k] - np.polyval(np.polyfit(time, stretches[n, :, k], 3), time)
        slow[n, k] = (left**2).sum() / (time.size - 4)
    np.testing.assert_allclose(about_course(stretches), slow, rtol=1e-9)
    bent = (time**3.0 - 4 * time)[None, :, None]
    assert about_course(bent)[0, 0] < 1e-18 * np.ptp(bent) ** 2 + 1e-18
