"""How much of a current has changed, in amperes."""

import math

import numpy as np
import pytest

from opamc_cli.decision.witnesses.changed_size import changed_a
from opamc_cli.decision.witnesses.profiles import ProfileEvidence, profile_cell
from opamc_cli.decision.witnesses.spectra import SpectrumCell, SpectrumEvidence
from opamc_cli.signal.course import mean_course
from opamc_cli.signal.transform.short_time import short_time_log_power

N, BASELINE = 4096, 5
TIME = np.arange(N) / N


def witnesses(currents):
    """Of sessions of one motion each, the last one the target."""
    session = np.arange(len(currents))
    power = np.array([short_time_log_power(one, 16, 16) for one in currents])
    flat = power.reshape(len(currents), -1).astype(float)
    spectrum = SpectrumCell(0, flat, np.ones(len(session)), np.full(flat.shape[1], 1e-6), 16, 16, 1)
    courses = np.array([mean_course(one, 32) for one in currents], dtype=float)
    return {
        "spectrum": SpectrumEvidence([spectrum], BASELINE),
        "profile": ProfileEvidence([profile_cell(0, courses, session, len(session))], BASELINE),
    }


def currents(added, scale=1.0):
    """Healthy sessions of 1 A that differ by a thousandth, and one with something added."""
    rng = np.random.default_rng(0)
    healthy = [np.sin(np.pi * TIME) * (1 + 1e-3 * rng.normal()) for _ in range(BASELINE)]
    return [scale * one for one in (*healthy, np.sin(np.pi * TIME) + added)]


@pytest.mark.parametrize("scale", [1.0, 0.01])
@pytest.mark.parametrize(
    ("added", "rms"),
    [
        # a tone of ten periods a frame, which courses do not see; a step, which spectra hardly do
        (0.2 * np.sin(2 * np.pi * 85 * TIME), 0.2 / math.sqrt(2)),
        (np.where(TIME > 0.5, 0.2, 0.0), 0.2 / math.sqrt(2)),
        (0.0 * TIME, 0.0),
    ],
)
def test_the_size_of_what_was_added_is_told(added, rms, scale):
    found = changed_a(witnesses(currents(added, scale)))
    assert found == pytest.approx(rms * scale, rel=0.1, abs=2e-3 * scale)


def test_what_sessions_differ_by_is_no_change():
    rng = np.random.default_rng(1)
    noise = 0.1 * rng.normal(size=(BASELINE + 1, N))
    usual = changed_a(witnesses(np.sin(np.pi * TIME) + noise))
    assert usual < 0.05
    added = 0.2 * np.sin(2 * np.pi * 85 * TIME)
    odd = changed_a(witnesses([*(np.sin(np.pi * TIME) + noise[:-1]), noise[-1] + added]))
    assert odd > 0.1


def test_of_neither_nothing_is_known():
    assert math.isnan(changed_a({}))
    blank = witnesses(currents(0.0 * TIME))["spectrum"]
    blank.cells[0].sessions[-1] = math.nan
    assert math.isnan(changed_a({"spectrum": blank}))
