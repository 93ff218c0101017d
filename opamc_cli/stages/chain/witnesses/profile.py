"""Third witness: the course of the current over a motion."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.config.models import PatternsConfig
from opamc_cli.decision.witnesses.profiles import ProfileEvidence, profile_cell
from opamc_cli.signal.course import mean_course
from opamc_cli.stages.chain.witnesses.kept_rows import Names, rows_by_motion
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import PROFILES

NAME = "profile"
FILE_NAME = files.PROFILES
SCHEMA = PROFILES


def kept(
    course: npt.NDArray[np.floating],
    torque: npt.NDArray[np.floating],
    fs_hz: float,
    config: PatternsConfig,
) -> dict[str, Any]:
    """Return the mean current in each part of a segment; none if it is too short for any."""
    del torque, fs_hz
    means = mean_course(course, config.parts)
    return {"parts": means.size, "current_a": means} if means.size else {}


def evidence(baseline: pa.Table, target: pa.Table, axis: int, names: Names) -> ProfileEvidence:
    """Average the current of each session's cycles, part by part, for every motion of an axis."""
    found = rows_by_motion(baseline, target, axis, names, "current_a", ("parts",))
    cells = [profile_cell(one.key[0], one.values, one.session, one.n_sessions) for one in found]
    return ProfileEvidence(cells, len(names.sessions[0]))
