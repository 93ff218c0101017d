"""How much of its domain's curve an effect's form holds."""

from dataclasses import replace

from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.name.chain import Chain
from opamc_cli.joint.name.search import Pool, trials
from opamc_cli.joint.name.significance import LEAST_T


def share_of_form(best: Chain, drop: float, term: Term, unnamed: Pool) -> float:
    """Share of its domain's curve that the form of an effect of the best chain holds.

    It takes `drop` off the held-out mean square error, in A^2; 1 where no function of the domain
    explains more beside it.
    """
    if term.effect.fast:
        # A line's forms are all that a line can have.
        return 1.0
    library = {
        name: effect
        for name, effect in unnamed.library.items()
        if effect.domain == term.effect.domain and not effect.fast
    }
    tried = trials(best, replace(unnamed, library=library, least_share=0.0))
    better = [one for one in tried if one.t_value > LEAST_T and one.chain.score < best.score]
    more = max([0.0, *(best.mean_square - one.chain.mean_square for one in better)])
    return max(drop, 0.0) / max(drop + more, 1e-300)
