import numpy as np
import pytest

from opamc_cli.signal.offset import turning_means, turning_offset

FS_HZ = 2048.0


def _run(offset: complex, noise: float = 0.05, seed: int = 0) -> np.ndarray:
    """Ten moves at 60 Hz whose torque changes sign, between rests under a holding torque."""
    rng = np.random.default_rng(seed)
    parts = []
    phase = 0.3
    for _ in range(10):
        t = np.arange(round(1.5 * FS_HZ)) / FS_HZ
        torque = 2.0 - 2.5 * t
        parts.append(torque * np.exp(1j * (phase + 2 * np.pi * 60.0 * t)))
        phase += 2 * np.pi * 60.0 * 1.5
        parts.append(np.full(round(0.7 * FS_HZ), 1.2 * np.exp(1j * phase)))
    z = np.concatenate(parts)
    return z + offset + noise * (rng.standard_normal(z.size) + 1j * rng.standard_normal(z.size))


@pytest.mark.parametrize("offset", [0j, 0.2 - 0.1j, -0.4j])
def test_the_offset_is_told_from_turning_and_not_from_holding(offset: complex) -> None:
    found = turning_offset(turning_means(_run(offset), FS_HZ))
    assert abs(found - offset) < 0.02


def test_a_vector_that_does_not_turn_has_no_offset() -> None:
    still = np.full(20_000, 1.0 + 0.5j)
    assert turning_means(still, FS_HZ).size == 0
    assert turning_offset(turning_means(still, FS_HZ)) == 0j


def test_gaps_and_short_runs_are_passed_over() -> None:
    z = _run(0.2 + 0j)
    z[::4000] = np.nan
    assert abs(turning_offset(turning_means(z, FS_HZ)) - 0.2) < 0.03
    assert turning_offset(turning_means(z[:10], FS_HZ)) == 0j
    assert turning_offset(turning_means(z[:0], FS_HZ)) == 0j
