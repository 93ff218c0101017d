"""A declared model laid on one axis's recordings."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256

import numpy as np

from opamc_cli.arm.effects import arm_effects
from opamc_cli.config.joint_model import ARM, DeclaredEffect, JointModelConfig
from opamc_cli.errors import ConfigError, InputError, NotEnoughDataError
from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.effects.library import Library, built_in_library, effect_named
from opamc_cli.joint.explain.declared import Declared, Ways
from opamc_cli.joint.explain.saturated import unnamed_library
from opamc_cli.joint.fit.model import Dataset, Fit
from opamc_cli.joint.motion.groups import FEWEST_MOVING
from opamc_cli.joint.motion.kinematics import Recording, moving_beside
from opamc_cli.joint.motion.recordings import SHORTEST_TRAVEL_RAD, grouped_track, is_moving
from opamc_cli.joint.motion.track import Joint, Track
from opamc_cli.signal.motion.signs import friction_drives
from opamc_cli.signal.plausible.commanded import apart
from opamc_cli.stages.model.declared.terms import declared_term
from opamc_cli.stages.model.declared.users_effects import load_user_effects
from opamc_cli.stages.recordings.axis_recording import (
    gaps,
    positions_beside,
    read_recording,
    reported,
    turned_round,
    with_signs,
)
from opamc_cli.stages.recordings.mistaken import mistaken
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.schemas.channels import same_clock

HELD = 0.5
"""Share of samples in which a position that is logged at its own rate changes, at the least, while
its joint moves; in one that each value is held for ten samples it is a tenth."""
OPPOSITE = (
    "axis {}: friction would drive the joint: its current has the opposite sign of its motion, and "
    "the negative of it is modelled"
)
GUESSED = (
    "axis {}: what was turned without current (gaps: {}, {:.1f} s in all) is a guess, and so is "
    "the place: log the position to be certain"
)
COMMANDED = (
    "{}: axis{}_velocity is {:.1%} off the rate of change of the position and has no noise: "
    "commanded, or filtered for long? Logged speeds are left out; log them as measured, or none"
)
OTHER_RATIO = (
    "axis {}: beside the position the phases turn by {:.5g} electrical radians per radian, but "
    "joint.gear_ratio and {} make {:.5g}: correct the wrong one, or the position's unit"
)
RATIO_DOUBT = 0.002
"""By how much a ratio may differ: 38 recordings of three strangers tell it to 0.04 % at worst."""


@dataclass(frozen=True)
class AxisRecordings:
    """One axis of some runs."""

    recordings: list[Recording]
    """In time order."""
    unit: str
    """Of the current: "A", or "Nm" where a torque stands for it."""
    opposite: bool
    """Whether the currents are the negative of what was logged."""
    notes: list[str]
    """What the runs lack."""
    doubts: list[str]
    """Of the notes those that say that a run is wrong."""
    in_part: list[str]
    """Those that say that a part of a run is left out."""

    def said(self) -> dict[str, list[str]]:
        """Return all of these by name."""
        return {"notes": self.notes, "doubts": self.doubts, "in_part": self.in_part}


@dataclass(frozen=True)
class AxisModel:
    """A declared model laid on one axis's recordings."""

    axis: int
    """Counted from 1."""
    fit: Fit
    """The declared model, fitted to the open data; parameters that were not given are found."""
    ways: Ways
    """Fits it to the motion as it is differentiated best beside terms that were found."""
    declared: tuple[tuple[Effect, DeclaredEffect], ...]
    """Model as declared."""
    library: Library
    """Effects that may be added."""
    read: AxisRecordings
    """What it was fitted to."""

    @property
    def unit(self) -> str:
        """Of the current: "A", or "Nm" where a torque stands for it."""
        return self.read.unit

    @property
    def notes(self) -> list[str]:
        """What the recordings lack."""
        return self.read.notes

    @property
    def dataset(self) -> Dataset:
        """Recordings, groups, sealed ones."""
        return self.fit.dataset


def library_of(model: JointModelConfig) -> Library:
    """Return the library with the user's effects and those of an arm whose joints are known.

    Raises
    ------
    ConfigError
        If a file defines no effect, a name is unknown, or `arm` is declared and no joints are.
    """
    library = built_in_library()
    if model.arm is not None:
        library |= arm_effects(model.arm.chain())
    for path in model.library:
        for effect in load_user_effects(path):
            library[effect.name] = effect
    if ARM not in library and any(declared.effect == ARM for declared in model.declared()):
        msg = (
            "effect 'arm' is declared, but not where the joints are: write them under `arm`, or "
            "have them found by `opamc model arm RUN...`"
        )
        raise ConfigError(msg)
    for name in {*model.without} - {ARM}:
        effect_named(library, name)
    return library


def lay(
    model: JointModelConfig, runs: Sequence[Run], axis: int, opposite: bool | None = None
) -> AxisModel:
    """Lay a declared model on one axis of some runs, the sign of the current as `recordings_of`.

    Raises
    ------
    ConfigError
        If an effect is unknown, or needs what the runs do not have.
    InputError
        If rates differ or a channel is missing.
    NotEnoughDataError
        If the axis does not move, or too little to seal anything off.
    """
    library = library_of(model)
    declared = declared_effects(model, library)
    read = recordings_of(runs, axis, opposite)
    recordings = read.recordings
    joint = Joint(model.joint.ratio_of(axis), model.joint.poles_of(axis))
    named = ", ".join(str(run.path) for run in runs[:3]) + (", ..." if len(runs) > 3 else "")

    def on(dataset: Dataset) -> Declared:
        told = dataset.fine.track.payload_kg
        for effect, entry in declared:
            why = None if effect.name == "load_friction" else effect.untestable(dataset.fine.track)
            if "per_kg" in entry.parameters and (told is None or not np.ptp(told)):
                why = "its runs do not all tell a payload_kg, and different ones, in their metadata"
            if why is not None:
                msg = (
                    f"Effect {effect.name!r} is declared, but axis {axis} of {named} cannot show "
                    f"it: {why}; record what it asks for, or drop the effect from the model"
                )
                raise ConfigError(msg)
        track = dataset.coarse.track
        return tuple((effect, declared_term(effect, entry, track)) for effect, entry in declared)

    ways = Ways(recordings, joint, on)
    fit = ways.best_fit()
    if fit is None:
        raise too_little_motion(grouped_track(recordings, joint)[0], axis, named, FEWEST_MOVING)
    guessed_s = fit.dataset.fine.track.guessed_s
    if guessed_s:
        read.notes.append(GUESSED.format(axis, len(guessed_s), sum(guessed_s)))
    turns = np.array(fit.dataset.fine.track.turns)
    if turns.size and joint.gear_ratio:
        # pole pairs that nobody gave are a whole number
        poles = joint.pole_pairs or max(round(float(np.median(turns)) / joint.gear_ratio), 1)
        by = "joint.pole_pairs" if joint.pole_pairs else f"{poles} pole pairs, which is nearest,"
        stated = joint.gear_ratio * poles
        worst = turns[np.argmax(np.abs(turns - stated))]
        if abs(worst - stated) > RATIO_DOUBT * stated:
            read.doubts.append(OTHER_RATIO.format(axis, worst, by, stated))
            read.notes.append(read.doubts[-1])
    excluded = model.not_searched()
    allowed = {name: effect for name, effect in library.items() if name not in excluded}
    return AxisModel(axis, fit, ways, declared, allowed, read)


def declared_effects(
    model: JointModelConfig, library: Library
) -> tuple[tuple[Effect, DeclaredEffect], ...]:
    """Return the effects that a model declares.

    Raises
    ------
    ConfigError
        If one is unknown.
    """
    # A closed model may hold functions without a name; nobody else is offered them.
    closed = {d.effect for d in model.declared()} - library.keys()
    known = library | {name: e for name, e in unnamed_library().items() if name in closed}
    return tuple((effect_named(known, d.effect), d) for d in model.declared())


def recordings_of(runs: Sequence[Run], axis: int, opposite: bool | None = None) -> AxisRecordings:
    """Read one axis of some runs; is its current the negative of what was logged? None: find out.

    Raises
    ------
    InputError
        If rates or units differ, or a channel is missing.
    NotEnoughDataError
        If a run is too short.
    """
    recordings = with_signs(
        [
            replace(
                read_recording(run, axis),
                others_rad=positions_beside(run, axis),
                payload_kg=run.info.payload_kg,
            )
            for run in runs
        ]
    )
    robots = sorted({run.info.robot for run in runs if run.info.robot is not None})
    if len(robots) > 1:
        msg = (
            f"{runs[0].path}: the runs are of {len(robots)} robots ({', '.join(robots[:3])}"
            f"{', ...' * (len(robots) > 3)}); a model is one joint's, give runs of one robot"
        )
        raise InputError(msg)
    _refuse_copies(runs, recordings)
    units = {run.info.current_unit for run in runs}
    if len(units) > 1:
        msg = f"{runs[0].path}: some runs hold currents (A), others torques (Nm); give one kind"
        raise InputError(msg)
    rates = {recording.rate_hz for recording in recordings}
    rate_hz = recordings[0].rate_hz
    if not all(same_clock(rate, rate_hz) for rate in rates):
        msg = (
            f"{runs[0].path}: the runs have different rates "
            f"({', '.join(f'{rate:g}' for rate in sorted(rates))} Hz); give runs of one rate, or "
            "ingest them again with one resample_hz in the map"
        )
        raise InputError(msg)
    recordings = [replace(recording, rate_hz=rate_hz) for recording in recordings]
    for recording, run in zip(recordings, runs, strict=True):
        if recording.size < 64:
            msg = (
                f"{run.path}: {recording.size} samples of axis {axis} at {rate_hz:g} Hz are "
                "too few for a model; record for longer, or at a higher rate"
            )
            raise NotEnoughDataError(msg)
    in_part = [
        note for run, one in zip(runs, recordings, strict=True) for note in gaps(run, axis, one)
    ]
    doubts = [
        note for run, one in zip(runs, recordings, strict=True) for note in mistaken(run, axis, one)
    ]
    recordings, commanded = _without_commands(runs, axis, recordings)
    doubts += commanded
    notes = [*in_part, *doubts]
    pairs = reported(recordings)
    # Of a heavy joint of an arm it may be anything until the others' torques are known: one of
    # positive friction (by 44 errors) drove by 14 in another program.
    if opposite is None and pairs and not moving_beside(recordings):
        opposite = friction_drives(pairs, rate_hz)
        notes += [OPPOSITE.format(axis)] if opposite else []
    if pairs and opposite:
        recordings = turned_round(recordings)
    if all(recording.started_s is not None for recording in recordings):
        recordings.sort(key=lambda recording: recording.started_s or 0.0)
    signs = bool(pairs and opposite)
    return AxisRecordings(recordings, units.pop(), signs, notes, doubts, in_part)


def _without_commands(
    runs: Sequence[Run], axis: int, recordings: list[Recording]
) -> tuple[list[Recording], list[str]]:
    """Leave out a speed that is commanded, of all recordings, and say so."""
    both = [(one.position_rad, one.velocity_rad_s, one.rate_hz) for one in recordings]
    shares = [None if q is None or v is None else apart(q, v, rate) for q, v, rate in both]
    doubts = [
        COMMANDED.format(run.path, axis, share)
        for run, share in zip(runs, shares, strict=True)
        if share is not None
    ]
    if doubts:
        recordings = [replace(one, velocity_rad_s=None) for one in recordings]
    return recordings, doubts


def _refuse_copies(runs: Sequence[Run], recordings: Sequence[Recording]) -> None:
    """Refuse a recording that holds the same as another: what is sealed would be searched."""
    known: dict[bytes, Run] = {}
    for run, one in zip(runs, recordings, strict=True):
        current = one.current_a if one.phases_a is None else one.phases_a
        if current is None:
            continue
        first = known.setdefault(sha256(current.tobytes()).digest(), run)
        if first is not run:
            msg = (
                f"{run.path}: holds the same current as {first.path}; what is sealed off in one "
                "would be searched in the other, give each recording once"
            )
            raise InputError(msg)


def too_little_motion(track: Track, axis: int, named: str, fewest: int) -> NotEnoughDataError:
    """Say of what there is too little on a track that is not fitted, or not judged."""
    travel, share = np.ptp(track.position_rad), np.mean(np.diff(track.position_rad) != 0)
    moving = np.count_nonzero(track.moving)
    msg = (
        f"{named}: of axis {axis} {moving} samples ({moving / track.rate_hz:.3g} s) count, in "
        "motion and clear of reversals and of the recording's ends, too few: record at least "
        f"{fewest}"
    )
    if travel < SHORTEST_TRAVEL_RAD:
        does = f"axis {axis} does not move (travel {travel:.2g} rad)"
        msg = f"{named}: {does}; give runs in which it does"
    elif not is_moving(track) and share < HELD:
        msg = (
            f"{named}: the position of axis {axis} changes in {share:.0%} of the samples alone "
            "and stands still between: is each value held? Log it at its own rate"
        )
    elif track.guessed_s:
        msg = (
            f"{named}: the phase currents of axis {axis} do not tell its motion: for "
            f"{max(track.guessed_s):.2g} s at a time there is too little current to see it, and "
            "the followed speed runs away; log the position"
        )
    return NotEnoughDataError(msg)
