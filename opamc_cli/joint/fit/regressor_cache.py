"""What fits of the same recordings share: regressors that do not follow the model, and products."""

from collections.abc import Callable, Hashable, Sequence

import numpy as np

from opamc_cli.joint.fit.parts import Parts, Sums
from opamc_cli.joint.motion.track import Floats, ranges

MOST_BYTES = 200e6
"""Regressors that are kept, with their rows in parts; a dataset has 1 GB for everything."""


class RegressorCache:
    """Regressors by term, and sums of products by pair of regressor arrays: most are met again."""

    def __init__(self) -> None:
        self.laid: dict[Hashable, Floats] = {}
        self.clear()

    def clear(self) -> None:
        """Forget everything; it is computed again where it is asked for."""
        self.laid.clear()  # which tracks share
        # The load and the model, (n,) each, that sets of terms which follow them were fitted with.
        self.settled: dict[Hashable, tuple[Floats, Floats]] = {}
        self._taken: dict[tuple[int, bool, int], tuple[Floats, Floats]] = {}
        self._products: dict[tuple[int, int, bool], Floats] = {}
        self._currents: dict[bool, Floats] = {}
        self._grown = False

    def columns(self, key: Hashable, compute: Callable[[], Floats]) -> Floats:
        """Regressors of a term, computed where they are not at hand."""
        if key not in self.laid:
            self.laid[key] = compute()
        return self.laid[key]

    def sums(self, blocks: Sequence[Floats], current: Floats, parts: Parts, fine: bool) -> Sums:
        """Sum products of regressors, term by term (n, k), over parts.

        Of one grid, current, shape (n,), and parts are the same in every call.
        """
        self._bounded()
        every = [*blocks, self._currents.setdefault(fine, current[:, None])]
        for i, block in enumerate(every):
            missing = [
                other
                for other in every[: i + 1]
                if (id(other), id(block), fine) not in self._products
            ]
            others = [self.rows(other, parts, fine) for other in missing]
            products = parts.products_of(others, self.rows(block, parts, fine))
            for other, product in zip(missing, products, strict=True):
                self._products[id(other), id(block), fine] = product
                self._products[id(block), id(other), fine] = np.swapaxes(product, 1, 2)
        spans = ranges(block.shape[1] for block in every)
        whole = np.empty((len(parts.slices), spans[-1][1], spans[-1][1]))
        for block, (start, stop) in zip(every, spans, strict=True):
            for other, (first, last) in zip(every, spans, strict=True):
                whole[:, first:last, start:stop] = self._products[id(other), id(block), fine]
        ridge = np.zeros(whole.shape[1] - 1)
        return Sums(whole[:, :-1, :-1], whole[:, :-1, -1], whole[:, -1, -1], parts, ridge)

    def rows(self, block: Floats, parts: Parts, fine: bool, every: int = 1) -> Floats:
        """Return the parts' rows of a regressor array, or one in `every` of them.

        Where the array begins with them it is itself: each regressor is contiguous.
        """
        key = (id(block), fine, every)
        if key not in self._taken:
            rows = block if every == 1 and len(block) < parts.size else parts.taken(block)
            rows = rows if every == 1 else np.asfortranarray(rows[::every])
            # The block itself is kept beside its rows, so that its identity stays its own.
            self._taken[key] = (block, rows)
            self._grown = True
        return self._taken[key][1]

    def _bounded(self) -> None:
        """Forget what follows the model, which nothing meets again; all where it is too much."""
        if not self._grown:
            return  # half of a search asks for what is there: to look again took a tenth of it
        self._grown = False
        kept = {id(block) for block in (*self.laid.values(), *self._currents.values())}
        # Products are known by their blocks. To look through all of them took a sixth of a cause.
        if not kept.issuperset(key[0] for key in self._taken):
            self._taken = {key: pair for key, pair in self._taken.items() if key[0] in kept}
            pairs = [key for key in self._products if kept.issuperset(key[:2])]
            self._products = {key: self._products[key] for key in pairs}
        fitted = (one for pair in (*self._taken.values(), *self.settled.values()) for one in pair)
        # Rows may be a view of the block, and both of what was computed.
        every = (*self.laid.values(), *fitted)
        owners = (block if block.base is None else block.base for block in every)
        if sum({id(one): one.nbytes for one in owners}.values()) > MOST_BYTES:
            self.clear()
