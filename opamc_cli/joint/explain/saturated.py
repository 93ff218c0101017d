"""How much of a residual can be explained at all, before anything has a name."""

from dataclasses import dataclass, replace

import numpy as np

from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.explain.lines import AngleLine, Links, Tone
from opamc_cli.joint.explain.unnamed import SMOOTH, Presliding, Response, Shift
from opamc_cli.joint.fit.model import Fit
from opamc_cli.joint.motion.track import Floats
from opamc_cli.joint.name.chain import PRICE, Chain
from opamc_cli.joint.name.search import MOST_STEPS, Pool, beam

LINKS = Links()
SEALED_PARTS = 12


@dataclass(frozen=True)
class Ceiling:
    """Share of the sealed mean square error that can be explained without a name."""

    share: float
    """At least 0."""
    standard_error: float
    """Over parts of the sealed data."""

    @property
    def certain(self) -> bool:
        """Whether there is anything to explain."""
        return self.share > 2 * self.standard_error and self.share > PRICE


def unnamed_library() -> dict[str, Effect]:
    """Everything that a residual can be explained by without a name."""
    effects = (*SMOOTH, Presliding(), Response(), Shift(), AngleLine(), Tone())
    return {effect.name: effect for effect in effects}


def saturated(start: Chain, pool: Pool, steps: int = MOST_STEPS) -> Chain:
    """Explain what the declared model leaves by a pool of unnamed functions, as `beam`."""
    return beam(start, replace(pool, least_share=PRICE), 1, steps)


def with_links(pool: Pool) -> Pool:
    """Put what an arm's other joints ask beside functions of the joint's own motion."""
    return replace(pool, library={**pool.library, LINKS.name: LINKS})


def saturations(start: Chain, pool: Pool) -> list[Chain]:
    """Explain by a pool of unnamed functions, and where others are logged beside links, too."""
    alone = LINKS.untestable(start.fit.dataset.fine.track)
    return [saturated(start, one) for one in ([pool] if alone else [pool, with_links(pool)])]


def ceiling(before: Fit, explained: Fit) -> Ceiling:
    """Hold the saturated model, fitted to the open data, against the sealed data, once."""
    first, last = sealed_parts(before), sealed_parts(explained)
    total = max(float(first.sum()), 1e-300)
    drop = first - last
    spread = float(np.std(drop, ddof=1)) * np.sqrt(drop.size) if drop.size > 1 else 0.0
    return Ceiling(max(float(drop.sum()) / total, 0.0), float(spread) / total)


def sealed_parts(fit: Fit) -> Floats:
    """Sum of squared errors over each of the parts that the sealed samples are cut into."""
    found = fit.opened.judged
    values = found.residual_a[found.sealed]
    pieces = np.array_split(values, min(SEALED_PARTS, max(values.size, 1)))
    return np.array([float(piece @ piece) for piece in pieces])
