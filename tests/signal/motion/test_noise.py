"""The noise of a current, told from what a robot does beside it."""

import numpy as np
import pytest

from opamc_cli.signal.motion.noise import BLOCK, QUIET_SHARE, noise_level


def slow_noise_level(current):
    """The definition, difference by difference and block by block."""
    known = [z for z in current.tolist() if np.isfinite(z)]
    powers = []
    for a, b, c, d in zip(known, known[1:], known[2:], known[3:], strict=False):
        powers.append(abs(d - 3 * c + 3 * b - a) ** 2)
    if not powers:
        return 0.0
    whole = len(powers) // BLOCK
    blocks = [powers[k * BLOCK : (k + 1) * BLOCK] for k in range(whole)] or [powers]
    components = 2 if np.iscomplexobj(current) else 1
    mean = np.quantile([np.mean(block) for block in blocks], QUIET_SHARE)
    return float(np.sqrt(mean / 20 / components))


@pytest.mark.parametrize("n", [0, 3, 4, 100, 259, 2000])
@pytest.mark.parametrize("kind", [float, complex])
def test_it_is_its_definition(n, kind):
    rng = np.random.default_rng(n)
    current = rng.standard_normal(n).astype(kind)
    if kind is complex:
        current += 2j * rng.standard_normal(n)
    current[5::50] = np.nan
    assert noise_level(current) == pytest.approx(slow_noise_level(current), rel=1e-9)


@pytest.mark.parametrize("kind", [float, complex])
def test_a_robot_that_rests_a_fifth_of_the_time_does_not_hide_it(kind):
    rng = np.random.default_rng(1)
    t = np.arange(20_000) / 2000
    turning = 3.0 * np.exp(2j * np.pi * 80 * t) * (t > 2)
    noise = 0.05 * (rng.standard_normal(t.size) + 1j * rng.standard_normal(t.size))
    current = turning + noise + 1.5
    found = noise_level(current if kind is complex else current.real)
    assert found == pytest.approx(0.05, rel=0.08)
