"""From recordings to a track: motion by local polynomials, torque current with its sign."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from opamc_cli.joint.motion.phases.following import follow_phases
from opamc_cli.joint.motion.phases.half_turns import lost, without_slips
from opamc_cli.joint.motion.phases.phase_angle import PhaseAngle
from opamc_cli.joint.motion.phases.torque_axis import side_of_torque, torque_current
from opamc_cli.joint.motion.track import Bools, Floats, Joint, Track, joined
from opamc_cli.signal.cycles.period import cycle_length
from opamc_cli.signal.motion.smoothing import (
    CORNER_WINDOW,
    SHORTEST_WINDOW,
    averaging_kernel,
    blurred,
    bridged_path,
    clear_of_corners,
    derivatives,
    filled,
    less_late,
    measurement_noise,
    noise_gain,
    quietened,
    smoothing_window,
    taken_noise_gain,
    unstepped,
    widened,
)
from opamc_cli.signal.transform.angle_filter import NOISE_SHARE

LEAST_CORNER = 0.05 / 3
"""Share of the acceleration; three times that is lacking at a corner of a path without noise."""
SLOWEST_SHARE = 0.02
"""Samples below this share of the top speed do not count: their direction is not certain. Another
joint that goes less than this share of the way beside is held still."""
STEADY = 0.9
"""Share of samples with current over the angle's window, from which on its speed is no guess."""
LOGGED = ("current_a", "phases_a", "position_rad", "velocity_rad_s", "temperature_c", "turned")


@dataclass(frozen=True)
class Recording:
    """One joint's samples of one run, as they were logged."""

    name: str
    """Name of the run."""
    rate_hz: float
    """Sampling rate."""
    current_a: Floats | None = None
    """Reported torque current, signed; (n,) or None."""
    phases_a: Floats | None = None
    """Phase currents; (n, 3) or None."""
    position_rad: Floats | None = None
    velocity_rad_s: Floats | None = None
    temperature_c: Floats | None = None
    """With `position_rad`, `velocity_rad_s`: joint side; (n,) or None."""
    turned: Floats | None = None
    """Of phases alone, -1 where they lie on the other side of the torque axis; (n,) or None."""
    started_s: float | None = None
    """Start of the run on a clock common to all runs."""
    payload_kg: float | None = None
    """What the run's metadata say that the arm carries."""
    others_rad: Mapping[int, Floats] = field(default_factory=dict)
    """Positions of the arm's other joints by axis, where they are logged; (n,) each."""

    @property
    def size(self) -> int:
        """Number of samples."""
        logged = (self.current_a, self.phases_a, self.position_rad)
        return next((len(values) for values in logged if values is not None), 0)

    def cut(self, span: slice) -> "Recording":
        """Return a part of its samples."""
        logged = {name: getattr(self, name) for name in LOGGED}
        parts = {name: one[span] for name, one in logged.items() if one is not None}
        others = {axis: values[span] for axis, values in self.others_rad.items()}
        return replace(self, **parts, others_rad=others)


WINDOWS_S = (0.01, 0.02, 0.05, 0.12)
"""Windows that compete with the one that the noise of the path asks for: where the drive itself
moves a joint that should go steadily, the acceleration that the noise would smooth away is real."""


@dataclass(frozen=True)
class Smoothing:
    """How a motion is differentiated: over which window, and from a logged speed or a position."""

    window_s: float
    from_velocity: bool


def smoothings(recordings: Sequence[Recording]) -> list[Smoothing]:
    """Ways to differentiate recordings beside the one that the noise of each path asks for."""
    if any(recording.position_rad is None for recording in recordings):
        return []
    speeds = all(recording.velocity_rad_s is not None for recording in recordings)
    rate = recordings[0].rate_hz
    windows = {max(int(window * rate) | 1, SHORTEST_WINDOW): window for window in WINDOWS_S}
    ways = [False, True] if speeds else [False]
    shortest = min(recording.size for recording in recordings)
    kept = [window for samples, window in windows.items() if samples <= shortest]
    return [Smoothing(window, way) for window in kept for way in ways]


@dataclass(frozen=True)
class Motion:
    """Smoothed motion of one recording."""

    position_rad: Floats
    velocity: Floats
    acceleration: Floats
    """With `position_rad`, `velocity`: smoothed; s of shape (n,)."""
    window: int
    """Samples over which they are smooth."""
    velocity_noise: float
    """Standard deviation of the speed's noise."""
    kernel: Floats
    """Moving average that the acceleration has gone through."""
    blur: Floats | None = None
    """What the acceleration would gain by a third and three times the window; (n, 2) or None."""
    taken_noise: float = 0.0
    """Standard deviation of noise in what the window would take a second time; 0: not known."""
    evenly_smooth: bool = False
    """True where position and speed have gone through the same."""

    def later(self, lag_s: float, rate_hz: float) -> "Motion":
        """Return the motion delayed by a fraction of a sample."""
        time_s = np.arange(self.velocity.size) / rate_hz
        names = ("position_rad", "velocity", "acceleration")
        late = {name: np.interp(time_s - lag_s, time_s, getattr(self, name)) for name in names}
        return replace(self, **late)


def motion_from_position(
    position_rad: Floats,
    velocity_rad_s: Floats | None,
    rate_hz: float,
    smoothing: Smoothing | None = None,
) -> Motion:
    """Position, speed and acceleration by Savitzky-Golay filters of the shortest clean window.

    A logged speed, (n,) beside the position, is used where it agrees and is the cleaner one.
    """
    if smoothing is None:
        window = smoothing_window(position_rad, rate_hz, derivative=2)
    else:
        window = max(int(smoothing.window_s * rate_hz) | 1, SHORTEST_WINDOW)
    motion = _smoothed(position_rad, rate_hz, window, 2)
    asked = smoothing is not None and smoothing.from_velocity
    if velocity_rad_s is not None and (asked or (smoothing is None and window > SHORTEST_WINDOW)):
        size = float(np.sqrt(np.mean(motion.velocity**2)))
        speed = less_late(velocity_rad_s, motion.velocity, motion.acceleration, rate_hz)
        agrees = size > 0 and float(np.std(speed - motion.velocity)) < 0.1 * size
        own = window if asked else smoothing_window(speed, rate_hz, derivative=1)
        if agrees and (asked or own < window):
            return replace(_smoothed(speed, rate_hz, own, 1), position_rad=motion.position_rad)
    return motion


def motion_from_velocity(velocity_rad_s: Floats, rate_hz: float) -> Motion:
    """Position by the trapezoidal rule from zero, acceleration by a local polynomial."""
    window = smoothing_window(velocity_rad_s, rate_hz, derivative=1)
    motion = _smoothed(velocity_rad_s, rate_hz, window, 1)
    steps = 0.5 * (motion.velocity[1:] + motion.velocity[:-1]) / rate_hz
    return replace(motion, position_rad=np.concatenate([[0.0], np.cumsum(steps)]))


def _smoothed(path: Floats, rate_hz: float, window: int, derivative: int) -> Motion:
    """Motion by local polynomials of a position (derivative 2), or of a speed (1): no position."""
    values = [derivatives(path, rate_hz, window, order) for order in range(derivative + 1)]
    values[-1] = quietened(path, values[-1], rate_hz, window, derivative)
    noise = measurement_noise(path)
    return Motion(
        position_rad=values[0],
        velocity=values[-2],
        acceleration=values[-1],
        window=window,
        velocity_noise=noise * noise_gain(rate_hz, window, derivative - 1),
        kernel=averaging_kernel(window, derivative),
        blur=blurred(path, values[-1], rate_hz, window, derivative),
        taken_noise=noise * taken_noise_gain(rate_hz, window, derivative),
    )


def direction_of(motion: Motion) -> Floats:
    """Return the direction of motion: -1, 1, and 0 where noise or rest leave it open."""
    speeds = np.abs(motion.velocity)
    slowest = max(1e-3 * float(np.quantile(speeds, 0.98)), 5 * motion.velocity_noise, 1e-9)
    return np.where(speeds > slowest, np.sign(motion.velocity), 0.0)


def moving_samples(motion: Motion, usable: Bools) -> Bools:
    """Tell the samples in motion, (n,): fast enough, half a window from any reversal.

    Of those whose readings are finite, the `usable`.
    """
    speeds = np.abs(motion.velocity)
    direction = direction_of(motion)
    half = motion.window // 2
    uncertain = direction == 0
    uncertain[1:] |= direction[1:] != direction[:-1]
    moving: Bools = usable & ~widened(uncertain, half)
    moving &= speeds > SLOWEST_SHARE * float(np.quantile(speeds, 0.98))
    moving[:half] = False
    moving[speeds.size - half :] = False
    return moving


def build_track(
    recordings: list[Recording], joint: Joint, smoothing: Smoothing | None = None
) -> Track:
    """Put recordings of one joint on one grid, with smoothed motion and torque current.

    Groups are not set yet. All are at one rate, each with a signed current or three phases: a
    ValueError is raised where one holds neither three phases nor a current with position or speed.
    """
    rate = recordings[0].rate_hz
    beside = moving_beside(recordings)
    pieces = [_one(recording, joint, smoothing, beside) for recording in recordings]
    first, clock, times = recordings[0].started_s, 0.0, []
    for recording, piece in zip(recordings, pieces, strict=True):
        if recording.started_s is not None and first is not None:
            clock = max(recording.started_s - first, clock)
        times.append(clock + piece.time_s)
        clock += piece.size / rate
    return replace(joined(pieces), time_s=np.concatenate(times))


def moving_beside(recordings: Sequence[Recording]) -> tuple[int, ...]:
    """Axes that every recording holds; none where none of them moves."""
    common = set.intersection(*(set(recording.others_rad) for recording in recordings))
    moves = any(
        np.ptp(filled(one.others_rad[axis])) > SLOWEST_SHARE * np.ptp(filled(one.position_rad))
        for one in recordings
        for axis in common
        if one.position_rad is not None
    )
    return tuple(sorted(common)) if moves else ()


def _one(
    recording: Recording, joint: Joint, smoothing: Smoothing | None, beside: tuple[int, ...]
) -> Track:
    rate, n = recording.rate_hz, recording.size
    ratio, poles = joint.gear_ratio, joint.pole_pairs
    turns = poles * ratio if poles and ratio else None
    logged = recording.position_rad is not None or recording.velocity_rad_s is not None
    phases, phase_angle = recording.phases_a, None
    usable = np.ones(n, dtype=bool)
    if phases is not None:
        usable &= np.isfinite(phases).all(axis=1)
        phases = np.stack([filled(phases[:, k]) for k in range(3)], axis=1)
        phase_angle = follow_phases(phases, rate)
    if logged:
        motion, known = _logged_motion(recording, smoothing)
        usable &= known
    elif phase_angle is not None:
        steady = uniform_filter1d(1.0 * phase_angle.strong, phase_angle.window) > STEADY
        period = cycle_length(phase_angle.velocity_rad_s, known=steady)
        phase_angle = without_slips(phase_angle, steady, period, rate)
        motion = _scaled(phase_angle, 1.0 if turns is None else 1.0 / turns)
        # Where there is too little current to tell an angle, the motion is a guess.
        usable &= ~widened(lost(phase_angle.strong, rate), phase_angle.window) & phase_angle.clear
    else:
        msg = "a recording needs a position, a velocity or three phase currents"
        raise ValueError(msg)

    electrical = None
    seen_turns: tuple[float, ...] = ()
    if phases is not None and phase_angle is not None:
        electrical = phase_angle.angle_rad
        if logged:
            electrical, lag_s, seen_turns = phase_angle.aligned_with(
                motion.position_rad, motion.velocity, rate
            )
            if abs(lag_s) * rate <= 1:
                # Sensors' filters and channels read in turn come to this, no clock does.
                motion = motion.later(lag_s, rate)
        current = torque_current(phases, electrical, motion.velocity, motion.position_rad)
        if electrical is phase_angle.angle_rad:
            side = side_of_torque(current, phase_angle, rate)
            side = side if recording.turned is None else side * recording.turned
            current = side * current
            # The other side is half an electrical turn away.
            electrical = electrical + np.where(side < 0, np.pi, 0.0)
    elif recording.current_a is not None:
        usable &= np.isfinite(recording.current_a)
        current = filled(recording.current_a)
        electrical = None if turns is None else turns * motion.position_rad
    else:
        msg = "a recording needs a signed current or three phase currents"
        raise ValueError(msg)

    scaled = logged or turns is not None
    machine, angle_kind = motion.position_rad, "joint" if scaled else "electrical"
    if scaled and ratio:
        machine, angle_kind = ratio * motion.position_rad, "motor"
    elif electrical is not None and poles:
        machine, angle_kind = electrical / poles, "motor"
    elif electrical is not None and phases is not None:
        machine, angle_kind = electrical, "electrical"
    temperature = recording.temperature_c
    if temperature is not None and not np.isfinite(temperature).any():
        temperature = None
    others = None
    if beside and logged:
        paths = [bridged_path(recording.others_rad[axis], rate) for axis in beside]
        others = np.stack(
            [derivatives(path, rate, motion.window, order) for order in range(3) for path in paths]
        ).T
    channels = {
        "position": True,
        "logged": logged,
        "scale": scaled,
        "phases": phases is not None,
        "electrical": electrical is not None,
        "temperature": temperature is not None,
        "others": others is not None,
    }
    moving = moving_samples(motion, usable)
    # Of vibration the window takes a little everywhere.
    uncertain = max(motion.taken_noise, LEAST_CORNER * float(np.std(motion.acceleration)))
    kernel = max(motion.kernel, averaging_kernel(CORNER_WINDOW, 2), key=len)
    clear = clear_of_corners(motion.acceleration, current, moving, kernel, uncertain)
    if motion.window <= CORNER_WINDOW:
        moving &= clear  # The coarse grid has no counterpart for so short an average.
    return Track(
        rate_hz=rate,
        bounds=((0, n),),
        time_s=np.arange(n) / rate,
        run_time_s=np.arange(n) / rate,
        current_a=current,
        position_rad=motion.position_rad,
        velocity=motion.velocity,
        acceleration=motion.acceleration,
        machine_angle_rad=machine,
        angle_kind=angle_kind,
        direction=direction_of(motion),
        moving=moving,
        clear=clear,
        group=np.full(n, -1, dtype=np.int64),
        load_a=np.zeros(n),
        model_a=np.zeros(n),
        joint=joint,
        channels=frozenset(name for name, known in channels.items() if known),
        temperature_c=None if temperature is None else unstepped(filled(temperature)),
        payload_kg=None if recording.payload_kg is None else np.full(n, recording.payload_kg),
        electrical_rad=electrical,
        kernel=motion.kernel,
        evenly_smooth=motion.evenly_smooth,
        blur=motion.blur,
        others=others,
        other_axes=beside,
        guessed_s=() if logged or phase_angle is None else phase_angle.guessed_s,
        turns=seen_turns,
    )


def _logged_motion(recording: Recording, smoothing: Smoothing | None) -> tuple[Motion, Bools]:
    """Motion of a logged position or, without one, of a logged speed, and where that is known."""
    position, speed = recording.position_rad, recording.velocity_rad_s
    rate = recording.rate_hz
    if position is None:
        assert speed is not None
        return motion_from_velocity(bridged_path(speed, rate), rate), np.isfinite(speed)
    whole = None if speed is None else bridged_path(speed, rate)
    motion = motion_from_position(bridged_path(position, rate), whole, rate, smoothing)
    return motion, np.isfinite(position)


def _scaled(phase_angle: PhaseAngle, scale: float) -> Motion:
    return Motion(
        phase_angle.angle_rad * scale,
        phase_angle.velocity_rad_s * scale,
        phase_angle.acceleration_rad_s2 * scale,
        phase_angle.window,
        0.0,
        phase_angle.kernel,
        blur=phase_angle.blur * scale,
        # So the bandwidth was chosen.
        taken_noise=NOISE_SHARE * scale * float(np.std(phase_angle.acceleration_rad_s2)),
        evenly_smooth=True,
    )
