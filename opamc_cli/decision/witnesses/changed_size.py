"""How much of a joint's current has changed, in amperes: by it joints can be held side by side."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.witnesses.deviation import mean_of_known
from opamc_cli.decision.witnesses.evidence import Evidence
from opamc_cli.decision.witnesses.profiles import ProfileEvidence
from opamc_cli.decision.witnesses.spectra import SpectrumEvidence

FloatArray = NDArray[np.float64]

USUAL = 2.0
"""Standard deviations of the baseline's sessions that are no change."""

MEAN_SQUARE = 1 / 3
"""Of a tone's power, summed over bins: of amplitude 1 it is 1 in its own bin and a quarter in
either one beside it (Hann), and its mean square is 1/2."""


def changed_a(witnesses: Mapping[str, Evidence]) -> float:
    """Root mean square of what has changed in the current, slow and fast, beyond what is usual.

    Parameters
    ----------
    witnesses : mapping of str to Evidence
        Of one axis; course and spectrum are asked.

    Returns
    -------
    float
        A, over all motions; NaN where neither knows both sides.
    """
    squares = []
    for witness in witnesses.values():
        if isinstance(witness, ProfileEvidence):
            of_motions = [
                float(np.mean(changed**2))
                for cell in witness.cells
                if (changed := _changed(cell.course * cell.rms_a, witness.n_baseline)).size
            ]
        elif isinstance(witness, SpectrumEvidence):
            of_motions = [
                MEAN_SQUARE * float(changed.sum()) / cell.frames
                for cell in witness.cells
                if (changed := _changed(np.exp(cell.sessions), witness.n_baseline)).size
            ]
        else:
            continue
        squares += [np.mean(of_motions)] if of_motions else []
    return math.sqrt(sum(squares)) if squares else math.nan


def _changed(sessions: FloatArray, n_baseline: int) -> FloatArray:
    """Size of what changed, of parts that both sides know; sessions (B + T, F), baseline first."""
    (own, _), (other, _) = (
        mean_of_known(side) for side in (sessions[:n_baseline], sessions[n_baseline:])
    )
    spread = np.sqrt(mean_of_known((sessions[:n_baseline] - own) ** 2)[0])
    changed = np.maximum(np.abs(other - own) - USUAL * spread, 0.0)
    return changed[np.isfinite(changed)]
