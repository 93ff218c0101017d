"""One robot's night: all that its result depends on, and all that comes of it.

The result is a pure function of the job; it knows neither the history nor the other robots, and
writes nothing but what is kept of the baseline.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from opamc_cli import __version__
from opamc_cli.config import Config
from opamc_cli.storage.logs import LogFile

COMPUTE = "opamc_cli.stages.nightly.workers.judge:compute"
"""What a worker calls; by name, since loading it takes longer than looking at a cell."""

STATES = ("fault", "changed", "insufficient-data", "healthy")


@dataclass(frozen=True)
class Input:
    """A recording as a worker needs it: its name in tables, where it lies, what it must be."""

    name: str
    log: LogFile
    sha256: str


@dataclass(frozen=True)
class ProgramJob:
    """The recordings of one program in the night, and its baseline's."""

    program: str
    condition: str
    baseline_name: str
    missing: str
    targets: tuple[Input, ...]
    baseline: tuple[Input, ...]
    speed_percent: float | None
    payload_kg: float | None


@dataclass(frozen=True)
class NightJob:
    """What a worker is handed."""

    robot: str
    night: str
    programs: tuple[ProgramJob, ...]
    """What is compared."""
    config: Config
    """Options of the diagnosis."""
    axes: tuple[int, ...] | None
    """Joints that are watched; None: all."""
    kept: Path | None
    """Folder of what is kept of baselines; None where the worker cannot reach it."""
    copies: Path
    """Folder for copies of recordings that lie in an object store."""
    scratch: Path
    """Folder for what is thrown away."""
    version: str = __version__
    """Of the program that planned the night."""


@dataclass(frozen=True)
class AxisResult:
    """What the history learns of one joint."""

    axis: int
    state: str
    health_index: float | None
    p_value: float | None
    cause: str | None
    harmless: bool
    log_distance: float | None
    log_common: float | None
    effect: float | None
    temperature_c: float | None
    reason: str
    in_part: bool = False
    """Whether not all of the night's recordings could be used for this joint."""


@dataclass(frozen=True)
class ProgramResult:
    """What became of one program's comparison."""

    program: str
    """Its name."""
    axes: tuple[AxisResult, ...] = ()
    """Joints; empty where the comparison failed."""
    files: Mapping[str, bytes] = field(default_factory=dict)
    """Content of verdict.json and report.html."""
    failures: tuple[str, ...] = ()
    """One sentence for each recording, or the whole comparison, that failed."""
    of_baseline: tuple[str, ...] = ()
    """One sentence for each recording of the baseline of which something cannot be used."""
    notes: tuple[str, ...] = ()
    """What is worth knowing."""

    @property
    def rank(self) -> tuple[int, str]:
        """Worst state first."""
        return (
            min((STATES.index(one.state) for one in self.axes), default=len(STATES)),
            self.program,
        )
