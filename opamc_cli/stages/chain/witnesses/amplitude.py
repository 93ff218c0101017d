"""Fourth witness: how large the current of a motion is."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.config.models import PatternsConfig
from opamc_cli.decision.witnesses.amplitudes import AmplitudeCell, AmplitudeEvidence
from opamc_cli.decision.witnesses.deviation import variance_within_sessions
from opamc_cli.signal.amplitude import log_amplitudes
from opamc_cli.stages.chain.witnesses.kept_rows import Names, rows_by_motion
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import AMPLITUDES

NAME = "amplitude"
FILE_NAME = files.AMPLITUDES
SCHEMA = AMPLITUDES


def kept(
    course: npt.NDArray[np.floating],
    torque: npt.NDArray[np.floating],
    fs_hz: float,
    config: PatternsConfig,
) -> dict[str, Any]:
    """Return the log amplitudes of a segment; none if one of its samples is unknown."""
    del torque, fs_hz, config
    amplitudes = log_amplitudes(course)
    return {"parts": amplitudes.size, "log_amplitude": amplitudes} if amplitudes.size else {}


def evidence(baseline: pa.Table, target: pa.Table, axis: int, names: Names) -> AmplitudeEvidence:
    """Average the log amplitudes of each session's cycles, for every motion of an axis."""
    cells = []
    for found in rows_by_motion(baseline, target, axis, names, "log_amplitude", ("parts",)):
        means, counts = found.means()
        within = variance_within_sessions(found.values, found.session)
        cells.append(AmplitudeCell(found.key[0], means, counts, within))
    return AmplitudeEvidence(cells, len(names.sessions[0]))
