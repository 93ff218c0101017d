"""Explanations that the data cannot tell apart."""

from collections.abc import Sequence

from opamc_cli.joint.name.chain import Chain
from opamc_cli.joint.name.search import Trial
from opamc_cli.joint.name.significance import LEAST_T, paired


def ties_of(best: Chain, name: str, others: Sequence[Trial]) -> tuple[str, ...]:
    """Return the effects that in the place of one leave no surely larger held-out error."""
    found = []
    for other in others:
        difference, error = paired(best.deviation, other.chain.deviation)
        if other.why_not is None and difference <= LEAST_T * error:
            found.append(other.term.effect.name)
    return tuple(other for other in dict.fromkeys(found) if other != name)
