"""What an effect costs: every degree of freedom has to earn its keep."""

from opamc_cli.joint.model import Term

PRICE = 0.02
"""Logarithm of the held-out mean square error per degree of freedom: 2 % of the error."""


def price_of(term: Term, width: int) -> float:
    """Price of a term: the effect, its coefficients and its searched parameters, alike.

    Parameters
    ----------
    term : Term
        With its parameters.
    width : int
        Coefficients.
    """
    return PRICE * (1 + width + term.effect.searched(term.parameters))
