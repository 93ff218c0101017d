"""Recordings in which channels are of another joint, clock, scale, or lack samples: it is said."""

import numpy as np

from opamc_cli.errors import InputError
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.signal.plausible.continuity import leaps
from opamc_cli.signal.plausible.quality import (
    LIMITS,
    Size,
    clipped_share,
    held_for,
    strided_speed,
)
from opamc_cli.signal.plausible.rigid import DRIFTED_S, follows, lags, other_scale
from opamc_cli.signal.plausible.spikes import spikes
from opamc_cli.stages.recordings.beyond import limited
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import Array
from opamc_cli.storage.schemas.channels import PHASES

UNITS = {180 / np.pi: "rad taken for degrees", np.pi / 180: "degrees taken for rad"} | {
    2 * np.pi: "turns taken for rad",
    0.5 / np.pi: "rad taken for turns",
}
"""Times by which an angle is too small, and what it then probably is."""
NEARLY = 0.2
"""By which a scale may miss one of them: gravity does not tell it better over a short travel."""
WRAPS, WRAPS_LIKE = {360.0: "degrees", 1.0: "turns"}, 0.05
CLIPPED, MOVING = 0.01, 0.01
"""Share of a current's samples in motion at its limit from which on it is said, and of the largest
speed from which on a joint moves: one that rests may hold its largest load in a converter's step.
"""
MOST_LOOKED, STRETCHES = 1 << 20, 4
"""Samples of an angle whose steps are looked at, in four stretches: of eight hours enough."""


def mistaken(run: Run, axis: int, recording: Recording) -> list[str]:
    """Say what is odd about one axis of a run that `read_recording` did not refuse.

    Raises
    ------
    InputError
        If the angle leaps back by one size that is no turn.
    """
    notes = [
        *_sizes(run, axis, recording),
        *_clipped(run, axis, recording),
        *_held(run, axis, recording),
        *_spiked(run, axis, recording),
        *missing(run, f"axis{axis}_position"),
        *_twice(run, axis, recording),
    ]
    x, q = recording.current_a, recording.position_rad
    if x is None or q is None or recording.phases_a is not None:
        return notes
    other = follows(x, {axis: q, **recording.others_rad}, axis, recording.rate_hz)
    if other is not None:
        return [
            *notes,
            f"{run.path}: axis{axis}_current follows the motion of axis{other}_position and not "
            f"that of axis{axis}_position: friction is of a joint's own motion; are columns "
            "exchanged? Correct the map of opamc ingest",
        ]
    late = lags(x, q, recording.rate_hz)
    return [*notes, _late(run, axis, late)] if late else notes


def _sizes(run: Run, axis: int, recording: Recording) -> list[str]:
    """Say which numbers few joints have."""
    found = []
    if recording.phases_a is None and recording.current_a is not None:
        unit = LIMITS[run.info.current_unit]
        found.append(limited(run.path, f"axis{axis}_current", recording.current_a, unit))
    if recording.velocity_rad_s is not None:
        speed = recording.velocity_rad_s
        found.append(limited(run.path, f"axis{axis}_velocity", speed, LIMITS["velocity"]))
    if recording.position_rad is not None:
        speed = strided_speed(recording.position_rad, recording.rate_hz)
        name = f"axis{axis}_position (its speed)"
        found.append(limited(run.path, name, speed, LIMITS["position"]))
    warm = run.channels(axis).columns.get("temperature")
    if warm is not None and recording.temperature_c is None:
        warmth = Size(LIMITS["temperature"])
        warmth.add(run.read([warm])[warm])
        found.append(f"{run.path}: column {warm} {warmth.doubt()} It is left out")
    return [note for note in found if note]


def _clipped(run: Run, axis: int, recording: Recording) -> list[str]:
    """Say which currents reach a limit: what lies beyond it would pass for an effect."""
    if recording.phases_a is not None:
        currents = _logged_phases(run, axis, recording)
    elif recording.current_a is not None and recording.position_rad is not None:
        speed = np.abs(strided_speed(recording.position_rad, recording.rate_hz))
        moving = np.flatnonzero(speed > MOVING * np.nanmax(speed, initial=0.0))
        currents = {"current": recording.current_a[moving]}
    else:
        return []
    shares = {name: clipped_share(values) for name, values in currents.items()}
    return [
        f"{run.path}: axis{axis}_{name} is clipped in {share:.0%} of its samples, and what lies "
        "beyond looks like an effect; check the sensor's range or the drive's limit"
        for name, share in shares.items()
        if share > CLIPPED
    ]


def _held(run: Run, axis: int, recording: Recording) -> list[str]:
    """Say whether a current comes less often than the samples: what is late looks like an effect.

    Of a position that does, hardly any sample counts, which is said where that is asked.
    """
    count = None if recording.current_a is None else held_for(recording.current_a)
    if count is None:
        return []
    return [
        f"{run.path}: axis{axis}_current holds each value for {count} samples, up to "
        f"{count / recording.rate_hz:.2g} s late beside the rest, which looks like an effect; log "
        "it as often"
    ]


def _logged_phases(run: Run, axis: int, recording: Recording) -> dict[str, Array]:
    """Return the phases that are in the file by their letters; a third may be the sum of two."""
    names, phases = run.channels(axis).phases, recording.phases_a
    columns = () if phases is None else zip(PHASES, phases.T, strict=True)
    return {name: values for name, values in columns if f"axis{axis}_{name}" in names}


def _spiked(run: Run, axis: int, recording: Recording) -> list[str]:
    """Say which channels hold single samples far from their neighbours."""
    channels = _logged_phases(run, axis, recording)
    if recording.phases_a is None and recording.current_a is not None:
        channels["current"] = recording.current_a
    if recording.position_rad is not None:
        channels["position"] = recording.position_rad
    found = {name: spikes(values) for name, values in channels.items()}
    return [
        f"{run.path}: axis{axis}_{name} leaps in {places.size} single samples, the first at "
        f"{places[0] / recording.rate_hz:.4g} s: a loose contact, or garbled by the logger? They "
        "count in every error; take them out"
        for name, places in found.items()
        if places.size
    ]


def _twice(run: Run, axis: int, recording: Recording) -> list[str]:
    """Say which other joints have this one's very positions: two encoders' last digits differ."""
    q = recording.position_rad
    if q is None or not np.nanmax(np.abs(np.diff(q)), initial=0.0):
        return []
    return [
        f"{run.path}: axis{axis}_position and axis{other}_position hold the same numbers: one "
        "joint's position in two columns? Correct the map of opamc ingest"
        for other, values in recording.others_rad.items()
        if np.array_equal(values, q, equal_nan=True)
    ]


def missing(run: Run, column: str) -> list[str]:
    """Say how many samples an angle's steps show to be missing.

    Raises
    ------
    InputError
        If the angle leaps back by one size that is no turn.
    """
    if column not in run.columns:
        return []
    found, looked = [], 0
    parts = min(run.n_samples, MOST_LOOKED) // STRETCHES if run.n_samples > MOST_LOOKED else None
    starts = [0] if parts is None else np.linspace(0, run.n_samples - parts, STRETCHES).tolist()
    for start in map(int, starts):
        stop = None if parts is None else start + parts
        position = np.asarray(run.read([column], start, stop)[column], dtype=np.float64)
        looked += position.size
        found.append(leaps(position))
    told = [one for one in found if one is not None]
    if not told:
        return []
    places = sum(one.places for one in told)
    wraps = [one.wrap for one in told if one.wrap is not None]
    if wraps:
        units = [name for size, name in WRAPS.items() if abs(wraps[0] / size - 1) < WRAPS_LIKE]
        msg = (
            f"{run.path}: column {column} leaps back by {wraps[0]:.4g} at {places} places, and no "
            f"joint does: an angle that wraps{f', in {units[0]}' if units else ''}? Name its unit "
            "in the map of opamc ingest, or unwrap it (unwrap: 360 where the file's own values "
            "wrap at 360, whatever their scale)"
        )
        raise InputError(msg)
    return [
        f"{run.path}: column {column} steps by twice as much and more as beside at {places} "
        f"places: about {sum(one.missing for one in told)} samples seem to be missing beside "
        f"{looked}, and what follows comes early; log a time and ingest with it"
    ]


def _late(run: Run, axis: int, late: list[float]) -> str:
    first, last = late[0], late[-1]
    if abs(last - first) > DRIFTED_S:
        return (
            f"{run.path}: axis{axis}_position comes {1e3 * first:+.0f} ms after what "
            f"axis{axis}_current tells at the beginning, {1e3 * last:+.0f} ms at the end: two "
            "clocks of different rates? Log both with one clock, or ingest each with its own time"
        )
    middle = float(np.median(late))
    return (
        f"{run.path}: axis{axis}_position comes {1e3 * abs(middle):.0f} ms "
        f"{'after' if middle > 0 else 'before'} the motion that axis{axis}_current tells: "
        "is one of them logged or filtered late?"
    )


def scaled(run: Run, axis: int, recording: Recording) -> list[str]:
    """Say by how much gravity tells another scale of the angle, where no effect explains it."""
    x, q = recording.current_a, recording.position_rad
    if x is None or q is None or recording.phases_a is not None:
        return []
    scale = other_scale(x, q, recording.rate_hz)
    if scale is None:
        return []
    named = [name for size, name in UNITS.items() if abs(scale / size - 1) < NEARLY]
    what = f"{named[0]}, or " if named else ""
    times = f"{scale:.3g}" if scale > 1 else f"1/{1 / scale:.3g}"
    return [
        f"{run.path}: gravity in axis{axis}_current is that of an angle {times} times "
        f"axis{axis}_position: {what}the motor's side taken for the joint's, or a gear ratio "
        "applied twice? Correct it in the map of opamc ingest"
    ]
