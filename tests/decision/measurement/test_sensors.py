"""What three phases add up to, which no gear moves, and single samples of a current."""

import numpy as np
import pytest

from opamc_cli.decision.measurement.sensors import (
    KINDS,
    SensorErrors,
    growth_of_errors,
    sensor_errors,
)

RATE_HZ = 2000.0
NOISE_A = 0.02


def phases(seed: int, gear: float = 0.0, gain: float = 0.0, zero_a: float = 0.0) -> np.ndarray:
    """Four seconds of a carrier whose size follows the load, and in part the gear."""
    rng = np.random.default_rng(seed)
    t = np.arange(8000) / RATE_HZ
    size = 2 + 0.5 * np.sin(2 * np.pi * 0.7 * t) + 0.05 * rng.normal()
    size += gear * np.sqrt(2) * np.sin(2 * np.pi * 31 * t)
    angle = 2 * np.pi * 23 * t[:, None] - 2 * np.pi / 3 * np.arange(3)
    values = size[:, None] * np.cos(angle) + NOISE_A * rng.normal(size=(t.size, 3))
    values[:, 1] = values[:, 1] * (1 + gain) + zero_a
    return values


def measured(values: np.ndarray) -> SensorErrors:
    found = sensor_errors(values, RATE_HZ)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def baseline() -> list[SensorErrors]:
    return [measured(phases(seed)) for seed in range(5)]


def spiked(values: np.ndarray, size_a: float) -> np.ndarray:
    values[np.random.default_rng(1).integers(0, len(values), 12), 0] += size_a
    return values


def test_parts_are_what_an_error_does_to_the_vectors_length():
    """Of independent noise two of nine parts of the sum's square; of a zero error as much."""
    still = measured(phases(0))
    assert still.parts[2] == pytest.approx(2 / 9 * 3 * NOISE_A**2, rel=0.05)
    assert still.fluctuation == pytest.approx(2 / 3 * NOISE_A**2, rel=0.1)
    shifted = measured(phases(0, zero_a=0.3))
    assert shifted.parts[0] == pytest.approx(2 / 9 * 0.3**2, rel=0.05)
    # of a carrier of 23 Hz a cubic over 0.1 s takes a tenth
    assert shifted.fluctuation - still.fluctuation == pytest.approx(shifted.parts[0], rel=0.15)


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        (phases(9, zero_a=0.2), "sensor_offset"),
        (phases(9, gain=-0.1), "sensor_gain"),
        (spiked(phases(9), 3.0), "sensor_noise"),
        (spiked(phases(9), 60.0), "sensor_noise"),
        (phases(9) + 0.1 * np.random.default_rng(2).normal(size=(8000, 3)), "sensor_noise"),
    ],
    ids=["zero", "gain", "spikes", "spikes far above the current", "noise"],
)
def test_what_sensors_add_is_in_the_sum(baseline, values, kind):
    grown = growth_of_errors(baseline, [measured(values)])
    assert grown is not None
    assert grown.kind == kind
    assert grown.share > 1 / 3


def test_a_gear_leaves_the_sum_alone(baseline):
    worn = measured(phases(9, gear=0.3))
    assert worn.fluctuation > 10 * max(one.fluctuation for one in baseline)
    assert worn.parts[2] == pytest.approx(baseline[0].parts[2], rel=0.1)
    assert growth_of_errors(baseline, [worn]) is None
    assert growth_of_errors(baseline, [measured(phases(9, gear=0.3, gain=0.03))]) is None
    assert growth_of_errors(baseline[:2], [measured(phases(9, gain=0.1))]) is None
    assert growth_of_errors(baseline, []) is None


def test_unknown_samples_are_left_out():
    values = phases(3)
    values[100:300, 2] = np.nan
    assert measured(values).parts == pytest.approx(measured(phases(3)).parts, abs=1e-5)
    assert sensor_errors(np.full((400, 3), np.nan), RATE_HZ) is None
    assert len(KINDS) == len(measured(values).parts)


@pytest.mark.parametrize(("by", "shown"), [(2.0, True), (0.2, False)])
def test_single_samples_of_a_reported_current_are_the_loggers(by, shown):
    """Those of no more than noise are no spikes; a ringing gear has none."""

    def current(seed, ringing=0.0):
        t = np.arange(8000) / RATE_HZ
        noise = NOISE_A * np.random.default_rng(seed).normal(size=t.size)
        ring = ringing * np.exp(-5 * (t % 1)) * np.sin(2 * np.pi * 80 * t)
        return np.sin(2 * np.pi * 0.7 * t) + ring + noise

    before = [measured(current(seed)) for seed in range(4)]
    garbled = current(9)
    garbled[[100, 900, 1700, 2500, 6000]] += by
    grown = growth_of_errors(before, [measured(garbled)])
    assert (grown is not None) == shown
    assert grown is None or (grown.kind, grown.share > 0.9) == ("sensor_noise", True)
    assert growth_of_errors(before, [measured(current(9, ringing=0.5))]) is None
