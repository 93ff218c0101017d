"""Segments of an axis with phase currents: by the motion signal of its carrier."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from opamc_cli.config.models import SegmentConfig
from opamc_cli.errors import InputError
from opamc_cli.signal.motion.boundaries import refine_boundaries
from opamc_cli.signal.motion.motion_signal import MotionBand, MotionStream, join_frames
from opamc_cli.signal.motion.noise import noise_level
from opamc_cli.signal.motion.rotation import RotationStream, join_rotation
from opamc_cli.signal.motion.segmentation import (
    Evidence,
    Motion,
    MotionRule,
    find_motions,
    largest_frequency,
)
from opamc_cli.signal.motion.windows import carrier_windows
from opamc_cli.signal.offset import turning_means, turning_offset
from opamc_cli.signal.plausible.quality import LIMITS, Size, clipped_share
from opamc_cli.signal.transform.analytic import (
    AnalyticStream,
    clarke,
    envelope,
    temporal_fine_structure,
)
from opamc_cli.signal.transform.wavelet import Morse
from opamc_cli.stages.chain.segments.rows import (
    STILL_SHARE,
    AxisSegments,
    Flags,
    Segment,
    lost,
    lost_spans,
    make_rows,
    mean_variance,
    read_variance,
)
from opamc_cli.stages.recordings.beyond import sized
from opamc_cli.storage.runs.columns import AxisChannels
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import ROW_GROUP_SAMPLES

FRAME_S = 0.008
CARRIER_SHARE = 0.4
"""Fastest carrier that a sampling rate serves, as a share of it: 2.5 samples per period."""
HIGHEST_CARRIER_HZ = 1000.0
"""No servo motor turns faster: 10 pole pairs at 6000 revolutions per minute."""
PROBES = 4
"""Row groups, spread over the run, from which noise and clipping are told."""
MAX_FLOOR_SHARE = 1.0
"""Of the larger moduli: a carrier that never stands still passes for noise in part, and must not
hide itself."""
CONTEXT_S = 2.0
"""Standstill beside a motion that is read to place its boundaries."""
LOST_SHARE = 0.25
"""Of its largest frequency: a carrier that ends faster than that did not end, but was lost."""
STEADY_S = 0.25
"""Least time for which a recording that never stands still has to keep its largest frequency."""

Complex = npt.NDArray[np.complexfloating]
Floats = npt.NDArray[np.floating]


@dataclass(frozen=True)
class _Probe:
    """What a look at a part of the run tells."""

    noise_a: float
    """Standard deviation of the noise in each component of the current, A."""
    floor_a: float
    """Modulus below which the carrier's angle is noise, A."""
    offset_a: complex
    """What the sensors add to the current vector, A; 0 for one phase. Left in, it stands still
    where torque passes zero, and looks like a robot that stands."""
    notes: tuple[str, ...]
    """One sentence for each clipped phase."""


def carrier_segments(run: Run, channels: AxisChannels, config: SegmentConfig) -> AxisSegments:
    """Find the motions of an axis from its phase currents, of which it has one at least.

    Raises
    ------
    InputError
        If a phase holds no numbers, is constant while the others are not, or the carrier is too
        fast for the sampling rate.
    """
    names = channels.phases if len(channels.phases) == 3 else channels.phases[:1]
    band = motion_band(run.sampling_rate_hz, config)
    _check_band(run, band)
    probe = _look(run, names, config)
    evidence, notes, missing, gaps = _gather(run, names, band, probe, config)
    rule = MotionRule(
        on=config.threshold_on,
        off=config.threshold_off,
        min_motion_s=config.min_motion_s,
        min_still_s=config.min_still_s,
        max_dip_s=config.max_dip_s,
    )
    motions = find_motions(evidence, rule)
    _check_carrier(run, channels, motions, band)
    if _never_stands(motions, evidence):
        segments = _windows(run, names, evidence, motions[0], config)
    else:
        segments = _refined(run, names, motions, evidence, probe.offset_a, config.min_motion_s)
    signal = "phases" if len(names) == 3 else "phase"
    strongest = float(evidence.frames.strength.max(initial=0))
    return AxisSegments(
        run.name,
        make_rows(run, channels, segments, signal, gaps),
        probe.notes + notes,
        f"axis {channels.axis}: S(t) reaches {strongest:.2f}, {config.threshold_on:g} is motion",
        lost(channels.axis, missing / run.n_samples),
        missing,
    )


def motion_band(fs_hz: float, config: SegmentConfig) -> MotionBand:
    """Return the frequencies in which carriers are looked for."""
    highest = config.f_max_hz or min(HIGHEST_CARRIER_HZ, CARRIER_SHARE * fs_hz)
    return MotionBand(
        config.f_min_hz, highest, config.voices_per_octave, Morse(config.gamma, config.beta)
    )


def frame_step(fs_hz: float) -> int:
    """Choose the samples between frames: a power of two, for the Fourier transforms."""
    return int(2 ** max(0, np.floor(np.log2(FRAME_S * fs_hz))))


def _look(run: Run, names: Sequence[str], config: SegmentConfig) -> _Probe:
    starts = np.linspace(0, max(0, run.n_samples - ROW_GROUP_SAMPLES), PROBES).astype(int)
    noise, means, moduli, notes = [], [], [], []
    clipped = dict.fromkeys(names, 0.0)
    for start in np.unique(starts // ROW_GROUP_SAMPLES * ROW_GROUP_SAMPLES).tolist():
        block = run.read(names, start, start + ROW_GROUP_SAMPLES)
        current = _current([block[name] for name in names])
        noise.append(noise_level(current))
        if np.iscomplexobj(current):  # three phases
            means.append(turning_means(current.astype(np.complex64), run.sampling_rate_hz))
        modulus = np.abs(current) if len(names) == 1 else envelope(current.astype(np.complex64))
        moduli.append(float(np.nanquantile(modulus, 0.95)) if np.isfinite(modulus).any() else 0.0)
        for name in names:
            clipped[name] = max(clipped[name], clipped_share(block[name]))
    for name, share in clipped.items():
        if share > 0:
            notes.append(
                f"{run.path}: column {name} looks clipped: {share:.1%} of its samples sit at its "
                "limit; use a sensor with a larger range"
            )
    # Of a recording that never stands still somewhere, the quietest part tells the noise.
    noise_a = float(min(noise))
    return _Probe(
        noise_a,
        min(config.noise_floor * noise_a, MAX_FLOOR_SHARE * max(moduli)),
        turning_offset(np.concatenate(means)) if means else 0j,
        tuple(notes),
    )


def _gather(
    run: Run, names: Sequence[str], band: MotionBand, probe: _Probe, config: SegmentConfig
) -> tuple[Evidence, tuple[str, ...], int, list[tuple[int, int]]]:
    """Read the whole run once, block by block; keep its frames, and where numbers lack."""
    fs_hz = run.sampling_rate_hz
    step = frame_step(fs_hz)
    motion = MotionStream(band, fs_hz, step, engine=config.engine)
    rotation = RotationStream(step)
    hilbert = AnalyticStream(fs_hz, band.f_min_hz) if len(names) == 1 else None
    frames, turns = [], []
    n_missing = dict.fromkeys(names, 0)
    unknown, held = Flags(), Flags()
    last = dict.fromkeys(names, math.nan)
    lowest = dict.fromkeys(names, np.inf)
    highest = dict.fromkeys(names, -np.inf)
    sizes = {name: Size(LIMITS["A"]) for name in names}

    def take(z: Complex) -> None:
        frames.append(motion.push(temporal_fine_structure(z, probe.floor_a)))
        turns.append(rotation.push(z))

    for _, block in run.blocks(names):
        phases = []
        whole = np.ones(block[names[0]].size, dtype=bool)
        same = whole.copy()
        for name in names:
            x = block[name].astype(np.float32, copy=False)
            same[0] &= bool(x[0] == last[name])
            same[1:] &= x[1:] == x[:-1]
            last[name] = float(x[-1])
            low, high = float(x.min()), float(x.max())
            if not np.isfinite(low + high):
                known = np.isfinite(x)
                whole &= known
                n_missing[name] += int(x.size - known.sum())
                low = float(x.min(where=known, initial=np.inf))
                high = float(x.max(where=known, initial=-np.inf))
                # A gap counts as no current, and so as no motion.
                x = np.where(known, x, np.float32(0))
            sizes[name].add(x)
            lowest[name], highest[name] = min(lowest[name], low), max(highest[name], high)
            phases.append(x)
        unknown.push(~whole)
        held.push(same)
        if hilbert is None:
            take(clarke(*phases) - np.complex64(probe.offset_a))
        else:
            take(hilbert.push(phases[0]))
    if hilbert is not None:
        take(hilbert.finish())
    frames.append(motion.finish())
    turns.append(rotation.finish())
    _check_channels(run, names, n_missing, lowest, highest)
    notes = tuple(
        f"{run.path}: column {name} has {n} samples that are no numbers; patterns that touch "
        "them are left out"
        for name, n in n_missing.items()
        if n
    )
    notes += tuple(odd for name in names if (odd := run.doubt(name)))
    notes += tuple(odd for name, size in sizes.items() if (odd := sized(run.path, name, size)))
    joined = join_frames(frames)
    frames.clear()
    evidence = Evidence(
        joined,
        join_rotation(turns),
        has_direction=len(names) == 3,
        fs_hz=fs_hz,
        noise_a=probe.noise_a,
        f_floor_hz=band.f_min_hz,
    )
    gaps = lost_spans(unknown, held, fs_hz)
    return evidence, notes, max(*n_missing.values(), sum(b - a for a, b in gaps)), gaps


def _current(phases: Sequence[Floats]) -> npt.NDArray[np.inexact]:
    if len(phases) == 3:
        return clarke(*(x.astype(np.float32, copy=False) for x in phases))
    return phases[0].astype(np.float32, copy=False)


def _check_channels(
    run: Run,
    names: Sequence[str],
    n_missing: dict[str, int],
    lowest: dict[str, float],
    highest: dict[str, float],
) -> None:
    constant = []
    for name in names:
        if n_missing[name] == run.n_samples:
            msg = (
                f"{run.path}: column {name} holds no number in {run.n_samples} samples; "
                "check the sensor or leave the axis out"
            )
            raise InputError(msg)
        if lowest[name] == highest[name]:
            constant.append(name)
    if constant:
        name = constant[0]
        msg = (
            f"{run.path}: column {name} is constant at {lowest[name]:g} A in all "
            f"{run.n_samples} samples; check the sensor or leave the axis out"
        )
        raise InputError(msg)


def _check_band(run: Run, band: MotionBand) -> None:
    limit = CARRIER_SHARE * run.sampling_rate_hz
    if band.f_min_hz < band.f_max_hz <= limit:
        return
    msg = (
        f"{run.path}: segment.f_max_hz is {band.f_max_hz:g}; it must be above segment.f_min_hz = "
        f"{band.f_min_hz:g} and, at sampling_rate_hz = {run.sampling_rate_hz:g}, at most {limit:g}"
    )
    raise InputError(msg)


def _check_carrier(
    run: Run, channels: AxisChannels, motions: Sequence[Motion], band: MotionBand
) -> None:
    fastest = max((motion.f_max_hz for motion in motions), default=0.0)
    if fastest < 0.97 * band.f_max_hz:
        return
    if band.f_max_hz < CARRIER_SHARE * run.sampling_rate_hz:
        remedy = "raise segment.f_max_hz"
    else:
        remedy = f"record at {2 * run.sampling_rate_hz:g} Hz or faster"
    msg = (
        f"{run.path}: axis {channels.axis}: the carrier reaches {fastest:.4g} Hz or more, the "
        f"limit at sampling_rate_hz = {run.sampling_rate_hz:g} is {band.f_max_hz:g} Hz; {remedy}"
    )
    raise InputError(msg)


def _never_stands(motions: Sequence[Motion], evidence: Evidence) -> bool:
    if len(motions) != 1:
        return False
    n_moving = motions[0].last - motions[0].first
    return n_moving >= (1 - STILL_SHARE) * evidence.frames.strength.size


def _windows(
    run: Run, names: Sequence[str], evidence: Evidence, motion: Motion, config: SegmentConfig
) -> list[Segment]:
    inside = slice(motion.first, motion.last)
    clear = evidence.frames.strength[inside] >= config.threshold_on
    carrier_hz = float(np.median(evidence.frames.ridge_hz[inside][clear]))
    spans = carrier_windows(
        0,
        run.n_samples,
        carrier_hz,
        run.sampling_rate_hz,
        config.windows,
        config.min_window_samples,
    )
    # Without rests there is no lack of frames: only what lasts for a while counts.
    f_max_hz = largest_frequency(
        evidence.frames.ridge_hz[inside][clear].astype(np.float64),
        round(STEADY_S * run.sampling_rate_hz / evidence.frames.step),
    )
    return [
        Segment(a, b, f_max_hz, motion.direction, read_variance(run, names, a, b), kind="window")
        for a, b in spans
    ]


def _refined(
    run: Run,
    names: Sequence[str],
    motions: Sequence[Motion],
    evidence: Evidence,
    offset_a: complex,
    min_motion_s: float,
) -> list[Segment]:
    """Place each motion's boundaries between it and its neighbours to the sample."""
    step = evidence.frames.step
    context = round(CONTEXT_S * run.sampling_rate_hz)
    shortest = min_motion_s * run.sampling_rate_hz
    segments = []
    for i, motion in enumerate(motions):
        start, stop = motion.first * step, min(run.n_samples, motion.last * step)
        before = motions[i - 1].last * step if i else 0
        after = motions[i + 1].first * step if i + 1 < len(motions) else run.n_samples
        first = max(start - context, (before + start) // 2 if i else 0)
        last = min(stop + context, (after + stop) // 2 if i + 1 < len(motions) else run.n_samples)
        block = run.read(names, first, last)
        current = _current([block[name] for name in names])
        if len(names) == 3:
            current = current - np.complex64(offset_a)
        current = np.nan_to_num(current, posinf=0, neginf=0)
        lost_at_speed = motion.f_last_hz > LOST_SHARE * motion.f_max_hz
        refined = refine_boundaries(
            current,
            start - first,
            stop - first,
            run.sampling_rate_hz,
            evidence.noise_a,
            motion.n_to_f_last * step if lost_at_speed else None,
        )
        if refined[1] - refined[0] < shortest:
            continue
        segments.append(
            Segment(
                first + refined[0],
                first + refined[1],
                motion.f_max_hz,
                motion.direction,
                mean_variance([block[name][slice(*refined)] for name in names]),
            )
        )
    return segments
