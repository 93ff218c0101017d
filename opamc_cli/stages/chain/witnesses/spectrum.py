"""Second witness: the short-time spectrum of the envelope, or of a reported current."""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.config.models import PatternsConfig
from opamc_cli.decision.witnesses.deviation import variance_within_sessions
from opamc_cli.decision.witnesses.spectra import SpectrumCell, SpectrumEvidence
from opamc_cli.signal.transform.short_time import short_time_log_power
from opamc_cli.stages.chain.witnesses.kept_rows import Names, rows_by_motion
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import SPECTRA

NAME = "spectrum"
FILE_NAME = files.SPECTRA
SCHEMA = SPECTRA

LEAST_LOG_POWER = -1.0
"""Beside the median of all sessions: what is below counts as this."""


def kept(
    course: npt.NDArray[np.floating],
    torque: npt.NDArray[np.floating],
    fs_hz: float,
    config: PatternsConfig,
) -> dict[str, Any]:
    """Return the spectrum of a segment's course; none if it is too short for any.

    Of the current with its sign: its size has a corner wherever it passes zero, which moves with
    friction and fills all bins (docs/decision.md has what each finds).
    """
    del course
    if not config.frames:
        return {}
    power = short_time_log_power(torque, config.frames, config.bins)
    if not power.size:
        return {}
    frames, bins = power.shape
    bin_hz = fs_hz / (2 * torque.size // (frames + 1))
    return {"frames": frames, "bins": bins, "bin_hz": bin_hz, "log_power": power.ravel()}


def evidence(baseline: pa.Table, target: pa.Table, axis: int, names: Names) -> SpectrumEvidence:
    """Average the log power of each session's cycles, for every motion of an axis.

    Where noise is all, power is exponentially distributed, its logarithm is low without bound, and
    a single such part outweighs hundreds: what lies far below the median of all sessions, which
    does not know whose they are, is as good as that.
    """
    cells = []
    for found in rows_by_motion(baseline, target, axis, names, "log_power", ("frames", "bins")):
        # of sessions, not of cycles: the target may have more of these than all of the baseline
        middles = [
            np.median(found.values[found.session == k], axis=0) for k in np.unique(found.session)
        ]
        least = np.median(middles, axis=0) + LEAST_LOG_POWER
        limited = replace(found, values=np.maximum(found.values, least))
        means, counts = found.means()
        cells.append(
            SpectrumCell(
                motion=found.key[0],
                sessions=means,
                cycles=counts,
                # of all sessions: of the baseline's alone it would tell the target from them
                within=variance_within_sessions(limited.values, found.session),
                frames=found.key[1],
                bins=found.key[2],
                bin_hz=found.first["bin_hz"],
                limited=limited.means()[0],
            )
        )
    return SpectrumEvidence(cells, len(names.sessions[0]))
