"""Why a joint has changed: the effect that target runs have and baseline runs lack."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow as pa

from opamc_cli.config.models import JointConfig
from opamc_cli.decision.measurement.at_rest import Fluctuation, Growth, fluctuation, growth_at_rest
from opamc_cli.decision.measurement.lag import Course, Lag, courses, lag_behind
from opamc_cli.decision.measurement.sensors import (
    ErrorGrowth,
    SensorErrors,
    growth_of_errors,
    sensor_errors,
)
from opamc_cli.errors import NotEnoughDataError, OpamcError
from opamc_cli.joint.change.explain import SMALLEST_SHARE, Change, explain_change
from opamc_cli.joint.change.reading import Cause
from opamc_cli.joint.change.search import LESS_FRICTION, SCALE
from opamc_cli.joint.effects.library import Library, built_in_library
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Floats, Joint
from opamc_cli.signal.motion.reported import unwrapped
from opamc_cli.stages.model.kept_tracks import following
from opamc_cli.stages.model.loaded_effects import load_user_effects
from opamc_cli.stages.model.users_effects import users_effects_named
from opamc_cli.stages.processes.kept import KeptResults
from opamc_cli.stages.recordings.axis_recording import interpolated, read_recording
from opamc_cli.stages.verdict.wording.reasons import (
    AT_REST,
    CURRENT_LAG,
    IN_SPIKES,
    IN_THE_SUM,
    SENSOR_NOISE,
    effect_in_words,
    excuses_little,
    lies_outside,
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

OF_OTHERS = ("effect", "parameters", "share", "interpretation", "origin")

FRICTION = frozenset(
    name
    for name, effect in built_in_library().items()
    if effect.resists and effect.origin == "joint" and not effect.at_a_place
)
ANY_FRICTION = (
    "friction, in a form that the recordings do not tell: check grease, preload and seals"
)
"""Of forms that tie: dry and lubricant friction that grow by half are nearest to a sublinear form,
and were called a starved lubricant."""

MUCH = 9.0
"""Times as much again: of a baseline that has hardly any of it, a factor says nothing."""

WELL_EXPLAINED = 0.8
"""Below this share the reasons say how much of the change is unexplained."""

MOST_TIMES = 100.0
"""Of what was hardly there more says nothing."""

HUM = "mains_hum"
NOISE = (
    "noise or hum of the current sensor, which has grown as much while the joint stands still: "
    "check the sensor, its cable and the amplifier"
)
OF_SPIKES = (
    "single samples that the current's sensor or the logger garbles: check cables, connectors and "
    "the log"
)
OF_THE_SUM = {
    "sensor_offset": "a zero error of a phase's current sensor: check the sensors' zero",
    "sensor_gain": "the gain of a phase's current sensor, or a current that leaves the three "
    "phases: check sensors, scaling, connectors and the motor's insulation",
    "sensor_noise": "noise, hum or spikes of the phases' current sensors: check sensors, cables "
    "and connectors",
}


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
    for sources, moves in zip((baseline, target), strokes, strict=True):
        recordings, noise, wrongs, moved, errors = _recordings(
            axis, sources[-MAX_RUNS:], seconds, moving or {}, moves, rate_hz
        )
        if not recordings:
            raise errors[0]
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
        found = _entry(change)
    if (grown := growth_of_errors(*wrong)) is not None:
        phases = all(recording.phases_a is not None for recording in sides[1])
        found = _with_sensor(_of_sum(grown) if phases else _of_spikes(grown), found)
    elif (at_rest := growth_at_rest(*noises)) is not None:
        found = _with_sensor(_of_noise(at_rest), found)
    if lag is not None:
        return _of_lag(lag, found)
    if found is None and change.why_not is not None:
        raise NotEnoughDataError(change.why_not)
    return found or {}


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
    recordings, *_ = _recordings(axis, baseline[-MAX_RUNS:], seconds, moving, {}, rate_hz)
    follow = following(kept)
    for recording in recordings:
        follow(recording, Joint(config.ratio_of(axis), config.poles_of(axis)))


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


def _recordings(
    axis: int,
    sources: Sequence[RunSource],
    seconds: float,
    moving: Mapping[str, tuple[int, int]],
    strokes: Mapping[str, Spans],
    rate_hz: float,
) -> tuple[
    list[Recording], list[Fluctuation], list[SensorErrors], list[list[Course]], list[OpamcError]
]:
    found: list[Recording] = []
    noises: list[Fluctuation] = []
    wrong: list[SensorErrors] = []
    along: list[list[Course]] = []
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
                found.append(interpolated(recording, LEAST_HZ))
            noise = _fluctuation(recording, start, strokes.get(source.name, ()))
            noises += [] if noise is None else [noise]
            current = _current(recording)
            added = None if current is None else sensor_errors(current, recording.rate_hz)
            wrong += [] if added is None else [added]
            along.append(_courses(recording))
        except OpamcError as error:
            # the run served the chain but not a model, which needs motion beside current
            errors.append(error)
    return found, noises, wrong, along, errors


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


def _entry(change: Change) -> dict[str, Any] | None:
    if not change.causes:
        return None
    first, *others = change.causes
    return {
        "effect": first.effect,
        "domain": first.domain,
        "parameters": dict(first.parameters),
        "interpretation": meaning(
            *(first.effect, first.interpretation, first.ties),
            first.evidence.get("relative_change"),
        ),
        "share": first.share,
        "p_value": first.p_value,
        "ties": list(first.ties),
        "harmless": change.harmless,
        "origin": first.origin,
        "explained": change.explained_share,
        "clear": first.clear,
        "evidence": dict(first.evidence),
        "why": _why(first, change),
        "others": [{key: getattr(cause, key) for key in OF_OTHERS} for cause in others],
    }


def _with_sensor(sensor: dict[str, Any], found: dict[str, Any] | None) -> dict[str, Any]:
    """Put a sensor's trouble before what it may be, or beside what it is not."""
    if found is None:
        return sensor
    hum = found["effect"] == HUM and sensor["effect"] == SENSOR_NOISE and not excuses_little(found)
    if hum or found["effect"] == sensor["effect"]:
        evidence = {**found["evidence"], **sensor["evidence"]}
        return {**found, "evidence": evidence, "why": [*found["why"], *sensor["why"]]}
    rest = [one for one in found["others"] if one["effect"] != sensor["effect"]]
    # a sum, or spikes, prove it: a gain of 1.3 looks like a payload, or all of a scale, besides
    alike = lies_outside(found) or found["effect"] == SCALE.name
    proven = AT_REST not in sensor["evidence"] and alike
    if proven or _heard_at_rest(found):
        return {**sensor, "others": [{key: found[key] for key in OF_OTHERS}, *rest]}
    others = [*rest, {key: sensor[key] for key in OF_OTHERS}]
    return {**found, "others": others, "why": [*found["why"], *sensor["why"]]}


def _heard_at_rest(cause: Mapping[str, Any]) -> bool:
    """Whether a cause may be what a sensor's noise or hum looks like: friction is slow."""
    return cause["effect"] in ("ripple", HUM) or (lies_outside(cause) and excuses_little(cause))


def _of_noise(noise: Growth) -> dict[str, Any]:
    """Return a sensor's noise, which is there at rest, as a cause."""
    why = (
        f"While the joint stands still the current fluctuates {noise.times:.2g} times as much as "
        f"in the baseline, which is {noise.share:.0%} of what it has grown by in motion; a fault "
        "of the gear shows in motion alone."
    )
    return _sensor(SENSOR_NOISE, NOISE, noise.share, {AT_REST: noise.times}, why)


def _of_sum(grown: ErrorGrowth) -> dict[str, Any]:
    """Return trouble of the phases' sensors as a cause."""
    part = {"sensor_offset": "what is constant of", "sensor_gain": "what follows the phases of"}
    times = (
        f"{MOST_TIMES:g} times and more" if grown.times > MOST_TIMES else f"{grown.times:.2g} times"
    )
    why = (
        "The three phases of a motor without a neutral wire add up to nothing, whatever the gear "
        f"does; {part.get(grown.kind, 'the rest of')} their sum is {times} the baseline's, "
        f"and {grown.share:.0%} of what the current's fluctuation has grown by."
    )
    evidence = {IN_THE_SUM: min(grown.times, MOST_TIMES)}
    return _sensor(grown.kind, OF_THE_SUM[grown.kind], grown.share, evidence, why)


def _of_spikes(grown: ErrorGrowth) -> dict[str, Any]:
    """Return single samples that leap as a cause."""
    why = (
        f"Single samples that leap and are back with the next are {grown.share:.0%} of what the "
        "current's fluctuation has grown by; a fault of the gear lasts longer."
    )
    evidence = {IN_SPIKES: min(grown.times, MOST_TIMES)}
    return _sensor(grown.kind, OF_SPIKES, grown.share, evidence, why)


def _sensor(
    effect: str, meaning: str, share: float, evidence: Mapping[str, float], *why: str
) -> dict[str, Any]:
    """Return a cause that makes a joint neither healthy nor faulty."""
    return {
        "effect": effect,
        "domain": "time",
        "parameters": {},
        "interpretation": meaning,
        "share": share,
        "p_value": None,
        "ties": [],
        "harmless": False,
        "origin": "measurement",
        "explained": share,
        "clear": False,
        "evidence": dict(evidence),
        "why": [*why],
        "others": [],
    }


def _of_lag(lag: Lag, found: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return a current's lag as the cause, beside it what was found with the current moved back.

    As a sensor's noise it makes a joint neither healthy nor faulty.
    """
    way = "later" if lag.lag_s > 0 else "earlier"
    late = f"the current comes {1e3 * abs(lag.lag_s):.2g} ms {way} against the position"
    others = [] if found is None else [{key: found[key] for key in OF_OTHERS}, *found["others"]]
    rest = [{**other, "share": other["share"] * (1 - lag.share)} for other in others]
    rest = [other for other in rest if other["share"] >= SMALLEST_SHARE]
    why = [
        f"In all motions alike {late} than in the baseline, whose recordings differ by "
        f"{1e3 * lag.of_baseline_s:.2g} ms at most; moved back, {lag.share:.0%} of what its course "
        "differs by is gone. A fault of the gear bends the course instead."
    ]
    if rest:
        why += ["With the current moved back:", *(found or {})["why"]]
    told = f"{late} than in the baseline: look at the logger, its bus and the drive"
    evidence = {"delay_s": lag.lag_s, "baseline_delay_s": lag.of_baseline_s}
    cause = _sensor(CURRENT_LAG, told, lag.share, evidence, *why)
    return {**cause, "parameters": {"delay_s": lag.lag_s}, "others": rest}


def meaning(effect: str, own: str, ties: Sequence[str], change: float | None) -> str:
    """Say what a cause means, and of friction whether it has grown, and by how much.

    Parameters
    ----------
    effect, own
        Its name, and what that means by itself.
    ties
        Names of what explains as much.
    change
        By which share of itself friction, or the current, is larger, if that is known.
    """
    unsure = effect in FRICTION and not FRICTION.isdisjoint(ties)
    said = ANY_FRICTION if unsure and own != LESS_FRICTION else own
    if change is None:
        return said
    what = "the current" if effect == SCALE.name else "the joint's friction"
    if change >= MUCH:
        return f"{said}; {what} has grown much"
    way = "grown" if change > 0 else "fallen"
    return f"{said}; {what} has {way} by {abs(change):.0%}"


def _why(cause: Cause, change: Change) -> list[str]:
    """Say in a maintainer's words what was measured, how sure it is, and what it cannot tell."""
    before, after = change.units
    kind = "sessions" if change.sessions else "cycles"
    sentences = []
    seen = cause.evidence
    if "measured_order" in seen:
        turn = "turn of the motor" if change.angle == "motor" else f"{change.angle} revolution"
        sentences.append(
            f"Torque ripple at {seen['measured_order']:.4g} ± {seen['order_error']:.1g} per {turn} "
            f"has {seen['power_ratio']:.3g} times the power that it has in the baseline's {kind}; "
            f"two orders must differ by {seen['order_resolution']:.2g} to be told apart within a "
            "stroke."
        )
    if "measured_frequency_hz" in seen:
        sentences.append(
            f"A line at {seen['measured_frequency_hz']:.4g} Hz, whatever the speed, has "
            f"{seen['power_ratio']:.3g} times the power that it has in the baseline's {kind}."
        )
    chance = "below 0.0001" if cause.p_value < 1e-4 else f"{cause.p_value:.2g}"
    sentences.append(
        f"{_effect_name(cause)} explains {cause.share:.0%} of what the current changed beyond the "
        f"{kind}' own differences; healthy {kind} show as much with probability {chance} "
        f"({before} {kind} against {after})."
    )
    if cause.ties:
        sentences.append(
            f"The recordings cannot tell it from: {'; '.join(map(effect_in_words, cause.ties))}."
        )
    for other in change.causes[1:]:
        name = _effect_name(other).lower()
        sentences.append(f"Besides, {name} explains {other.share:.0%}: {other.interpretation}.")
    if change.explained_share < WELL_EXPLAINED:
        sentences.append(
            f"{1 - change.explained_share:.0%} of the change has no cause in the library."
        )
    if not change.sessions:
        sentences.append(
            "With fewer than three baseline recordings it is assumed, not known, how much healthy "
            "sessions differ."
        )
    return sentences


def _effect_name(cause: Cause) -> str:
    name = effect_in_words(cause.effect)
    return name[0].upper() + name[1:]
