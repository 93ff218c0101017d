"""Distance between recording sessions by the short-time spectra of their envelopes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.significance.spread import Spread
from opamc_cli.decision.witnesses.departure import Block, noise_share
from opamc_cli.decision.witnesses.deviation import change_between, chosen, clearest_of
from opamc_cli.decision.witnesses.evidence import Kind

FloatArray = NDArray[np.float64]

LEAST_VARIANCE = 1e-6
"""Of a log power: sessions that agree to a thousandth of the power agree."""

INFLUENCED_SPREAD = 0.3
"""Expected spread of a healthy session's log distance if cycles have no noise.

A few influences move all parts at once, so that their sum varies; that of many noisy parts hardly
does. Where noise is 0.99, 0.70, 0.37 and 0.13 of the sessions' variance (closed loop, nights of
one, four and sixteen files) the spread is 0.09, 0.15, 0.19 and 0.32; expected is 0.08, 0.14, 0.22
and 0.28.
"""

SPREAD_DOF = 8.0
"""Joints differ from what is expected as if it were known from 15, 12 and 8 sessions (closed loop,
nights of one and of four files) or from many (sixteen files, fleets)."""

PARTS_IN_ONE = 3.0
"""Parts that are worth an independent one, as frames overlap: 2.5 to 5 where noise is all."""


@dataclass(frozen=True)
class SpectrumCell:
    """Log power of one motion's frames and bins, by session."""

    motion: int
    """What it is of."""
    sessions: FloatArray
    """Mean over each session's cycles, baseline first; NaN where nothing is known; shape (B + T,
    F)."""
    cycles: FloatArray
    """Cycles that each mean is of; shape (B + T,)."""
    within: FloatArray
    """Variance of a single cycle about its session's mean, from all sessions; NaN if unknown; shape
    (F,)."""
    frames: int
    bins: int
    """With `frames`: f is their product, frames first."""
    bin_hz: float
    """Frequency of the first bin; bin k lies at k + 1 times it."""
    limited: FloatArray | None = None
    """`sessions` with empty parts limited, by which sessions are told apart; None: the same. How
    large a change is needs no limit."""


@dataclass(frozen=True)
class SpectrumEvidence:
    """Distance by the short-time spectrum of the envelope."""

    cells: Sequence[SpectrumCell]
    """All motions of one axis."""
    n_baseline: int
    """Number of baseline sessions."""
    kinds: ClassVar[Sequence[Kind]] = ("orthogonal",)
    weight: ClassVar[float] = 5.0
    """It finds damage of the teeth long before the others do: see docs/decision.md."""
    tells_conditions: ClassVar[bool] = False
    depends_on_conditions: ClassVar[bool] = False

    @cached_property
    def healthy_spread(self) -> Spread:
        """Expected spread of a healthy session's log distance beyond: the more, the less noise."""
        blocks = self.blocks()
        influenced = INFLUENCED_SPREAD * (1 - noise_share(blocks, self.n_baseline))
        n_parts = max(sum(block.sessions.shape[1] for block in blocks), 1)
        return Spread(math.hypot(influenced, math.sqrt(2 * PARTS_IN_ONE / n_parts)), SPREAD_DOF)

    def blocks(self) -> list[Block]:
        """Return the log powers of each motion's frames and bins."""
        return [
            Block(
                cell.sessions if cell.limited is None else cell.limited,
                cell.cycles,
                cell.within,
                LEAST_VARIANCE,
            )
            for cell in self.cells
        ]

    def effect(self) -> float:
        """Return the relative change of the size of the fluctuations; see `size_effect`."""
        return size_effect(self.cells, self.n_baseline)

    def change(self) -> float:
        """Return NaN: what it knows differs between any two sessions."""
        return math.nan

    def of_sessions(self, baseline: Sequence[int], target: Sequence[int]) -> "SpectrumEvidence":
        """Return the evidence with some of its sessions as the baseline and some as the target."""
        rows = [*baseline, *target]
        cells = chosen(self.cells, ("sessions", "cycles"), rows)
        limited = [
            cell if cell.limited is None else replace(cell, limited=cell.limited[rows])
            for cell in cells
        ]
        return replace(self, cells=limited, n_baseline=len(baseline))


@dataclass(frozen=True)
class BandChange:
    """Where the envelope's fluctuations have changed most clearly."""

    motion: int
    """In which motion."""
    start: float
    stop: float
    """With `start`: part of it, 0 at its beginning and 1 at its end."""
    frequency_hz: float
    """Of the fluctuation."""
    size_ratio: float
    """Its amplitude over the baseline's mean."""


def size_effect(cells: Sequence[SpectrumCell], n_baseline: int) -> float:
    """Relative change of the size of the envelope's fluctuations.

    Parameters
    ----------
    cells : sequence of SpectrumCell
        All motions of one axis.
    n_baseline : int
        Number of baseline sessions.

    Returns
    -------
    float
        Root-mean-square change of the log amplitudes over all motions, frames and bins, beyond
        what the baseline's sessions show; 0.1 is a change by 10 %. NaN for fewer than two
        baseline sessions.
    """
    excess: list[float] = []
    for cell in cells:
        change, variance = change_between(cell.sessions, n_baseline)
        known = np.isfinite(variance)
        if known.any():
            excess.append(float((change[known] ** 2 - variance[known]).mean()))
    # half, because a log power is twice a log amplitude
    return 0.5 * math.sqrt(max(float(np.mean(excess)), 0.0)) if excess else math.nan


def clearest_change(cells: Sequence[SpectrumCell], n_baseline: int) -> BandChange | None:
    """Find the part of a motion and the frequency whose change stands out most.

    Parameters
    ----------
    cells : sequence of SpectrumCell
        All motions of one axis.
    n_baseline : int
        Number of baseline sessions.

    Returns
    -------
    BandChange or None
        None for fewer than two baseline sessions.
    """
    seen = [cell.sessions if cell.limited is None else cell.limited for cell in cells]
    found = clearest_of(seen, n_baseline, LEAST_VARIANCE)
    if found is None:
        return None
    number, place, _, _ = found
    cell = cells[number]
    change = float(change_between(cell.sessions, n_baseline)[0][place])
    frame, bin_number = divmod(place, cell.bins)
    length = 2 / (cell.frames + 1)
    start = frame / max(cell.frames - 1, 1) * (1 - length)
    return BandChange(
        motion=cell.motion,
        start=start,
        stop=start + length,
        frequency_hz=(bin_number + 1) * cell.bin_hz,
        size_ratio=math.exp(0.5 * change),
    )


def typical_ratio(cells: Sequence[SpectrumCell], n_baseline: int) -> float:
    """Size of the fluctuations over the baseline's, the median of all parts and frequencies.

    Motions that a side lacks are passed over; NaN where nothing is known of both.
    """
    changes = np.concatenate([change_between(cell.sessions, n_baseline)[0] for cell in cells])
    known = changes[np.isfinite(changes)]
    return math.exp(0.5 * float(np.median(known))) if known.size else math.nan
