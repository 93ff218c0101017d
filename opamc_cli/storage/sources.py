"""Which runs a stage table was made from, and how a later stage finds their samples again."""

import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from opamc_cli.errors import InputError
from opamc_cli.storage.files.parquet import read_schema
from opamc_cli.storage.files.result import published
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.schemas.channels import same_clock
from opamc_cli.storage.tables import table_record

REQUIRED_EQUAL = ("sampling_rate_hz", "program", "current_unit")
"""What must agree between recordings to be compared; rates as those of one clock do."""

WORTH_NOTING = ("robot", "speed_percent", "payload_kg")
"""What may differ, since it may be the very thing that is looked for, but has to be said."""


@dataclass(frozen=True)
class RunSource:
    """A run as a stage table remembers it."""

    name: str
    """How the table's rows call it."""
    path: Path
    """Where its file was."""
    sha256: str
    """Of the file."""
    n_samples: int
    """Its length."""
    info: RunInfo
    """Its metadata."""

    @classmethod
    def of(cls, run: Run) -> "RunSource":
        """Describe an open run (reads the whole file once, for its hash)."""
        return cls(run.name, run.path, run.sha256, run.n_samples, run.info)

    def open(self) -> Run:
        """Open the run again, without a look at its content; see `verify`.

        Raises
        ------
        InputError
            If it is gone.
        """
        if not self.path.exists():
            msg = (
                f"{self.path}: run {self.name!r} is no longer there; put it back or name its "
                "folder with --runs"
            )
            raise InputError(msg)
        return Run(self.path, self.name)

    def verify(self) -> None:
        """Check that the run is still the file that the table was made from.

        Raises
        ------
        InputError
            If it is gone or has changed.
        """
        with self.open() as run:
            if run.n_samples == self.n_samples and run.sha256 == self.sha256:
                return
        msg = (
            f"{self.path}: run {self.name!r} has changed since its segments were found; "
            "run `opamc segment` again"
        )
        raise InputError(msg)


def sources_record(sources: Sequence[RunSource], folder: Path) -> dict[str, Any]:
    """Return the JSON that keeps `sources` in the metadata of a table in `folder`."""
    root = published(folder.resolve())
    return {
        "runs": [
            {
                "name": source.name,
                "path": Path(os.path.relpath(source.path.resolve(), root)).as_posix(),
                "sha256": source.sha256,
                "n_samples": source.n_samples,
                "info": asdict(source.info),
            }
            for source in sources
        ]
    }


def read_sources(table: Path, moved_to: Sequence[Path] = ()) -> tuple[RunSource, ...]:
    """Return the runs that the stage table at `table` was made from.

    Parameters
    ----------
    table
        A stage table.
    moved_to
        Folders where the runs are now, if they are no longer where they were; each run is
        looked for there by its name or file name.

    Raises
    ------
    InputError
        If the table names no runs, or a folder of `moved_to` is not there.
    """
    for folder in moved_to:
        if not folder.exists():
            msg = f"{folder}: no such folder; name the folder of the runs with --runs"
            raise InputError(msg)
    metadata = read_schema(table, "run the stage before this one").metadata
    record = table_record(table, metadata)
    if "runs" not in record:
        msg = f"{table}: does not say which runs it was made from; make it again"
        raise InputError(msg)
    return tuple(
        RunSource(
            name=entry["name"],
            path=_locate(published(table.parent) / entry["path"], entry["name"], moved_to),
            sha256=entry["sha256"],
            n_samples=entry["n_samples"],
            info=RunInfo(**entry["info"]),
        )
        for entry in record["runs"]
    )


def current_unit(sources: Iterable[RunSource]) -> str:
    """Return the unit of the runs' current: "Nm" where a torque stands for it, else "A"."""
    return "Nm" if {source.info.current_unit for source in sources} == {"Nm"} else "A"


def check_comparable(baseline: Sequence[RunSource], target: Sequence[RunSource]) -> tuple[str, ...]:
    """Check that runs can be compared, and say which of their conditions differ.

    Returns
    -------
    tuple of str
        One sentence for each condition that differs but does not forbid the comparison.

    Raises
    ------
    InputError
        If rate or program differ where both are known, or a recording is on both sides.
    """
    runs = [*baseline, *target]
    known = {run.sha256: run for run in baseline if run.sha256}
    for run in target:
        if run.sha256 in known:
            msg = (
                f"{run.path}: is the same recording as {known[run.sha256].path} of the baseline; "
                "a baseline needs other recordings than those that it judges"
            )
            raise InputError(msg)
    for key in REQUIRED_EQUAL:
        difference = _first_difference(runs, key)
        if difference is not None:
            (first, expected), (other, value) = difference
            msg = (
                f"{other.path}: {key} is {value!r} where {first.path} has {expected!r}; "
                "a baseline and a target must be recorded at the same rate with the same program"
            )
            if key == "program":
                msg += "; name the files of one by a quoted pattern, such as 'normal/*P.parquet'"
            raise InputError(msg)
    notes = []
    for key in WORTH_NOTING:
        difference = _first_difference(runs, key)
        if difference is not None:
            (first, expected), (other, value) = difference
            notes.append(f"{key} differs: {first.name} has {expected!r}, {other.name} {value!r}")
    return tuple(notes)


def other_conditions(baseline: Sequence[RunSource], target: Sequence[RunSource]) -> str:
    """Say in a clause under which speed and payload no recording of the baseline was made."""
    told = []
    for key, name, unit in (("payload_kg", "payload", "kg"), ("speed_percent", "speed", "%")):
        own, known = ({getattr(run.info, key) for run in side} for side in (target, baseline))
        if None not in known and (other := own - known - {None}):
            here, there = (", ".join(f"{one:g}" for one in sorted(of)) for of in (other, known))
            told.append(f"the target's {name} is {here} {unit}, the baseline's {there} {unit}")
    return "; ".join(told)


def other_robot(baseline: Sequence[RunSource], target: Sequence[RunSource]) -> str | None:
    """Say that a target is of a robot that the baseline knows nothing of; None where it is not."""
    healthy = {run.info.robot for run in baseline}
    for run in target:
        if run.info.robot not in healthy and None not in (run.info.robot, *healthy):
            return (
                f"{run.path}: is of robot {run.info.robot!r}, the baseline of "
                f"{', '.join(map(repr, sorted(map(str, healthy))))}: healthy by another robot's "
                "baseline is no verdict; record one of its own, or correct `robot`"
            )
    return None


def _first_difference(
    runs: Sequence[RunSource], key: str
) -> tuple[tuple[RunSource, object], tuple[RunSource, object]] | None:
    known = [(run, getattr(run.info, key)) for run in runs]
    known = [(run, value) for run, value in known if value is not None]
    for other in known[1:]:
        if not _agree(key, other[1], known[0][1]):
            return known[0], other
    return None


def _agree(key: str, value: Any, expected: Any) -> bool:
    return same_clock(value, expected) if key == "sampling_rate_hz" else bool(value == expected)


def _locate(path: Path, name: str, moved_to: Sequence[Path]) -> Path:
    for folder in moved_to:
        for candidate in (folder / f"{name}.parquet", folder / path.name):
            if candidate.exists():
                return candidate
    return Path(os.path.normpath(path))
