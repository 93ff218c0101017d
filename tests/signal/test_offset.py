import numpy as np
import pytest

from opamc_cli.signal.offset import mean_over_turns, turning_means, turning_offset, turns

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


def turning(n_turns: float, n: int) -> np.ndarray:
    return np.exp(2j * np.pi * np.linspace(0, n_turns, n))


def test_turns_are_counted_whatever_the_torque_s_sign() -> None:
    z = turning(3.25, 200)
    z[100:] *= -1
    assert turns(np.stack([z, z[::-1], 0 * z + 1])) == pytest.approx([3.25, 3.25, 0])


FS_OF_MOTIONS_HZ = 2000.0


def motion(n_turns: float, at_rest: int = 0) -> tuple[np.ndarray, float]:
    """A motion of a second that begins and ends slowly, and then holds; its highest frequency.

    Its current grows as it accelerates.
    """
    s = np.linspace(0, 1, 2000)
    angle = 2 * np.pi * n_turns * (10 * s**3 - 15 * s**4 + 6 * s**5)
    z = (2 + np.cos(np.pi * s)) * np.exp(1j * angle)
    return np.append(z, np.full(at_rest, z[-1])), 1.875 * n_turns


@pytest.mark.parametrize("at_rest", [0, 600])
@pytest.mark.parametrize(("n_turns", "off_by"), [(7, 0.008), (20, 0.002), (100, 0.002)])
def test_the_mean_over_turns_is_the_offset(n_turns: float, off_by: float, at_rest: int) -> None:
    offset = 0.1 + 0.2j
    motions = [motion(n_turns, at_rest), motion(n_turns + 0.5, at_rest)]
    for z, _ in motions:
        z += offset
    motions[0][0][700] = np.nan
    assert abs(mean_over_turns(motions, FS_OF_MOTIONS_HZ) - offset) < off_by * 2
    # over time the slow turns at both ends weigh most
    plain = np.nanmean(np.concatenate([z for z, _ in motions]))
    assert abs(plain - offset) > 3 * off_by * 2


def test_what_does_not_turn_has_no_offset() -> None:
    for vector in (np.zeros(0), np.array([np.nan]), np.array([3.0]), np.full(500, 3.0)):
        assert mean_over_turns([(vector + 0j, 10.0)], FS_OF_MOTIONS_HZ) == 0j
    assert mean_over_turns([], FS_OF_MOTIONS_HZ) == 0j


@pytest.mark.parametrize(("turns_of_a_piece", "n_pieces"), [(3.9, 0), (4.1, 3)])
def test_pieces_are_quarters_of_a_second_of_four_turns(
    turns_of_a_piece: float, n_pieces: int
) -> None:
    fs_hz = 400.0
    z = np.exp(2j * np.pi * turns_of_a_piece * np.arange(399) / 99)
    means = turning_means(z, fs_hz)
    assert means.size == n_pieces
    taper = np.hanning(100)
    for k, mean in enumerate(means):
        assert mean == pytest.approx(np.average(z[100 * k : 100 * k + 100], weights=taper))
    # two samples at least, at whatever rate
    assert turning_means(z, 1.0).size == 0


def test_the_offset_is_the_median_of_four_pieces_at_least() -> None:
    means = np.array([1 + 1j, 2 + 9j, 3 + 2j, 90 + 3j])
    assert turning_offset(means) == 2.5 + 2.5j
    assert turning_offset(means[:3]) == 0j
