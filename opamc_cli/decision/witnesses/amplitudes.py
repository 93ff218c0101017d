"""Distance between recording sessions by how large their current is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.significance.spread import Spread
from opamc_cli.decision.witnesses.departure import Block
from opamc_cli.decision.witnesses.deviation import (
    change_between,
    change_beyond_noise,
    chosen,
    clearest_of,
)
from opamc_cli.decision.witnesses.evidence import Kind

FloatArray = NDArray[np.float64]

SIZES = ("root mean square", "roughness", "mean size")
"""What the three numbers are called; roughness is the rms of successive samples' differences."""

LEAST_VARIANCE = 1e-6
"""Of a log amplitude: sessions that agree to a thousandth agree."""


@dataclass(frozen=True)
class AmplitudeCell:
    """Log amplitudes of one motion by session."""

    motion: int
    """What they are of."""
    sessions: FloatArray
    """Mean over each session's cycles, baseline first; NaN where nothing is known; shape (B + T,
    3)."""
    cycles: FloatArray
    """Cycles that each mean is of; shape (B + T,)."""
    within: FloatArray
    """Variance of a single cycle about its session's mean; NaN if unknown; shape (3,)."""


@dataclass(frozen=True)
class AmplitudeEvidence:
    """Distance by rms, rms of successive differences and mean size of the current."""

    cells: Sequence[AmplitudeCell]
    """All motions of one axis."""
    n_baseline: int
    """Number of baseline sessions."""
    kinds: ClassVar[Sequence[Kind]] = ("score",)
    healthy_spread: ClassVar[Spread] = Spread(1.0, 1.0)
    """Not asked: it has no distance beyond."""
    weight: ClassVar[float] = 1.0
    tells_conditions: ClassVar[bool] = False
    depends_on_conditions: ClassVar[bool] = False

    def blocks(self) -> list[Block]:
        """Return the log amplitudes of each motion."""
        return [
            Block(cell.sessions, cell.cycles, cell.within, LEAST_VARIANCE) for cell in self.cells
        ]

    def effect(self) -> float:
        """Return the root-mean-square change of the log amplitudes beyond the baseline's own."""
        excess = []
        for cell in self.cells:
            change, variance = change_between(cell.sessions, self.n_baseline)
            known = np.isfinite(variance)
            if known.any():
                excess.append(float((change[known] ** 2 - variance[known]).mean()))
        return math.sqrt(max(float(np.mean(excess)), 0.0)) if excess else math.nan

    def change(self) -> float:
        """Return the root-mean-square change beyond the noise of cycles."""
        return change_beyond_noise(
            [(cell.sessions, cell.cycles, cell.within) for cell in self.cells], self.n_baseline
        )

    def of_sessions(self, baseline: Sequence[int], target: Sequence[int]) -> "AmplitudeEvidence":
        """Return the evidence with some of its sessions as the baseline and some as the target."""
        cells = chosen(self.cells, ("sessions", "cycles"), [*baseline, *target])
        return replace(self, cells=cells, n_baseline=len(baseline))


@dataclass(frozen=True)
class AmplitudeChange:
    """Which of the sizes of the current has changed most clearly."""

    motion: int
    """In which motion."""
    size: str
    """Which size of it."""
    ratio: float
    """Over the baseline's."""


def clearest_amplitude(cells: Sequence[AmplitudeCell], n_baseline: int) -> AmplitudeChange | None:
    """Find the motion and the size of its current whose change stands out most.

    Parameters
    ----------
    cells : sequence of AmplitudeCell
        All motions of one axis.
    n_baseline : int
        Number of baseline sessions.

    Returns
    -------
    AmplitudeChange or None
        None for fewer than two baseline sessions.
    """
    found = clearest_of([cell.sessions for cell in cells], n_baseline, LEAST_VARIANCE)
    if found is None:
        return None
    number, which, change, _ = found
    return AmplitudeChange(cells[number].motion, SIZES[which], math.exp(change))
