"""Morse wavelets and their filter bank against the formula and a transform of full length."""

import numpy as np
import pytest

from opamc_cli.config.models import SegmentConfig
from opamc_cli.signal.transform.wavelet import CUTOFF, FilterBank, Morse, scale_frequencies

WAVELETS = [Morse(), Morse(3, 60), Morse(2, 10)]


def test_the_wavelet_of_a_notebook_is_that_of_the_stages():
    options = SegmentConfig()
    assert Morse() == Morse(options.gamma, options.beta)


@pytest.mark.parametrize("wavelet", WAVELETS)
def test_the_response_is_two_at_its_peak_and_nothing_at_negative_frequencies(wavelet):
    ratio = np.linspace(0.01, 4, 40_000)
    response = wavelet.response(ratio)
    assert ratio[response.argmax()] == pytest.approx(1.0, abs=2e-4)
    assert response.max() == pytest.approx(2.0, rel=1e-6)
    np.testing.assert_array_equal(wavelet.response(np.array([0.0, -1.0])), 0.0)
    # a Morse wavelet is ω^β·exp(-ω^γ), at ω in units of where it peaks
    omega = ratio * wavelet.peak_rad
    plain = omega**wavelet.beta * np.exp(-(omega**wavelet.gamma))
    np.testing.assert_allclose(response / 2, plain / plain.max(), rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize("wavelet", WAVELETS)
def test_the_band_ends_where_the_response_does(wavelet):
    low, high = wavelet.band()
    step = (20 / 1e-3) ** (1 / 19_999)
    for inside, outside in ((low, low / step), (high, high * step)):
        assert wavelet.response(np.array([inside]))[0] > 2 * CUTOFF
        assert wavelet.response(np.array([outside]))[0] <= 2 * CUTOFF


def test_the_duration_is_that_of_a_gaussian_of_the_same_width():
    """Near its peak the filter is a Gaussian; its standard deviations multiply to one half."""
    for wavelet in WAVELETS:
        h = 1e-3
        log_gain = np.log(wavelet.response(np.array([1 - h, 1.0, 1 + h])))
        curvature = -(log_gain[0] - 2 * log_gain[1] + log_gain[2]) / h**2
        assert wavelet.duration == pytest.approx(np.sqrt(curvature) / (2 * np.pi), rel=1e-3)


@pytest.mark.parametrize(("length", "step"), [(512, 1), (512, 8), (1024, 16)])
@pytest.mark.parametrize("wavelet", WAVELETS)
def test_every_output_is_that_of_a_transform_of_full_length(wavelet, length, step):
    fs_hz = 1000.0
    frequencies = scale_frequencies(20, 400, 4)
    block = np.random.default_rng(length).standard_normal(length).astype(np.float32)
    found = FilterBank(wavelet, frequencies, fs_hz, length, step).transform(block)
    bins_hz = np.fft.rfftfreq(length, 1 / fs_hz)
    spectrum = np.zeros(length, dtype=complex)
    for row, frequency in zip(found, frequencies, strict=True):
        spectrum[: bins_hz.size] = np.fft.rfft(block) * wavelet.response(bins_hz / frequency)
        np.testing.assert_allclose(row, np.fft.ifft(spectrum)[::step], atol=2e-5)


def test_blocks_that_steps_do_not_divide_are_refused():
    with pytest.raises(ValueError, match="multiple of step, got 100 and 16"):
        FilterBank(Morse(), scale_frequencies(20, 400, 4), 1000.0, 100, 16)


def test_scales_are_evenly_spaced_in_pitch_and_never_wider_than_asked_for():
    for low, high, voices in ((8, 800, 8), (10, 20, 1), (10, 21, 1), (5, 6, 12)):
        found = scale_frequencies(low, high, voices)
        assert found[[0, -1]] == pytest.approx([low, high])
        octaves = np.diff(np.log2(found))
        np.testing.assert_allclose(octaves, octaves[0])
        assert 0.5 / voices < octaves[0] <= 1 / voices + 1e-12


@pytest.mark.parametrize("given", [(0, 10, 8), (10, 10, 8), (20, 10, 8), (10, 20, 0)])
def test_bands_that_are_none_are_refused(given):
    with pytest.raises(ValueError, match="f_min_hz"):
        scale_frequencies(*given)
