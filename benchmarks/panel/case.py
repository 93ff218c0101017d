"""What a source of the panel hands to the contestants."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SIZES = (0.3, 0.6, 1.5, 5.0, 15.0)
RIGID = ("inertia", "gravity", "coulomb", "viscous")


@dataclass(frozen=True)
class Logged:
    """One recording of one joint as logged, shape (n,) or (n, 3) each; None what was not."""

    rate_hz: float
    current: Floats | None = None
    phases: Floats | None = None
    position: Floats | None = None
    velocity: Floats | None = None
    temperature: Floats | None = None
    others: dict[int, Floats] = field(default_factory=dict)
    """Positions of the arm's other joints by axis."""


@dataclass(frozen=True)
class Case:
    """A row of the panel.

    Attributes
    ----------
    source, name, stroke, sensing : str
        Where it is from, and what it is; sensing is "position" or "phases".
    declared : tuple of str
        Effects that the model has.
    hidden : str or None
        Effect that has to be found; empty where nothing lacks, None where nobody knows.
    present : tuple of str
        Effects that are there besides: not wrong, not asked for.
    size : float or None
        Of the hidden effect, in units of the noise.
    gear : tuple of (float, int) or None
        Gear ratio and pole pairs, where the contestants may know them.
    make : callable
        Records. Raises ValueError where the case cannot be made.
    """

    source: str
    name: str
    stroke: str
    sensing: str
    declared: tuple[str, ...]
    hidden: str | None
    make: Callable[[], list[Logged]] = field(compare=False)
    present: tuple[str, ...] = ()
    size: float | None = None
    gear: tuple[float, int] | None = None
    seed: int = 0


@dataclass(frozen=True)
class Wanted:
    """Which cases are asked for; empty means all."""

    sizes: tuple[float, ...] = SIZES
    effects: tuple[str, ...] = ()
    strokes: tuple[str, ...] = ()
    sensing: tuple[str, ...] = ()

    def turn(self, place: int) -> float:
        """Take the sizes in turn, so that every effect meets every size as seeds go on."""
        return self.sizes[place % len(self.sizes)]

    def chosen(self, cases: Iterable[Case]) -> list[Case]:
        """Keep what is asked for; `none` stands for nothing hidden."""
        return [
            case
            for case in cases
            if (not self.effects or (case.hidden or "none") in self.effects)
            and (not self.strokes or case.stroke in self.strokes)
            and (not self.sensing or case.sensing in self.sensing)
        ]
