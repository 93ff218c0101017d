"""One axis of a run, as a model of the joint needs it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from opamc_cli.config.reading import shown
from opamc_cli.errors import InputError
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.signal.motion.reported import unwrapped, velocity_from_position
from opamc_cli.signal.motion.signs import (
    another_motion,
    friction_drives,
    lacks_sign,
    signed_by_speed,
    speed_ratio,
)
from opamc_cli.signal.plausible.quality import LIMITS, Size, strided_speed
from opamc_cli.stages.recordings.beyond import limited
from opamc_cli.stages.recordings.sessions import started
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import Array
from opamc_cli.storage.schemas.channels import LOGGED, PHASES, quantity_of

SAME_RATIO = 0.03
"""By which a speed over the position's rate of change may miss the ratio of two units."""

MOST_MISSING = 0.5
"""Share of a channel's samples that may lack a number: beyond it more is bridged than recorded."""

FIELDS = {"current": "current_a"} | {name: channel.field for name, channel in LOGGED.items()}
"""What `Recording` calls a channel."""


def axes_of(runs: Sequence[Run]) -> list[int]:
    """Axes that every run holds."""
    common = set(runs[0].axes)
    for run in runs[1:]:
        common &= set(run.axes)
    return sorted(common)


def read_recording(run: Run, axis: int, start: int = 0, stop: int | None = None) -> Recording:
    """Read samples start..stop (half-open; all by default) of one axis of a run, as logged.

    Raises
    ------
    InputError
        If the run has no such axis, neither a signed current nor two phases, or no number in most
        samples of what is needed.
    """
    channels = run.channels(axis)
    run.check_time()
    # Two phases tell the third, but a drive's own current is better than a sum.
    phased = len(channels.phases) >= (2 if channels.current is None else 3)
    if channels.current is None and not phased:
        msg = (
            f"{run.path}: axis {axis} has {len(channels.phases)} phase current(s) and no "
            f"axis{axis}_current; a model needs the signed current, or two phases or three"
        )
        raise InputError(msg)
    if not phased and channels.position is None and channels.velocity is None:
        msg = (
            f"{run.path}: axis {axis} has no axis{axis}_position, no axis{axis}_velocity and not "
            "three phases; log one of them, a model needs the motion"
        )
        raise InputError(msg)
    named = {
        field: channels.columns[name]
        for name, field in FIELDS.items()
        if name in channels.columns and not (phased and name == "current")
    }
    samples = run.read([*named.values(), *(channels.phases if phased else ())], start, stop)
    arrays: dict[str, Any] = {
        key: np.asarray(samples[name], dtype=np.float64) for key, name in named.items()
    }
    phases = None
    if phased:
        phases = _all_three({name: samples[name] for name in channels.phases})
    for channel, values in samples.items():
        _check_channel(run, channel, values)
        if quantity_of(channel) == "current":
            limited(run.path, channel, values, LIMITS[run.info.current_unit])
        elif quantity_of(channel) == "velocity":
            limited(run.path, channel, values, LIMITS["velocity"])
        elif quantity_of(channel) == "position":
            speed = strided_speed(values, run.sampling_rate_hz)
            limited(run.path, f"{channel} (its speed)", speed, LIMITS["position"])
    warmth = Size(LIMITS["temperature"])
    warmth.add(arrays.get("temperature_c", np.empty(0)))
    if warmth.is_impossible:  # As if not logged, which `mistaken` says.
        del arrays["temperature_c"]
    if "position_rad" in arrays:
        arrays["position_rad"] = unwrapped(arrays["position_rad"])
    _check_units(run, axis, arrays.get("position_rad"), arrays.get("velocity_rad_s"))
    return Recording(
        name=run.name,
        rate_hz=run.sampling_rate_hz,
        phases_a=phases,
        started_s=_seconds(run),
        **arrays,
    )


def _all_three(phases: Mapping[str, Array]) -> Array:
    """Stack phase currents by their columns' last letters, (n, 3); they sum to zero at the motor.

    A motor has no neutral conductor, and many drives sense two phases alone.
    """
    known = {name[-1]: np.asarray(values, dtype=np.float64) for name, values in phases.items()}
    third = -np.sum(list(known.values()), axis=0)
    return np.stack([known.get(name, third) for name in PHASES], axis=1)


def positions_beside(run: Run, axis: int) -> dict[int, Array]:
    """Read the logged positions of a run's other axes; those that mostly lack a number are none."""
    names = {other: name for other, name in run.positions.items() if other != axis}
    samples = run.read(list(names.values()))
    found = {other: unwrapped(samples[name]) for other, name in names.items()}
    return {
        other: values
        for other, values in found.items()
        if np.mean(~np.isfinite(values)) <= MOST_MISSING
    }


def gaps(run: Run, axis: int, recording: Recording) -> list[str]:
    """Say how much of a recording is left out because a channel lacks a number."""
    channels = (
        recording.current_a,
        recording.phases_a,
        recording.position_rad,
        recording.velocity_rad_s,
    )
    missing = np.zeros(recording.size, dtype=bool)
    for values in channels:
        if values is not None:
            missing |= ~np.isfinite(values).reshape(recording.size, -1).all(axis=1)
    count = np.count_nonzero(missing)
    said = [
        f"{run.path}: column {name} mostly holds no number: what axis {other} asks of axis {axis} "
        "is not looked for"
        for other, name in run.positions.items()
        if other not in (axis, *recording.others_rad)
    ]
    if count:
        said.append(f"{run.path}: {count} of {missing.size} samples lack a number and are left out")
    return said


def interpolated(recording: Recording, least_hz: float) -> Recording:
    """Return a slow recording with samples between its own, by straight lines.

    What a model of the joint looks at is laid out for drives that log 100 times a second and more.
    Nothing is learned between the samples; sessions, not samples, are what is compared.
    """
    factor = math.ceil(least_hz / recording.rate_hz)
    if factor < 2 or recording.current_a is None:
        return recording
    place = np.arange(len(recording.current_a))
    fine = np.arange((len(place) - 1) * factor + 1) / factor

    def between(values: Array | None) -> Array | None:
        return None if values is None else np.interp(fine, place, values)

    finer: dict[str, Any] = {field: between(getattr(recording, field)) for field in FIELDS.values()}
    return replace(recording, rate_hz=recording.rate_hz * factor, **finer)


def with_signs(recordings: Sequence[Recording]) -> list[Recording]:
    """Give reported currents the speed's sign where most of a joint's recordings lack one.

    A drive logs moduli always or never, but under a load a current may happen to keep its sign in
    one recording: of eight simulated arms' axes with six or seven each three did so in one or two.
    """
    currents = [one for one in recordings if one.current_a is not None]
    lacking = [one for one in currents if _lacks_sign(one)]
    if 2 * len(lacking) <= len(currents):
        return list(recordings)
    return [_signed(one) for one in recordings]


def reported(recordings: Sequence[Recording]) -> list[tuple[Array, Array]]:
    """Return each recording's reported current and position; none where one lacks either."""
    logged = [(one.current_a, one.position_rad) for one in recordings if one.phases_a is None]
    pairs = [(x, q) for x, q in logged if x is not None and q is not None]
    return pairs if len(pairs) == len(recordings) else []


def turned_round(recordings: Sequence[Recording]) -> list[Recording]:
    """Take reported currents with the opposite sign."""
    currents = (x for x, _ in reported(recordings))
    return [replace(one, current_a=-x) for one, x in zip(recordings, currents, strict=True)]


def resisted(recordings: Sequence[Recording]) -> list[Recording]:
    """Turn a joint's reported currents round where its friction would drive it.

    They were logged with the opposite sign of the motion: more friction then looks like less.
    """
    pairs = reported(recordings)
    opposite = bool(pairs) and friction_drives(pairs, recordings[0].rate_hz)
    return turned_round(recordings) if opposite else list(recordings)


def _velocity(recording: Recording) -> Array | None:
    if recording.velocity_rad_s is not None or recording.position_rad is None:
        return recording.velocity_rad_s
    return velocity_from_position(recording.position_rad, recording.rate_hz)


def _lacks_sign(recording: Recording) -> bool:
    velocity = _velocity(recording)
    if velocity is None or recording.current_a is None:
        return False
    return bool(lacks_sign(recording.current_a, velocity))


def _signed(recording: Recording) -> Recording:
    velocity = _velocity(recording)
    if velocity is None or recording.current_a is None:
        return recording
    return replace(recording, current_a=signed_by_speed(recording.current_a, velocity))


def _check_channel(run: Run, name: str, values: Array) -> None:
    known = np.isfinite(values)
    # a slow temperature is logged now and then
    most = 1.0 if quantity_of(name) == "temperature" else MOST_MISSING
    if not known.any() or np.mean(~known) > most:
        where = f" in {np.mean(~known):.0%} of its samples" if known.any() else ""
        msg = (
            f"{run.path}: column {name} holds no number{where}; check the sensor or leave the "
            "column out"
        )
        raise InputError(msg)
    if quantity_of(name) == "current" and np.ptp(values[known]) == 0:
        level = f"{float(values[known][0]):g} {run.info.current_unit}"
        msg = (
            f"{run.path}: column {name} is constant at {level} in all {len(values)} samples; "
            "check the sensor"
        )
        raise InputError(msg)


def _check_units(run: Run, axis: int, position: Array | None, velocity: Array | None) -> None:
    """Refuse a position and a speed that are the same motion in different units, or signs."""
    if position is None or velocity is None:
        return
    if another_motion(position, velocity, run.sampling_rate_hz):
        msg = (
            f"{run.path}: axis{axis}_velocity is not the rate of change of axis{axis}_position: "
            "is one of them another joint's? Correct the map of opamc ingest"
        )
        raise InputError(msg)
    ratio = speed_ratio(position, velocity, run.sampling_rate_hz)
    for units in fitting_units(ratio or 1.0):
        name = "position" if units["position"] != "rad" else "velocity"
        asked = next(iter(LOGGED[name].units))
        msg = (
            f"{run.path}: axis{axis}_velocity is {ratio:.3g} times the rate of change of "
            f"axis{axis}_position: axis{axis}_{name} seems to be in {units[name]}; convert it to "
            f"{asked}, or name its unit in the map of opamc ingest"
        )
        raise InputError(msg)
    if ratio is not None and ratio < 0:
        msg = (
            f"{run.path}: axis{axis}_velocity is {ratio:.3g} times the rate of change of "
            f"axis{axis}_position: one of them has the wrong sign; correct the map of opamc ingest"
        )
        raise InputError(msg)


def fitting_units(
    ratio: float, position: str = "rad", velocity: str = "rad/s"
) -> list[dict[str, str]]:
    """Return units, one of them as it was taken, in which a speed would be its position's.

    Parameters
    ----------
    ratio : float
        Of the speed to the position's rate of change, 1 where they agree.
    position, velocity : str
        Units that both were taken to be in.

    Examples
    --------
    >>> fitting_units(57.3, "deg", "rad/s")
    [{'position': 'rad', 'velocity': 'rad/s'}, {'position': 'deg', 'velocity': 'deg/s'}]
    """
    taken = {"position": position, "velocity": velocity}
    if abs(ratio - 1.0) < SAME_RATIO:
        return []
    return [
        taken | {name: unit}
        for name, times in (("position", ratio), ("velocity", 1.0 / ratio))
        for unit, one in LOGGED[name].units.items()
        if abs(one.factor / LOGGED[name].units[taken[name]].factor / times - 1.0) < SAME_RATIO
    ]


def _seconds(run: Run) -> float | None:
    if run.info.started_at is None:
        return None
    time = started(run.info.started_at)
    if time is None:
        msg = (
            f"{run.path}: started_at is {shown(run.info.started_at)}, an ISO 8601 time is needed; "
            "correct it or leave it out"
        )
        raise InputError(msg)
    return time.timestamp()
