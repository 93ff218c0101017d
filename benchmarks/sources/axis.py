"""The signal chain on one axis in memory, as the stage runs it on files."""

import numpy as np

from opamc_cli.signal.motion.boundaries import refine_boundaries
from opamc_cli.signal.motion.motion_signal import MotionBand, motion_frames
from opamc_cli.signal.motion.noise import noise_level
from opamc_cli.signal.motion.rotation import RotationStream, join_rotation
from opamc_cli.signal.motion.segmentation import Evidence, MotionRule, find_motions
from opamc_cli.signal.transform.analytic import clarke, temporal_fine_structure


def gather(z, fs_hz=2048.0, step=16, has_direction=True):
    noise_a = noise_level(z)
    rotation = RotationStream(step)
    return Evidence(
        motion_frames(temporal_fine_structure(z, 3 * noise_a), MotionBand(), fs_hz, step),
        join_rotation([rotation.push(z), rotation.finish()]),
        has_direction,
        fs_hz,
        noise_a,
        MotionBand().f_min_hz,
    )


def segments_of(phases, fs_hz=2048.0, step=16):
    """Refined (start, stop) and coarse motions of three phases."""
    z = clarke(*phases)
    evidence = gather(z, fs_hz, step)
    motions = find_motions(evidence, MotionRule())
    spans = []
    for i, motion in enumerate(motions):
        start, stop = motion.first * step, motion.last * step
        before = (motions[i - 1].last * step + start) // 2 if i else 0
        after = z.size
        if i + 1 < len(motions):
            after = (motions[i + 1].first * step + stop) // 2
        lost = motion.f_last_hz > 0.25 * motion.f_max_hz
        refined = refine_boundaries(
            z[before:after],
            start - before,
            stop - before,
            fs_hz,
            evidence.noise_a,
            motion.n_to_f_last * step if lost else None,
        )
        spans.append((before + refined[0], before + refined[1]))
    return spans, motions


def errors_s(spans, intervals, fs_hz=2048.0):
    """Signed errors of starts and stops, s, shape (n, 2)."""
    return (np.array(spans) - np.array(intervals)) / fs_hz
