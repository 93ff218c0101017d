"""Motion signal and ridge against ssqueezepy, and on carriers that are known."""

import numpy as np
import pytest
import ssqueezepy

from opamc_cli.signal.motion.motion_signal import (
    MotionBand,
    MotionStream,
    _ridge,
    _smooth_at_least,
    join_frames,
    motion_frames,
)
from opamc_cli.signal.transform.wavelet import FilterBank, Morse, scale_frequencies

FS_HZ = 2048.0
STEP = 16


def test_a_block_has_the_least_smooth_length_that_holds_it():
    smooth = sorted({2**k for k in range(12)} | {3 * 2**k for k in range(11)})
    for n in range(1, 1500):
        assert _smooth_at_least(n) == next(length for length in smooth if length >= n)


def moving_carrier(n, seed=0):
    rng = np.random.default_rng(seed)
    t = np.arange(n) / FS_HZ
    frequency = 160 + 120 * np.sin(2 * np.pi * 0.4 * t)
    frequency[(t > 2) & (t < 2.5)] = 0
    tfs = np.cos(2 * np.pi * np.cumsum(frequency) / FS_HZ) + 0.1 * rng.standard_normal(n)
    return tfs.astype(np.float32), frequency


@pytest.mark.parametrize("wavelet", [Morse(3, 20), Morse(3, 60), Morse(2, 10)])
def test_agrees_with_one_transform_of_the_whole_by_ssqueezepy(wavelet):
    """The thesis's wavelet (β = 20), ssqueezepy's own default (β = 60), and another symmetry."""
    n = 40_000
    tfs, _ = moving_carrier(n)
    band = MotionBand(8, 800, 8, wavelet)
    frequencies = band.frequencies_hz()
    scales = wavelet.peak_rad * FS_HZ / (2 * np.pi * frequencies[::-1])
    morse = ("gmw", {"gamma": wavelet.gamma, "beta": wavelet.beta})
    modulus = np.abs(ssqueezepy.cwt(tfs.astype(np.float64), morse, scales=scales)[0])[:, ::STEP]
    inner = slice(200, -200)

    frames = motion_frames(tfs, band, FS_HZ, STEP)
    assert np.abs(frames.strength - modulus.max(axis=0))[inner].max() < 1e-3

    clear = modulus.max(axis=0) > 0.5  # elsewhere two scales may tie
    nearest = frequencies[::-1][modulus.argmax(axis=0)]
    octaves_off = np.abs(np.log2(frames.ridge_hz / nearest))[clear]
    assert octaves_off[20:-20].max() < 0.6 / band.voices_per_octave


def test_the_coefficients_themselves_agree_with_ssqueezepy():
    wavelet, length = Morse(), 4096
    x = np.random.default_rng(1).standard_normal(length).astype(np.float32)
    frequencies = scale_frequencies(20, 700, 6)
    scales = wavelet.peak_rad * FS_HZ / (2 * np.pi * frequencies[::-1])
    expected = ssqueezepy.cwt(
        x.astype(np.float64), ("gmw", {"gamma": 3, "beta": 20}), scales=scales, padtype=None
    )[0][::-1, ::8]
    found = FilterBank(wavelet, frequencies, FS_HZ, length, 8).transform(x)
    assert np.abs(found - expected).max() < 1e-4


def test_engine_ssqueezepy_gives_the_same_frames():
    tfs, _ = moving_carrier(20_000)
    band = MotionBand(10, 600, 8)
    ours = motion_frames(tfs, band, FS_HZ, STEP)
    theirs = motion_frames(tfs, band, FS_HZ, STEP, engine="ssqueezepy")
    assert np.abs(ours.strength - theirs.strength).max() < 1e-4


@pytest.mark.parametrize("frequency_hz", [10, 31.4, 62.8, 157, 314, 700])
@pytest.mark.parametrize("beta", [20, 60])
def test_a_unit_cosine_gives_one_and_its_frequency(frequency_hz, beta):
    x = np.cos(2 * np.pi * frequency_hz * np.arange(20_000) / FS_HZ + 1)
    band = MotionBand(voices_per_octave=16, wavelet=Morse(3, beta))
    frames = motion_frames(x, band, FS_HZ, STEP)
    inner = slice(150, -150)
    # The nearest scale is at most 1/32 octave away.
    assert frames.strength[inner].max() <= 1.001
    assert frames.strength[inner].min() > (0.98 if beta == 20 else 0.95)
    assert np.abs(frames.ridge_hz[inner] / frequency_hz - 1).max() < 0.003


def test_a_standing_vector_is_no_motion():
    frames = motion_frames(np.full(20_000, 0.8, dtype=np.float32), MotionBand(), FS_HZ, STEP)
    assert frames.strength.max() < 1e-4


@pytest.mark.parametrize("piece", [1000, 4096, 7777, 50_000])
def test_result_does_not_depend_on_the_pieces(piece):
    tfs, _ = moving_carrier(50_000)
    whole = motion_frames(tfs, MotionBand(), FS_HZ, STEP)
    stream = MotionStream(MotionBand(), FS_HZ, STEP)
    parts = [stream.push(tfs[i : i + piece]) for i in range(0, tfs.size, piece)]
    frames = join_frames([*parts, stream.finish()])
    assert join_frames([frames]).step == frames.step == STEP
    assert np.array_equal(frames.strength, whole.strength)
    assert np.array_equal(frames.ridge_hz, whole.ridge_hz)


@pytest.mark.parametrize("block", [1 << 12, 1 << 15, 100_000])
def test_result_does_not_depend_on_the_internal_block(block):
    tfs, _ = moving_carrier(50_000)
    whole = motion_frames(tfs, MotionBand(), FS_HZ, STEP)
    stream = MotionStream(MotionBand(), FS_HZ, STEP, block=block)
    frames = join_frames([stream.push(tfs), stream.finish()])
    assert np.abs(frames.strength - whole.strength).max() < 1e-3


@pytest.mark.parametrize("n", [0, 1, 2, 15, 16, 17, 500])
def test_short_recordings_have_a_frame_for_every_started_step(n):
    frames = motion_frames(np.ones(n, dtype=np.float32), MotionBand(), FS_HZ, STEP)
    assert frames.strength.size == frames.ridge_hz.size == -(-n // STEP)
    assert np.isfinite(frames.strength).all()


def test_a_band_that_is_none_is_refused():
    with pytest.raises(ValueError, match="f_min_hz"):
        scale_frequencies(100, 50, 8)


def test_a_ridge_is_refined_between_two_known_neighbours_only():
    columns = np.array([[0, 2, 1], [1, 2, 0], [1, 2, 1], [1, 4, 2], [4, 2, 1], [1, 2, 4]])
    strength, position = np.zeros((2, len(columns)), dtype=np.float32)
    _ridge(columns.T.astype(np.complex64), strength, position)
    assert strength.tolist() == columns.max(axis=1).tolist()
    # the parabola through logs 0, 2 and 1 has its peak a sixth above the middle
    assert position == pytest.approx([1, 1, 1, 1 + 1 / 6, 0, 2])
