"""What an effect costs: every degree of freedom has to earn its keep."""

from opamc_cli.joint.model import Term

PRICE = 0.02
"""Logarithm of the held-out mean square error per degree of freedom: 2 % of the error."""
MOST_CHARGED = 16
"""Coefficients of one effect that are charged: of a drive's answer in thirty, the held-out error
itself charges for those that are of no use."""


def price_of(term: Term, width: int) -> float:
    """Price of a term: the effect, its coefficients and its searched parameters, alike.

    Parameters
    ----------
    term : Term
        With its parameters.
    width : int
        Coefficients.
    """
    charged = width if term.effect.unnamed else min(width, MOST_CHARGED)
    return PRICE * (1 + charged + term.effect.searched(term.parameters))
