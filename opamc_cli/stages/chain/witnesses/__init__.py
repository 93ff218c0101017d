"""The witnesses beside the patterns: what each keeps of a segment, and how it tells sessions apart.

A further witness is one module with what `Witness` asks for, and its name in `WITNESSES`.
"""

from collections.abc import Mapping
from typing import Any, Protocol

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

    def rows(
        self,
        place: Mapping[str, Any],
        current: npt.NDArray[Any],
        fs_hz: float,
        config: PatternsConfig,
    ) -> list[dict[str, Any]]:
        """Return what is kept of a segment, from its current: a vector, or reported with a sign."""

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
