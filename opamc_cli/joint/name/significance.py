"""What an effect takes off a residual that is none of its own."""

import numpy as np

from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.fit.parts import Sums
from opamc_cli.joint.name.chain import Chain

DECOYS = 5


def decoy_gain(chain: Chain, term: Term, seed: int) -> float:
    """Largest held-out gain of an effect on a chain's residual with random signs of its units.

    Parameters
    ----------
    chain : Chain
        Without the effect.
    term : Term
        The effect with its parameters.
    seed : int
        Of the signs.

    Returns
    -------
    float
        Share of the residual's sum of squares; mostly below 0.
    """
    session = chain.fit.session
    fine, _ = session.parts
    columns = fine.taken(session.columns(term, fine=True))
    residual = fine.taken(chain.fit.residual_a)[:, None]
    gram = fine.products(columns, columns)
    moment = fine.products(columns, residual)[:, :, 0]
    power = fine.products(residual, residual)[:, 0, 0]
    draw = np.random.default_rng(seed)
    gains = []
    for _ in range(DECOYS):
        signs = draw.choice([-1.0, 1.0], size=fine.units)[fine.unit]
        left = Sums(gram, moment * signs[:, None], power, fine).held_out()
        gains.append(1.0 - float(left.sum()) / max(float(power.sum()), 1e-300))
    return max(gains)
