"""One resonance's low-pass and band-pass are those of the bilinear transform, as scipy has it."""

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter, lfilter_zi

from opamc_cli.signal.transform.filters import answers

RATE_HZ = 250.0
W, DAMPING = 2 * np.pi * 12.0, 0.1
RECORDINGS = ((0, 300), (300, 500))
SIGNALS = list(np.random.default_rng(2).normal(1.0, 1.0, (2, 500)))


def by_scipy(signal, numerator):
    # The resonance is bent, so that it lies where it is asked for.
    bent = 2 * RATE_HZ * np.tan(W / (2 * RATE_HZ))
    scaled = np.array(numerator) * bent ** (3 - len(numerator))
    b, a = bilinear(scaled, [1.0, 2 * DAMPING * bent, bent**2], RATE_HZ)
    parts = [signal[start:stop] for start, stop in RECORDINGS]
    return np.concatenate([lfilter(b, a, x, zi=lfilter_zi(b, a) * x[0])[0] for x in parts])


def test_low_passes_come_first_and_band_passes_after_them():
    found = answers(SIGNALS, W, DAMPING, RATE_HZ, RECORDINGS)
    wanted = [by_scipy(x, [1.0]) for x in SIGNALS] + [by_scipy(x, [1.0, 0.0]) for x in SIGNALS]
    assert found == pytest.approx(np.array(wanted), abs=1e-9)


def test_some_rows_are_those_of_all_and_are_written_where_they_are_asked_for():
    rows, out = np.array([3, 4, 299, 300, 471]), np.empty((4, 5))
    found = answers(SIGNALS, W, DAMPING, RATE_HZ, RECORDINGS, rows, out)
    assert found is out
    assert (out == answers(SIGNALS, W, DAMPING, RATE_HZ, RECORDINGS)[:, rows]).all()


def test_what_stands_still_stays_and_does_not_ring():
    low, band = answers([np.full(500, 3.0)], W, DAMPING, RATE_HZ, RECORDINGS)
    assert low == pytest.approx(np.full(500, 3.0))
    assert band == pytest.approx(np.zeros(500), abs=1e-9)
