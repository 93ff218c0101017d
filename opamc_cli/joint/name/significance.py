"""How sure it is that an effect does something."""

import numpy as np
from scipy.special import stdtr

from opamc_cli.joint.motion.track import Floats

LEAST_T = 2.0
"""A difference over its standard error, over parts of the open data, that is none below it."""


def paired(before: Floats, after: Floats) -> tuple[float, float]:
    """Difference of two chains' held-out errors, and its standard error over the parts."""
    difference = after - before
    error = np.std(difference, ddof=1) * np.sqrt(difference.size)
    return float(difference.sum()), float(error)


def p_value(t_value: float, n_parts: int) -> float:
    """Probability of such a t where the effect does nothing."""
    return float(stdtr(max(n_parts - 1, 1), -t_value))
