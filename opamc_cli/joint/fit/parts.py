"""Samples in parts: what is left out together, what is judged, and sums of products over each."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from opamc_cli.joint.motion.track import Bools, Floats, Ints, ranges
from opamc_cli.signal.transform.least_squares import inverse
from opamc_cli.signal.transform.products import products_over

FEWEST_UNITS = 8
"""Units that are left out in turn: fewer groups than that are halved until they suffice."""
ROUNDING = 1e-12
"""Share of a sum of products below which a difference of two is their rounding."""
PARTS_PER_UNIT = 4
"""So many drops per unit make the standard error of a drop: 9 units have 36."""
BOTH_WAYS = 0.25
"""Share of a stretch of time that moves the one way, and the other: nearly two strokes."""
FEWEST_STRETCHES = 4
"""With fewer there is next to no drift to tell from anything; halves of units are taken."""


@dataclass(frozen=True)
class Parts:
    """Open samples of one grid, part after part."""

    rows: Ints
    """Places on the grid; int array of shape (m,)."""
    slices: tuple[tuple[int, int], ...]
    """Half-open range of each part among the rows."""
    unit: Ints
    """Unit that each part belongs to; a unit is left out as one; int array of shape (p,)."""
    judged: Bools
    """Parts whose error counts; all are fitted; bool array of shape (p,)."""
    size: int = 0
    """Samples of the grid; a block of fewer begins with the parts' rows."""

    def taken(self, block: Floats) -> Floats:
        """Return the parts' rows of a block."""
        if block.shape[0] < self.size:
            return block[: self.rows.size]
        # Each regressor stays contiguous.
        return np.asarray(np.take(block.T, self.rows, axis=-1).T)

    @property
    def units(self) -> int:
        """Number of units."""
        return int(self.unit.max()) + 1 if self.unit.size else 0

    @cached_property
    def edges(self) -> Ints:
        """The slices as an array, (p, 2)."""
        return np.array(self.slices, dtype=np.int64).reshape(-1, 2)

    @cached_property
    def counts(self) -> Floats:
        """Samples of each part; (p,)."""
        return np.diff(self.edges)[:, 0].astype(float)

    @cached_property
    def others(self) -> Floats:
        """1 where a part is of another unit, else 0; (units, p)."""
        return np.asarray(np.arange(self.units)[:, None] != self.unit, dtype=float)

    @property
    def halves(self) -> Ints:
        """Half of a unit that each part belongs to, counted over all units."""
        first = np.searchsorted(self.unit, self.unit)
        size = np.searchsorted(self.unit, self.unit, side="right") - first
        half: Ints = 2 * self.unit + (2 * (np.arange(self.unit.size) - first) >= size)
        return np.unique(half, return_inverse=True)[1]

    def stretches(self, direction: Floats) -> Ints:
        """Stretch of time that each part lies in: half a unit, or as long as it moves both ways.

        Where a half is one stroke friction is an offset, and no drift. A single stroke has halves.
        The direction is the sign of the speed on the grid, shape (n,).
        """
        halves = self.halves
        starts = [start for start, _ in self.slices]
        taken = direction[self.rows]
        forth, back = (
            _summed(np.add.reduceat(taken * way > 0, starts, dtype=float), halves)
            for way in (1, -1)
        )
        place, both = 0, np.zeros(2)
        stretch = np.zeros(int(halves.max()) + 1, dtype=np.int64)
        for half, moved in enumerate(np.stack([forth, back], axis=1)):
            stretch[half] = place
            both = both + moved
            if both.min() >= BOTH_WAYS * both.sum():
                place, both = place + 1, np.zeros(2)
        if place < FEWEST_STRETCHES:
            return halves
        return np.asarray(np.minimum(stretch, place - 1)[halves])

    def elsewhere(self, values: Floats) -> Floats:
        """Sum parts' values, shape (p, ...), over all units but each one."""
        sums = self.others @ values.reshape(len(values), -1)
        return np.asarray(sums.reshape(self.units, *values.shape[1:]))

    def products(self, left: Floats, right: Floats) -> Floats:
        """Sum ``left.T @ right`` over each part, shape (p, k, m); both hold the parts' rows."""
        return self.products_of([left], right)[0]

    def products_of(self, lefts: Sequence[Floats], right: Floats) -> list[Floats]:
        """Likewise for several."""
        return [products_over(self.edges, left, right) for left in lefts]


def parts_of(groups: Sequence[Ints], clear: Bools) -> Parts:
    """Cut groups of samples, given by their places, into units, and units into parts.

    What is `clear`, a bool array of shape (n,), is judged.
    """
    groups = [rows for rows in groups if rows.size]
    cuts = -(-FEWEST_UNITS // max(len(groups), 1))
    units = [piece for rows in groups for piece in np.array_split(rows, cuts) if piece.size]
    pieces = [
        (piece[clear[piece] == kind], number, kind)
        for number, members in enumerate(units)
        for piece in np.array_split(members, PARTS_PER_UNIT)
        for kind in (True, False)
    ]
    rows, unit, judged = zip(*(piece for piece in pieces if piece[0].size), strict=True)
    slices = ranges(map(len, rows))
    return Parts(np.concatenate(rows), slices, np.array(unit), np.array(judged), clear.size)


def whole_parts(groups: Sequence[Ints], size: int = 0) -> Parts:
    """Take groups of samples, given by their places among `size`, as one part each."""
    numbers = np.arange(len(groups))
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *groups])
    return Parts(rows, ranges(map(len, groups)), numbers, numbers >= 0, size)


@dataclass(frozen=True)
class Sums:
    """Products of regressors with themselves and with the current, over each part."""

    gram: Floats
    moment: Floats
    power: Floats
    parts: Parts
    ridge: Floats
    """Share of each regressor's size that a fit adds to it; (k,)."""

    def damped(self, gram: Floats) -> Floats:
        """Add the ridge to products, shape (..., k, k)."""
        sizes = self.ridge * np.diagonal(gram, axis1=-2, axis2=-1)
        return np.asarray(gram + sizes[..., None] * np.eye(gram.shape[-1]))

    def without_drift(self, stretches: Ints) -> "Sums":
        """Allow the current another offset in each stretch, (p,) as `Parts.stretches` tells.

        The last regressor has to be ones; the parts of what is returned are the stretches, without
        rows.
        """
        count = int(stretches.max()) + 1
        gram, moment, power = (
            _summed(values, stretches) for values in (self.gram, self.moment, self.power)
        )
        number = np.maximum(gram[:, -1, -1], 1.0)
        own, total, mean = gram[:, :-1, :-1], gram[:, :-1, -1], moment[:, -1] / number
        left = own - np.einsum("pi,pj,p->pij", total, total, 1 / number)
        # Of what is an offset in every half only rounding is left, of any sign.
        size, whole = (np.diagonal(one, axis1=1, axis2=2) for one in (left, own))
        varies = size > ROUNDING * whole
        unit = np.zeros(count, dtype=np.int64)
        unit[stretches[::-1]] = self.parts.unit[::-1]
        unit = np.unique(unit, return_inverse=True)[1]
        none = np.zeros(0, dtype=np.int64)
        parts = Parts(none, ((0, 0),) * count, unit, np.ones(count, dtype=bool))
        return Sums(
            left * (varies[:, :, None] & varies[:, None, :]),
            (moment[:, :-1] - total * mean[:, None]) * varies,
            power - number * mean**2,
            parts,
            self.ridge[:-1],
        )

    def less_last(self) -> "Sums":
        """Take the last regressor, as large as it is, out of the current."""
        among = self.gram[:, :, -1]
        power = self.power - 2 * self.moment[:, -1] + among[:, -1]
        moment = (self.moment - among)[:, :-1]
        return Sums(self.gram[:, :-1, :-1], moment, power, self.parts, self.ridge[:-1])

    @cached_property
    def inverses(self) -> Floats:
        """Pseudo-inverse of the products outside each unit, shape (units, k, k)."""
        rest = self.parts.elsewhere(self.gram)
        sizes = np.diagonal(rest, axis1=1, axis2=2)
        # What only one unit excites is nothing but rounding outside of it, of any sign.
        excited = sizes > ROUNDING * np.diagonal(self.gram.sum(axis=0))
        return inverse(self.damped(rest * (excited[:, :, None] & excited[:, None, :])))

    @cached_property
    def coefficients(self) -> Floats:
        """Fit to all units but each one, shape (units, k)."""
        return np.asarray(np.einsum("uij,uj->ui", self.inverses, self.parts.elsewhere(self.moment)))

    def held_out(self) -> Floats:
        """Sum of squared errors of each part, of the fit to all units but its own; shape (p,)."""
        return self.left(self.coefficients[self.parts.unit])

    def left(self, coefficients: Floats) -> Floats:
        """Sum of squared errors of each part, (p,), with given coefficients, (k,) or (p, k)."""
        predicted = (self.gram @ coefficients[..., None])[..., 0]
        square = np.sum(coefficients * (predicted - 2 * self.moment), axis=-1)
        return np.asarray(np.maximum(self.power + square, ROUNDING * self.power))


def _summed(values: Floats, places: Ints) -> Floats:
    """Sum parts' values over each place; places ascend from 0, and none is left out."""
    return np.asarray(np.add.reduceat(values, np.flatnonzero(np.diff(places, prepend=-1)), axis=0))
