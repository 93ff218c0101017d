"""The current of one segment and its envelope, from whichever channels a run holds."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from opamc_cli.errors import InputError
from opamc_cli.signal.offset import mean_over_turns
from opamc_cli.signal.transform.analytic import analytic_signal, clarke, envelope
from opamc_cli.storage.runs.columns import AxisChannels
from opamc_cli.storage.runs.run import Run

EnvelopeKind = Literal["auto", "clarke", "hilbert", "reported"]

GUARD_S = 0.25
"""Read beside a segment of one phase, so that the Hilbert transform's edges fall outside it."""


def envelope_kind(path: object, channels: AxisChannels, wanted: EnvelopeKind) -> EnvelopeKind:
    """Return the kind of envelope that an axis can give.

    Raises
    ------
    InputError
        If the wanted kind needs a current that the run does not hold.
    """
    if wanted == "auto":
        if len(channels.phases) == 3:
            return "clarke"
        return "hilbert" if channels.phases else "reported"
    lacking = {
        "clarke": len(channels.phases) < 3 and "three phase currents",
        "hilbert": not channels.phases and "a phase current",
        "reported": channels.current is None and f"axis{channels.axis}_current",
    }[wanted]
    if lacking:
        msg = (
            f"{path}: patterns.envelope is {wanted!r} but axis {channels.axis} lacks {lacking}; "
            "use 'auto'"
        )
        raise InputError(msg)
    return wanted


OFFSET_MOTIONS = 64
"""Most segments that the sensors' offset is estimated from."""


def current_offset(
    run: Run, axis: int, motions: Sequence[tuple[int, int, float]], wanted: EnvelopeKind = "auto"
) -> complex:
    """Estimate what the current sensors add to the current vector of an axis, A.

    The vector turns, its sensors' offset stands still: it is the mean over what motions turn by
    that turn often. Left in, it modulates the envelope once per electrical period, by more than
    early damage does, and it drifts from session to session.

    It is 0 for a reported current, whose mean is torque, and without such a motion.

    Parameters
    ----------
    run, axis
        Open run, and axis counted from 1.
    motions
        Start and stop of each, in samples (half-open), and its highest frequency, Hz.
    wanted
        See `read_course`.
    """
    if envelope_kind(run.path, run.channels(axis), wanted) == "reported":
        return 0j
    some = motions[:: -(-len(motions) // OFFSET_MOTIONS) or 1]
    vectors = ((read_current(run, axis, start, stop, wanted), hz) for start, stop, hz in some)
    return mean_over_turns(vectors, run.sampling_rate_hz)


def read_envelope(
    run: Run,
    axis: int,
    start: int,
    stop: int,
    wanted: EnvelopeKind = "auto",
    offset: complex = 0j,
) -> npt.NDArray[np.floating]:
    """Read the current of an axis and return its envelope over start..stop.

    See `read_course` for what is read.
    """
    return np.asarray(np.abs(read_course(run, axis, start, stop, wanted, offset)))


def read_course(
    run: Run,
    axis: int,
    start: int,
    stop: int,
    wanted: EnvelopeKind = "auto",
    offset: complex = 0j,
) -> npt.NDArray[np.floating]:
    """Read the current of an axis whose course over start..stop repeats with the motion.

    Parameters
    ----------
    run, axis
        Open run, and axis counted from 1.
    start, stop
        Half-open interval of samples; what lies outside the run is left out.
    wanted
        Which current it is taken from, see `PatternsConfig.envelope`.
    offset
        Taken off the current vector first, A; see `current_offset`.

    Returns
    -------
    array
        Shape (stop - start,), A, in the run's own float width: the envelope of phase currents,
        the reported current itself with its sign.

    Raises
    ------
    InputError
        If the axis lacks the current that is wanted.
    """
    current = read_current(run, axis, start, stop, wanted)
    return course_of(current - current.dtype.type(offset) if offset else current)


def course_of(current: npt.NDArray[Any]) -> npt.NDArray[np.floating]:
    """Return the envelope of a current vector; a reported current as it is."""
    return np.asarray(envelope(current)) if np.iscomplexobj(current) else current


def read_current(
    run: Run, axis: int, start: int, stop: int, wanted: EnvelopeKind = "auto"
) -> npt.NDArray[Any]:
    """Read the current vector of an axis, or its signed reported current; see `read_course`.

    Returns
    -------
    array
        Shape (stop - start,), A: the Clarke vector or analytic signal (complex) where phases
        are known, the reported current (real) else.

    Raises
    ------
    InputError
        If the axis lacks the current that is wanted.
    """
    start, stop = max(start, 0), min(stop, run.n_samples)
    channels = run.channels(axis)
    kind = envelope_kind(run.path, channels, wanted)
    if kind == "clarke":
        phases = run.read(channels.phases, start, stop)
        return clarke(*(phases[name] for name in channels.phases))
    if kind == "hilbert":
        guard = round(GUARD_S * run.sampling_rate_hz)
        first = max(start - guard, 0)
        name = channels.phases[0]
        current = run.read([name], first, stop + guard)[name]
        return analytic_signal(current)[start - first : stop - first]
    assert channels.current is not None
    return run.read([channels.current], start, stop)[channels.current]
