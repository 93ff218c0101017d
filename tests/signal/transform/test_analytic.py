"""Analytic signal, envelope, fine structure and frequency on carriers that are known."""

import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.signal.transform.analytic import (
    AnalyticStream,
    analytic_signal,
    clarke,
    envelope,
    temporal_fine_structure,
)

FS_HZ = 2048.0


def balanced_phases(amplitude, angle):
    return [amplitude * np.cos(angle + k * 2 * np.pi / 3) for k in (0, -1, 1)]


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float32, 1e-6), (np.float64, 1e-14)])
def test_clarke_gives_amplitude_and_angle(dtype, tolerance):
    t = np.arange(4096) / FS_HZ
    amplitude = 1 + 0.5 * np.sin(2 * np.pi * 3 * t)
    angle = 2 * np.pi * (50 * t + 30 * t**2)
    z = clarke(*[p.astype(dtype) for p in balanced_phases(amplitude, angle)])
    assert z.dtype == (np.complex64 if dtype == np.float32 else np.complex128)
    assert np.abs(z - amplitude * np.exp(1j * angle)).max() < 20 * tolerance


def test_clarke_is_the_printed_sum_and_drops_what_is_common():
    a, b, c = np.random.default_rng(0).standard_normal((3, 100))
    turn = np.exp(2j * np.pi / 3)
    assert np.allclose(clarke(a, b, c), 2 / 3 * (a + b * turn + c / turn))
    assert np.allclose(clarke(a + 5, b + 5, c + 5), clarke(a, b, c))


def test_phases_in_the_other_order_turn_backwards():
    a, b, c = balanced_phases(2.0, 2 * np.pi * 40 * np.arange(500) / FS_HZ)
    for phases, frequency_hz in (((a, b, c), 40), ((a, c, b), -40)):
        z = clarke(*phases)
        turned = np.angle(z[1:] * np.conj(z[:-1])) * FS_HZ / (2 * np.pi)
        assert np.allclose(turned, frequency_hz)


@pytest.mark.parametrize("n", [1, 2, 3, 17, 1000, 1001])
def test_real_part_of_the_analytic_signal_is_the_signal(n):
    x = np.random.default_rng(n).standard_normal(n)
    z = analytic_signal(x)
    assert z.shape == (n,)
    assert np.allclose(z.real, x)
    assert analytic_signal(x.astype(np.float32)).dtype == np.complex64


def test_analytic_signal_equals_scipy_on_the_reflected_segment():
    x = np.random.default_rng(3).standard_normal(500)
    reflected = np.pad(x, 250, mode="reflect")
    assert np.allclose(analytic_signal(x), scipy.signal.hilbert(reflected)[250:750])


def test_analytic_signal_of_nothing_is_nothing():
    assert analytic_signal(np.zeros(0)).size == 0


def test_envelope_of_a_modulated_carrier():
    t = np.arange(8192) / FS_HZ
    amplitude = 1 + 0.3 * np.cos(2 * np.pi * 5 * t)
    z = analytic_signal(amplitude * np.cos(2 * np.pi * 200 * t))
    assert np.abs(envelope(z) - amplitude)[400:-400].max() < 2e-3


class TestStream:
    def carrier(self, n):
        t = np.arange(n) / FS_HZ
        return np.cos(2 * np.pi * (10 * t + 20 * t**2)).astype(np.float32) + np.float32(0.2)

    def whole(self, x, **options):
        stream = AnalyticStream(FS_HZ, 8.0, **options)
        return np.concatenate([stream.push(x), stream.finish()])

    @settings(max_examples=30)
    @given(st.lists(st.integers(0, 9000), min_size=1, max_size=6))
    def test_result_does_not_depend_on_the_pieces(self, pieces):
        x = self.carrier(sum(pieces))
        stream = AnalyticStream(FS_HZ, 8.0, core=4096)
        parts = [stream.push(p) for p in np.split(x, np.cumsum(pieces)[:-1])]
        z = np.concatenate([*parts, stream.finish()])
        assert z.size == x.size
        assert np.array_equal(z, self.whole(x, core=4096))

    def test_result_does_not_depend_on_the_internal_block(self):
        x = self.carrier(30_000)
        assert np.abs(self.whole(x, core=2000) - self.whole(x, core=20_000)).max() < 1e-5

    def test_agrees_with_the_transform_of_the_whole_recording(self):
        x = self.carrier(16_384)
        z = self.whole(x)
        assert np.array_equal(z.real, x)
        assert np.abs(z - analytic_signal(x))[1024:-1024].max() < 0.01

    @pytest.mark.parametrize(("f_min_hz", "half"), [(8.0, 1024), (7.9, 1038), (2000.0, 8)])
    def test_it_is_a_filter_of_four_periods_of_the_lowest_carrier_either_way(self, f_min_hz, half):
        x = self.carrier(5000).astype(float)
        stream = AnalyticStream(FS_HZ, f_min_hz)
        z = np.concatenate([stream.push(x), stream.finish()])
        n = np.arange(-half, half + 1)
        taps = np.divide(2, np.pi * n, out=np.zeros(n.size), where=n % 2 != 0)
        filtered = np.convolve(np.pad(x, half, mode="reflect"), taps * np.blackman(n.size), "valid")
        np.testing.assert_allclose(z.imag, filtered, atol=1e-5)

    def test_a_constant_has_no_imaginary_part(self):
        assert np.abs(self.whole(np.full(9000, 3.0, dtype=np.float32)).imag).max() < 1e-5


def test_fine_structure_is_the_cosine_of_the_angle():
    z = np.random.default_rng(4).standard_normal(1000) + 1j * np.linspace(-1, 1, 1000)
    assert np.allclose(temporal_fine_structure(z), np.cos(np.angle(z)))
    assert np.abs(temporal_fine_structure(z.astype(np.complex64))).max() <= 1


def test_fine_structure_fades_below_the_floor_and_is_continuous_there():
    angle = np.linspace(0, 2 * np.pi, 50)
    for modulus, expected in ((1.0, 1.0), (0.5, 1.0), (0.25, 0.5), (0.0, 0.0)):
        tfs = temporal_fine_structure(modulus * np.exp(1j * angle), floor_a=0.5)
        assert np.allclose(tfs, expected * np.cos(angle))


def test_fine_structure_of_missing_and_zero_current_is_zero():
    z = np.array([np.nan + 0j, 0, 1 + np.nan * 1j, 2], dtype=np.complex64)
    assert temporal_fine_structure(z).tolist() == [0, 0, 0, 1]
