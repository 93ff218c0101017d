"""Whether an effect that does the same to everything that was fitted really does so."""

import numpy as np
from scipy.stats import chi2

from opamc_cli.joint.model import Term
from opamc_cli.joint.normal import solve
from opamc_cli.joint.span import orthonormal_beside
from opamc_cli.joint.track import Floats, averaged
from opamc_cli.joint.view import View

LARGEST_SHARE = 0.3
"""Of the candidate's likelihood. Delays of 40 simulated joints left up to 0.2 to their parts, where
they were large enough to be found; ripple and ringing that look like a delay leave 0.8."""
LARGEST_P = 1e-3
SLOW_S = 0.15
"""What a moving average of this length leaves is the commanded motion, what it takes vibration."""
LARGEST_Z = 5.0
"""Of the difference of slow and fast; for the same delays at most 2, once 4."""
LARGEST_DIFFERENCE = 0.5


def disagreement(view: View, term: Term) -> str | None:
    """Say that the parts of an effect do not agree, or None where they do or there are none.

    A delay of the current delays inertia, gravity and friction alike, slow motion and vibration.
    What moves the joint without the drive's asking, such as a kinematic error, has a current that
    follows the motion late or early, while gravity and the commanded motion are on time.

    Parameters
    ----------
    view : View
        Residual of a model that does not hold the term, on the grid on which it is searched.
    term : Term
        The effect with its parameters.
    """
    if not term.effect.same_for_all:
        return None
    parts = term.effect.parts(view.grid.track, term.parameters)
    if _differs_by_regressor(view, parts):
        return "what the model holds does not agree on it: each regressor would have one of its own"
    if _differs_by_pace(view, parts.sum(axis=1)):
        return "slow motion does not have it, or not as vibration has it"
    return None


def _differs_by_regressor(view: View, parts: Floats) -> bool:
    columns = view.whitened_rows(parts)
    whole = orthonormal_beside(columns.sum(axis=1, keepdims=True), view.span)
    each = orthonormal_beside(columns, np.concatenate([view.span, whole], axis=1))
    if not each.shape[1]:
        return False
    together = float(np.sum((whole.T @ view.values) ** 2))
    apart = float(np.sum((each.T @ view.values) ** 2))
    rest = max(view.power - together - apart, 1e-12 * view.power)
    variance = rest / view.freedom(columns.shape[1])
    by_chance = float(chi2.sf(apart / variance, each.shape[1]))
    return by_chance < LARGEST_P and apart > LARGEST_SHARE * together


def _differs_by_pace(view: View, whole: Floats) -> bool:
    track = view.grid.track
    length = int(SLOW_S * track.rate_hz) | 1
    slow = averaged(whole, track.bounds, np.ones(length) / length)
    columns = view.whitened_rows(np.stack([slow, whole - slow], axis=1))
    columns = columns - view.span @ (view.span.T @ columns)
    gram = columns.T @ columns
    if np.linalg.cond(gram) > 1e9:
        return False
    sizes = solve(gram, columns.T @ view.values)
    spread = np.linalg.inv(gram)
    variance = float(np.sum((view.values - columns @ sizes) ** 2)) / view.freedom(2)
    difference = abs(float(sizes[0] - sizes[1]))
    error = np.sqrt(variance * (spread[0, 0] + spread[1, 1] - 2 * spread[0, 1]))
    largest = float(np.max(np.abs(sizes)))
    return bool(difference > LARGEST_Z * error and difference > LARGEST_DIFFERENCE * largest)
