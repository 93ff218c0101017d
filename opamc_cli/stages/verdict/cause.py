"""Why a joint has changed: the effect that target runs have and baseline runs lack."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from opamc_cli.config.models import JointConfig
from opamc_cli.decision.measurement.at_rest import Fluctuation, fluctuation, growth_at_rest
from opamc_cli.decision.measurement.lag import Course, courses, lag_behind
from opamc_cli.decision.measurement.sensors import SensorErrors, growth_of_errors, sensor_errors
from opamc_cli.errors import NotEnoughDataError, OpamcError
from opamc_cli.joint.change.explain import explain_change, friction_change
from opamc_cli.joint.effects.library import Library, built_in_library
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Floats, Joint
from opamc_cli.signal.motion.reported import unwrapped
from opamc_cli.stages.model.declared.users_effects import load_user_effects, users_effects_named
from opamc_cli.stages.model.kept_tracks import following
from opamc_cli.stages.processes.kept import KeptResults
from opamc_cli.stages.recordings.axis_recording import (
    interpolated,
    read_recording,
    resisted,
    with_signs,
)
from opamc_cli.stages.verdict.wording.causes import (
    entry,
    of_lag,
    of_noise,
    of_spikes,
    of_sum,
    with_sensor,
)
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.sources import RunSource

Spans = Sequence[tuple[int, int]]
"""Samples (start, stop), half-open."""

MAX_RUNS = 8
"""Runs of each side that are looked at, the newest ones: how healthy sessions differ is not known
much better from more."""

BESIDE_S = 1.0
"""Rest that is read before the first and after the last motion of the axis: of a program that moves
one axis after the other most of a recording lies outside."""

LEFT_ITS_PLACE = 0.02
"""Of the way that an axis goes in a recording: a place is left where the position is farther away.
Above what a held joint trembles by; the rest beside holds how a motion begins."""

LEAST_HZ = 100.0
"""Slower logs are interpolated: the change of a joint is sought on a grid of this rate."""


def explain(
    axis: int,
    baseline: Sequence[RunSource],
    target: Sequence[RunSource],
    config: JointConfig,
    moving: Mapping[str, tuple[int, int]] | None = None,
    kept: KeptResults | None = None,
    strokes: Sequence[Mapping[str, Spans]] = ({}, {}),
) -> dict[str, Any]:
    """Trace the change of one joint to an effect of the library.

    Parameters
    ----------
    axis
        Counted from 1.
    baseline, target
        Runs in which the axis moves, in time order.
    config
        Gear ratio and pole pairs, effects of the user's own, and how much is looked at.
    moving
        Samples between which the axis moves (half-open), by run: nothing else is looked at. Where
        the position is logged it says so itself, of strokes too that no pattern was taken from.
    kept
        Where the motion of the baseline's recordings may lie.
    strokes
        All samples between which the axis moves, by run of either side: where no position is logged
        they tell standstill.

    Returns
    -------
    dict
        The `cause` of verdict.json: an effect of the library, trouble of the sensors that is there
        at standstill, in what the phases add up to or in single samples, or a current that comes
        later than it did; empty where none of them explains the change.

    Raises
    ------
    ConfigError
        If an effect of the user's own cannot be used.
    InputError, NotEnoughDataError
        If a side does not hold what a model of the joint needs.
    """
    sides, noises, wrong, along = [], [], [], []
    seconds = 60.0 * config.explain_minutes
    rate_hz = baseline[0].info.sampling_rate_hz  # the others' but for a clock's drift
    logged = [
        _as_logged(axis, sources[-MAX_RUNS:], seconds, moving or {}, rate_hz)
        for sources in (baseline, target)
    ]
    signed = iter(resisted(with_signs([one.recording for side in logged for one in side])))
    for side, moves in zip(logged, strokes, strict=True):
        read = [one._replace(recording=next(signed)) for one in side]
        recordings, noise, wrongs, moved = _measured(read, moves)
        sides.append(recordings)
        noises.append(noise)
        wrong.append(wrongs)
        along.append(moved)
    lag = lag_behind(*along)
    if lag is not None:  # what else has changed is sought without it
        sides[1] = [_earlier(recording, lag.lag_s) for recording in sides[1]]
    joint = Joint(config.ratio_of(axis), config.poles_of(axis))
    library = library_of(config)
    with users_effects_named():
        change = explain_change(sides[0], sides[1], joint, library=library, follow=following(kept))
        found = entry(change)
    if (grown := growth_of_errors(*wrong)) is not None:
        phases = all(recording.phases_a is not None for recording in sides[1])
        found = with_sensor(of_sum(grown) if phases else of_spikes(grown), found)
    elif (at_rest := growth_at_rest(*noises)) is not None:
        found = with_sensor(of_noise(at_rest), found)
    if lag is not None:
        return of_lag(lag, found)
    if found is None and change.why_not is not None:
        raise NotEnoughDataError(change.why_not)
    return found or {}


def friction(
    axis: int,
    baseline: Sequence[RunSource],
    target: Sequence[RunSource],
    config: JointConfig,
    moving: Mapping[str, tuple[int, int]],
    kept: KeptResults | None = None,
) -> float | None:
    """Return by how much one joint's friction differs, of 1; arguments are those of `explain`.

    None where no model of the joint tells.
    """
    seconds, rate_hz = 60.0 * config.explain_minutes, baseline[0].info.sampling_rate_hz
    sides = [
        [one.recording for one in _as_logged(axis, part[-MAX_RUNS:], seconds, moving, rate_hz)]
        for part in (baseline, target)
    ]
    both = resisted(with_signs([*sides[0], *sides[1]]))
    signed = [interpolated(one, LEAST_HZ) for one in both]
    n, joint = len(sides[0]), Joint(config.ratio_of(axis), config.poles_of(axis))
    return friction_change(signed[:n], signed[n:], joint, following(kept))


def follow_baseline(
    axis: int,
    baseline: Sequence[RunSource],
    config: JointConfig,
    moving: Mapping[str, tuple[int, int]],
    kept: KeptResults,
) -> None:
    """Keep how one joint moved in its baseline, for whoever has a change of it to explain.

    Parameters
    ----------
    axis, baseline, config, moving, kept
        As of `explain`, which finds it there.
    """
    seconds, rate_hz = 60.0 * config.explain_minutes, baseline[0].info.sampling_rate_hz
    logged = _as_logged(axis, baseline[-MAX_RUNS:], seconds, moving, rate_hz)
    follow = following(kept)
    for recording in with_signs([one.recording for one in logged]):
        found = interpolated(recording, LEAST_HZ)
        follow(found, Joint(config.ratio_of(axis), config.poles_of(axis)))


def library_of(config: JointConfig) -> Library:
    """Return the effects that may be a cause: those that come with the package, and the user's.

    Raises
    ------
    ConfigError
        If a file defines no effect.
    """
    own = [effect for path in config.library for effect in load_user_effects(path)]
    return built_in_library() | {effect.name: effect for effect in own}


def moving_samples(patterns: pa.Table) -> dict[int, dict[str, tuple[int, int]]]:
    """Return, by axis and run, from where to where the motions of a pattern table are."""
    found: dict[int, dict[str, tuple[int, int]]] = {}
    for row in patterns.select(["axis", "run", "start", "stop"]).to_pylist():
        runs = found.setdefault(row["axis"], {})
        first, last = runs.get(row["run"], (row["start"], row["stop"]))
        runs[row["run"]] = (min(first, row["start"]), max(last, row["stop"]))
    return found


def strokes_of(segments: pa.Table) -> dict[int, dict[str, list[tuple[int, int]]]]:
    """Return, by axis and run, the samples between which the motions of a segment table are."""
    found: dict[int, dict[str, list[tuple[int, int]]]] = {}
    for row in segments.select(["axis", "run", "start", "stop"]).to_pylist():
        runs = found.setdefault(row["axis"], {})
        runs.setdefault(row["run"], []).append((row["start"], row["stop"]))
    return found


class _Logged(NamedTuple):
    """A recording as it was logged, and which run's, from which sample on."""

    run: str
    start: int
    recording: Recording


def _as_logged(
    axis: int,
    sources: Sequence[RunSource],
    seconds: float,
    moving: Mapping[str, tuple[int, int]],
    rate_hz: float,
) -> list[_Logged]:
    """Read what a model of the joint needs of each run that has it.

    Raises
    ------
    OpamcError
        If none has.
    """
    found: list[_Logged] = []
    errors: list[OpamcError] = []
    for source in sources:
        # seconds are those of a log of this rate: a slower one costs no more for being longer
        read_hz = max(rate_hz, LEAST_HZ)
        beside, most = round(BESIDE_S * read_hz), round(seconds / len(sources) * read_hz)
        try:
            with source.open() as run:
                known = [_moves(run, axis), moving.get(source.name)]
                # both: a lost sample of the position may look like all of its way
                spans = [span for span in known if span] or [(0, source.n_samples)]
                first, last = min(start for start, _ in spans), max(stop for _, stop in spans)
                start, stop = max(first - beside, 0), min(last + beside, first + most)
                recording = replace(read_recording(run, axis, start, stop), rate_hz=rate_hz)
                found.append(_Logged(source.name, start, recording))
        except OpamcError as error:
            # the run served the chain but not a model, which needs motion beside current
            errors.append(error)
    if not found:
        raise errors[0]
    return found


def _measured(
    read: Sequence[_Logged], strokes: Mapping[str, Spans]
) -> tuple[list[Recording], list[Fluctuation], list[SensorErrors], list[list[Course]]]:
    """Return one side's recordings for the model, their noise, sensors' errors and courses."""
    noises: list[Fluctuation] = []
    wrong: list[SensorErrors] = []
    for run, start, recording in read:
        noise = _fluctuation(recording, start, strokes.get(run, ()))
        noises += [] if noise is None else [noise]
        current = _current(recording)
        added = None if current is None else sensor_errors(current, recording.rate_hz)
        wrong += [] if added is None else [added]
    found = [interpolated(one.recording, LEAST_HZ) for one in read]
    return found, noises, wrong, [_courses(one.recording) for one in read]


def _current(recording: Recording) -> Floats | None:
    """Return a recording's phases, (n, 3), or without them its reported current."""
    return recording.current_a if recording.phases_a is None else recording.phases_a


def _courses(recording: Recording) -> list[Course]:
    """Return a recording's courses; none where no position is logged."""
    current, position = _current(recording), recording.position_rad
    if current is None or position is None:
        return []
    return courses(current, position, recording.rate_hz)


def _earlier(recording: Recording, lag_s: float) -> Recording:
    """Return a recording whose current comes earlier; its last values are held."""
    time = np.arange(recording.size) / recording.rate_hz

    def moved(values: Floats) -> Floats:
        return np.interp(time + lag_s, time, values)

    current, phases = recording.current_a, recording.phases_a
    return replace(
        recording,
        current_a=None if current is None else moved(current),
        phases_a=None if phases is None else np.stack([moved(one) for one in phases.T], axis=1),
    )


def _fluctuation(recording: Recording, start: int, strokes: Spans) -> Fluctuation | None:
    """Measure a recording's noise, whose first sample is `start` of the run."""
    position = recording.position_rad
    if position is None:
        if not strokes:
            return None
        moves = np.zeros(recording.size)
        for first, last in strokes:
            moves[max(first - start, 0) : max(last - start, 0)] = 1.0
        position = np.cumsum(moves)
    current = _current(recording)
    return None if current is None else fluctuation(current, position, recording.rate_hz)


def _moves(run: Run, axis: int) -> tuple[int, int] | None:
    """Return between which samples the position of an axis changes; None if unknown."""
    column = run.channels(axis).columns.get("position")
    if column is None:
        return None
    position = unwrapped(run.read([column])[column])
    known = position[np.isfinite(position)]
    if not known.size or not np.ptp(known):
        return None
    near = LEFT_ITS_PLACE * np.ptp(known)
    first = int(np.argmax(abs(position - known[0]) > near))
    return first, position.size - int(np.argmax(abs(position - known[-1])[::-1] > near))
