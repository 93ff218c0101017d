"""What one fit computes and the next needs again: regressors and their products."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from opamc_cli.joint.normal import Normal, extended
from opamc_cli.joint.track import Floats, Track


class Kept:
    """Regressors of the latest fit's terms on one session's grids.

    A joint that lacks a dozen effects is fitted fifty times; from one fit to the next a single
    term is new, and only what follows the fitted load changes. Entries are recognised by
    identity: of the term, and of the track where the regressors follow what was fitted.

    Parameters
    ----------
    storing : bool
        False where a session is fitted once: nothing is kept, which takes a fraction of the memory.
    """

    def __init__(self, storing: bool = True) -> None:
        self.storing = storing
        self._terms: dict[int, object] = {}
        self._columns: dict[tuple[int, bool], tuple[Track | None, Floats]] = {}
        self._products: tuple[tuple[Floats, ...], Normal] | None = None

    def clear(self) -> None:
        """Forget everything; it is computed again where it is asked for."""
        self.keep(())
        self._products = None

    def keep(self, terms: Sequence[object]) -> None:
        """Name the terms whose regressors are worth keeping; forget those of all others."""
        self._terms = {id(term): term for term in terms} if self.storing else {}
        self._columns = {key: kept for key, kept in self._columns.items() if key[0] in self._terms}

    def columns(
        self,
        term: object,
        fine: bool,
        follows: Track | None,
        compute: Callable[[Floats | None], Floats],
    ) -> Floats:
        """Regressors of a term, computed where they are not at hand.

        Parameters
        ----------
        term : Term
            Kept if it was named to `keep`.
        fine : bool
            Which grid.
        follows : Track or None
            The track whose fitted model the regressors follow, None where they follow none.
        compute : callable
            Makes them, from those that followed another model if there are any.
        """
        key = (id(term), fine)
        found = self._columns.get(key) if key[0] in self._terms else None
        if found is not None and found[0] is follows:
            return found[1]
        columns = compute(None if found is None else found[1])
        if key[0] in self._terms:
            self._columns[key] = (follows, columns)
        return columns

    def products(
        self, blocks: Sequence[Floats], signal: Floats, rows: Sequence[NDArray[np.int64]]
    ) -> Normal:
        """Sum products per group of the fine grid, starting from those of the call before.

        Parameters
        ----------
        blocks : sequence of arrays of shape (n, k)
            Regressors, term by term.
        signal : array of shape (n,)
            The same in every call.
        rows : sequence of int arrays
            Samples of each group, the same in every call.
        """
        places: dict[int, int] = {}
        known: Normal | None = None
        if self._products is not None:
            before, known = self._products
            place = 0
            for block in before:
                places[id(block)] = place
                place += block.shape[1]
        found = [places.get(id(block)) for block in blocks]
        normal = extended(known, found, blocks, signal, rows)
        self._products = (tuple(blocks), normal)
        return normal
