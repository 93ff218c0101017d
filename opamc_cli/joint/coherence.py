"""Whether an effect that does the same to everything that was fitted really does so."""

import numpy as np
from scipy.stats import chi2

from opamc_cli.joint.search import Candidate
from opamc_cli.joint.span import orthonormal_beside
from opamc_cli.joint.view import View

LARGEST_SHARE = 0.3
"""Of the candidate's likelihood. Delays of 40 simulated joints left up to 0.2 to their parts, where
they were large enough to be found; ripple and ringing that look like a delay leave 0.8."""
LARGEST_P = 1e-3


def disagreement(view: View, candidate: Candidate) -> str | None:
    """Say that the parts of an effect do not agree, or None where they do or there are none.

    A delay of the current delays inertia, gravity and friction alike. What moves the joint without
    the drive's asking, such as a kinematic error, has a current that follows the motion late or
    early, while gravity and friction are on time: each part then wants a size of its own.

    Parameters
    ----------
    view : View
        The candidate's.
    candidate : Candidate
        From `search`.
    """
    term = candidate.term
    parts = term.effect.parts(view.grid.track, term.parameters)
    if parts is None or parts.shape[1] < 2:
        return None
    columns = view.whitened_rows(parts)
    whole = orthonormal_beside(columns.sum(axis=1, keepdims=True), view.span)
    each = orthonormal_beside(columns, np.concatenate([view.span, whole], axis=1))
    if not each.shape[1]:
        return None
    together = float(np.sum((whole.T @ view.values) ** 2))
    apart = float(np.sum((each.T @ view.values) ** 2))
    variance = max(view.power - together - apart, 1e-12 * view.power) / view.freedom(
        columns.shape[1]
    )
    by_chance = float(chi2.sf(apart / variance, each.shape[1]))
    if by_chance > LARGEST_P or apart < LARGEST_SHARE * together:
        return None
    return "what the model holds does not agree on it: each part would have one of its own"
