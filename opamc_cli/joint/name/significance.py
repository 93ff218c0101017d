"""How sure it is that an effect does something, and what it does to a residual of chance."""

import numpy as np
from scipy.special import stdtr

from opamc_cli.joint.fit.model import Fit, Term
from opamc_cli.joint.fit.parts import Sums
from opamc_cli.joint.motion.track import Floats

LEAST_T = 2.0
"""A difference over its standard error, over parts of the open data, that is none below it."""
DECOYS = 5


def paired(before: Floats, after: Floats) -> tuple[float, float]:
    """Difference of two chains' held-out errors, and its standard error over the parts."""
    difference = after - before
    return float(difference.sum()), float(np.std(difference, ddof=1) * np.sqrt(difference.size))


def p_value(t_value: float, n_parts: int) -> float:
    """Probability of such a t where the effect does nothing."""
    return float(stdtr(max(n_parts - 1, 1), -t_value))


def decoy_gain(fit: Fit, term: Term, seed: int) -> float:
    """Largest held-out gain of an effect on a fit's residual with half of its units turned.

    Share of the residual's sum of squares; mostly below 0.
    """
    dataset = fit.dataset
    fine, _ = dataset.parts
    columns = fine.taken(dataset.columns(term, fine=True))
    residual = fit.residual_a[fine.rows][:, None]
    gram = fine.products(columns, columns)
    moment = fine.products(columns, residual)[:, :, 0]
    power = fine.products(residual, residual)[:, 0, 0]
    draw = np.random.default_rng(seed)
    gains = []
    for _ in range(DECOYS):
        signs = draw.permutation(np.resize([-1.0, 1.0], fine.units))[fine.unit]
        left = Sums(gram, moment * signs[:, None], power, fine, np.zeros(gram.shape[-1])).held_out()
        gains.append(1.0 - float(left.sum()) / max(float(power.sum()), 1e-300))
    return max(gains)
