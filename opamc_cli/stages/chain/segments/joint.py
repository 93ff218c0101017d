"""Segments of an axis whose drive reports torque current: by the joint's velocity."""

import numpy as np
import numpy.typing as npt

from opamc_cli.config.models import JointConfig, SegmentConfig
from opamc_cli.errors import InputError
from opamc_cli.signal.motion.reported import (
    FEWEST_SAMPLES,
    JointMotion,
    find_joint_motions,
    hides_motions,
    motor_frequency,
    quiet_velocity,
)
from opamc_cli.signal.motion.signs import lacks_sign
from opamc_cli.signal.motion.windows import carrier_windows
from opamc_cli.signal.plausible.quality import LIMITS, clipped_share
from opamc_cli.stages.chain.segments.rows import (
    STILL_SHARE,
    AxisSegments,
    Flags,
    Segment,
    lost,
    lost_spans,
    make_rows,
    mean_variance,
)
from opamc_cli.stages.recordings.beyond import limited
from opamc_cli.stages.recordings.mistaken import missing
from opamc_cli.storage.runs.columns import AxisChannels
from opamc_cli.storage.runs.run import Run

USUAL_GEAR_RATIO = 100.0
"""Stands in for an unknown ratio in f_d,max, which motions are then compared by: strain wave gears
of robot arms have 50 to 160. Delays are chosen by the current itself, see stage `identify`."""

SLOWER = 0.5
"""Share of samples at which a channel has numbers: with fewer it is logged at a lower rate."""


def joint_segments(
    run: Run, channels: AxisChannels, config: SegmentConfig, joint: JointConfig
) -> AxisSegments:
    """Find the motions of an axis from its velocity, or from its position if there is none.

    So, too, where the velocity's noise hides them: many drives difference a coarse angle.

    Raises
    ------
    InputError
        If there is neither velocity nor position, or the current holds no numbers.
    """
    name = channels.current
    assert name is not None
    velocity, source = _velocity(run, channels)
    current = run.read([name])[name]
    known = current[np.isfinite(current)]
    if not known.size:
        msg = (
            f"{run.path}: column {name} holds no number in {run.n_samples} samples; "
            "check the drive's log or leave the axis out"
        )
        raise InputError(msg)
    whole = np.isfinite(current)
    for column in filter(None, (channels.position, channels.velocity)):
        logged = np.isfinite(run.read([column])[column])
        if np.mean(logged) > SLOWER:
            whole &= logged
    unknown, held = Flags(), Flags()
    unknown.push(~whole)
    # at its limit, or at 0, a current is held by no logger
    odd = (current != 0) & (current != np.nanmax(current)) & (current != np.nanmin(current))
    held.push((np.diff(current, prepend=np.nan) == 0) & odd)
    gaps = lost_spans(unknown, held, run.sampling_rate_hz)
    by_speed = source == channels.velocity
    speed_of, kind = (source, "velocity") if by_speed else (f"{source} (its speed)", "position")
    beyond = [
        run.doubt(name),
        limited(run.path, name, known, LIMITS[run.info.current_unit]),
        limited(run.path, speed_of, velocity, LIMITS[kind]),
    ]
    motions = find_joint_motions(
        velocity,
        run.sampling_rate_hz,
        config.min_motion_s,
        config.min_still_s,
        config.min_speed_rad_s,
    )
    if motions and known.min() == known.max():
        msg = (
            f"{run.path}: column {name} is constant at {known[0]:g} {run.info.current_unit} while "
            "the joint moves; check the drive's log or leave the axis out"
        )
        raise InputError(msg)
    notes = [note for note in beyond if note]
    notes += missing(run, channels.position) if channels.position else []
    if known.size < current.size:
        notes.append(
            f"{run.path}: column {name} has {current.size - known.size} samples that are no "
            "numbers; patterns that touch them are left out"
        )
    share = clipped_share(current) if motions else 0.0
    if share > 0:
        notes.append(
            f"{run.path}: column {name} looks clipped: {share:.1%} of its samples sit at its limit"
        )
    unsigned = lacks_sign(current, velocity) if motions else False
    if unsigned or unsigned is None:
        what = (
            "it is taken for a modulus, and a model of the joint gives it the speed's"
            if unsigned
            else "the joint does not rest long enough to tell a modulus from a load; it is taken "
            "as it is"
        )
        notes.append(f"{run.path}: column {name} keeps its sign though the joint reverses: {what}")
    segments = _segments(run, channels, current, motions, config, joint)
    shortest_s = max(config.min_motion_s, FEWEST_SAMPLES / run.sampling_rate_hz)
    return AxisSegments(
        run.name,
        make_rows(run, channels, segments, "reported", gaps),
        tuple(notes),
        f"axis {channels.axis}: the joint reaches {float(np.nanmax(np.abs(velocity))):.3g} rad/s, "
        f"{config.min_speed_rad_s:g} is motion where it lasts for {shortest_s:.2g} s",
        lost(channels.axis, 1 - known.size / current.size),
        max(int(whole.size - whole.sum()), sum(b - a for a, b in gaps)),
    )


def _segments(
    run: Run,
    channels: AxisChannels,
    current: npt.NDArray[np.floating],
    motions: list[JointMotion],
    config: SegmentConfig,
    joint: JointConfig,
) -> list[Segment]:
    def frequency(motion: JointMotion) -> float:
        ratio = joint.ratio_of(channels.axis) or USUAL_GEAR_RATIO
        return motor_frequency(motion.speed_rad_s, ratio, joint.poles_of(channels.axis))

    never_stands = (
        len(motions) == 1
        and motions[0].stop - motions[0].start >= (1 - STILL_SHARE) * run.n_samples
    )
    if not never_stands:
        return [
            Segment(
                m.start,
                m.stop,
                frequency(m),
                m.direction,
                mean_variance([current[m.start : m.stop]]),
            )
            for m in motions
        ]
    only = motions[0]
    # Whole revolutions of the motor where they are known and fit; else equal parts.
    carriers = (frequency(only), run.sampling_rate_hz)
    for carrier_hz in carriers:
        spans = carrier_windows(
            only.start,
            only.stop,
            carrier_hz,
            run.sampling_rate_hz,
            config.windows,
            config.min_window_samples,
        )
        if spans:
            break
    return [
        Segment(a, b, frequency(only), only.direction, mean_variance([current[a:b]]), kind="window")
        for a, b in spans
    ]


def _velocity(run: Run, channels: AxisChannels) -> tuple[npt.NDArray[np.float64], str]:
    """Return the joint's speed and the column it is of.

    A position's where the logged speed is noise, unless that is noise, too, or stands still.
    """
    # One column at the drive's rate: 8 h at 1 kHz are 230 MB.
    velocity, source = np.zeros(0), channels.velocity
    if source is not None:
        velocity = run.read([source])[source].astype(np.float64)
    if channels.position is not None and (source is None or hides_motions(velocity)):
        by_place = quiet_velocity(
            run.read([channels.position])[channels.position], run.sampling_rate_hz
        )
        if source is None or (np.nan_to_num(by_place).any() and not hides_motions(by_place)):
            velocity, source = by_place, channels.position
    if source is None:
        axis = channels.axis
        msg = (
            f"{run.path}: axis {axis} has axis{axis}_current only; its motions need "
            f"axis{axis}_velocity or axis{axis}_position, or phase currents axis{axis}_a, _b, _c"
        )
        raise InputError(msg)
    if not np.isfinite(velocity).any():
        msg = f"{run.path}: column {source} holds no number; check the drive's log"
        raise InputError(msg)
    return velocity, source
