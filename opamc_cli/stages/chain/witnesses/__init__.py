"""The witnesses beside the patterns: what each keeps of a segment, and how it tells sessions apart.

A further witness is one module with what `Witness` asks for, and its name in `WITNESSES`.
"""

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.config.models import PatternsConfig
from opamc_cli.decision.witnesses.evidence import WitnessEvidence
from opamc_cli.stages.chain.witnesses import amplitude, profile, spectrum
from opamc_cli.stages.chain.witnesses.kept_rows import Names


class Witness(Protocol):
    """A module of this folder."""

    NAME: str
    """In verdict.json."""

    FILE_NAME: str
    """Of its table, beside the pattern table."""

    SCHEMA: pa.Schema
    """Of its table; `run`, `axis`, `cycle`, `motion` and `segment` say what a row is of."""

    def kept(
        self,
        course: npt.NDArray[np.floating],
        torque: npt.NDArray[np.floating],
        fs_hz: float,
        config: PatternsConfig,
    ) -> dict[str, Any]:
        """Return its columns of a segment, or none.

        From the current with its sign where one is reported, else its envelope; and from the
        current with the torque's sign, which three phases tell too. Both have shape (n,), A.
        """

    def evidence(
        self, baseline: pa.Table, target: pa.Table, axis: int, names: Names
    ) -> WitnessEvidence:
        """Return the evidence that its tables hold about an axis."""


WITNESSES: tuple[Witness, ...] = (
    spectrum,
    profile,
    amplitude,
)
"""In the order in which they are asked."""
