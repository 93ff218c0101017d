"""What the flux axis says: sensor and inverter errors show in it, torque does not."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.model import Session
from opamc_cli.joint.normal import solve
from opamc_cli.joint.track import Floats, Track
from opamc_cli.joint.whitening import autoregression, settled, whitened

LEAST_SHARE = 0.3
"""Amplitude in the flux axis, relative to the torque axis, that makes an effect electrical."""
LEAST_LIKELIHOOD = 20.0
ELECTRICAL_ORDERS = (1, 2, 6)


def objection_of_flux(
    session: Session, effect: Effect, parameters: Parameters, coefficients: Floats
) -> str | None:
    """Say why the flux current speaks against a candidate, or None where it does not.

    Parameters
    ----------
    session : Session
        Recordings.
    effect : Effect
        Candidate.
    parameters : dict
        Its parameters.
    coefficients : array
        Its coefficients in the torque axis.

    Returns
    -------
    str or None
        None too where the phases were not logged.
    """
    track = session.fine.track
    if track.current_d_a is None or track.electrical_rad is None:
        return None
    order = getattr(effect, "electrical_order", None)
    if order is not None:
        size = float(np.linalg.norm(coefficients))
        if not _in_flux(session, _companions(track, order, parameters), size):
            return "the flux current does not hold it, so it is no error of sensor or inverter"
        return None
    if effect.name == "ripple":
        angle = parameters["order"] * track.machine_angle_rad
        turns = _turns(angle, track)
        if turns is not None:
            columns = np.stack([np.cos(angle), np.sin(angle)], axis=1)
            if turns == 2:
                columns = np.concatenate([columns, columns * track.model_a[:, None]], axis=1)
            if _in_flux(session, columns, float(np.linalg.norm(coefficients[:2]))):
                return "the flux current holds it too, so it is no torque"
    return None


def _turns(angle: Floats, track: Track) -> int | None:
    """Electrical order of an angle, where it is one of those that sensors and inverters make."""
    assert track.electrical_rad is not None
    rows = track.moving
    slope = float(
        np.sum(np.diff(angle)[rows[1:]] * np.diff(track.electrical_rad)[rows[1:]])
        / max(np.sum(np.diff(track.electrical_rad)[rows[1:]] ** 2), 1e-300)
    )
    near = round(abs(slope))
    return near if near in ELECTRICAL_ORDERS and abs(abs(slope) - near) < 0.02 * near else None


def _companions(track: Track, order: int, parameters: Parameters) -> Floats:
    """Columns by which the flux current shows an error that the torque current shows."""
    assert track.electrical_rad is not None
    if parameters.get("six_step"):
        steps = np.zeros(track.size)
        for phase in range(3):
            angle = track.electrical_rad - 2 * np.pi * phase / 3
            steps -= 2 / 3 * np.sign(np.cos(angle)) * np.sin(angle)
        return (np.sign(track.model_a) * steps)[:, None]
    angle = order * track.electrical_rad
    weight = {1: np.ones(track.size), 2: track.model_a, 6: np.sign(track.model_a)}[order]
    return np.stack([weight * np.cos(angle), weight * np.sin(angle)], axis=1)


def _in_flux(session: Session, columns: Floats, torque_size: float) -> bool:
    grid = session.fine
    flux = grid.track.current_d_a
    assert flux is not None
    taps = autoregression(flux - float(np.mean(flux[grid.fit])), grid.fit)
    rows = grid.fit & settled(grid.fit, grid.track.bounds, taps.size - 1)
    white = whitened(columns, taps)[rows]
    signal = whitened(flux - float(np.mean(flux[grid.fit])), taps)[rows]
    coefficients = solve(white.T @ white, white.T @ signal)
    fall = float(coefficients @ (white.T @ signal))
    total = float(signal @ signal)
    likelihood = signal.size * np.log(total / max(total - fall, 1e-12 * total))
    size = float(np.linalg.norm(coefficients))
    return bool(likelihood > LEAST_LIKELIHOOD and size > LEAST_SHARE * torque_size)
