"""What a report is made from: the tables, the verdict and the loop of one output folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from opamc_cli.errors import InputError
from opamc_cli.stages.processes.kept import KeptResults
from opamc_cli.stages.report.results.columns import Columns, n_rows, select, to_columns
from opamc_cli.storage.files.json_documents import read_json
from opamc_cli.storage.files.parquet import read_schema
from opamc_cli.storage.runs.hashes import file_sha256
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.schemas import files, tables
from opamc_cli.storage.sources import RunSource, read_sources
from opamc_cli.storage.tables import read_table, table_record

ROLES = ("baseline", "target")


class NothingToDrawError(Exception):
    """A part of the report that its inputs do not allow, with the reason as message."""


@dataclass(frozen=True)
class SourceFile:
    """A file that the report was made from."""

    name: str
    """Path below the output folder."""
    sha256: str
    """Of its content."""
    record: Mapping[str, Any] | None
    """Its provenance, where it is a stage table."""


@dataclass(frozen=True)
class RoleTables:
    """The tables of the baseline's or the target's runs; None where there is none."""

    motions: Columns | None
    """Identified segments; of `segment` alone where nothing was identified yet."""
    patterns: Columns | None
    """Ordinal counts."""
    sources: tuple[RunSource, ...]
    """The runs, in time order as far as they say when they began."""
    config: Mapping[str, Any]
    """Configuration that the segments were found with."""

    def run_rank(self) -> dict[str, int]:
        """Return the place of every run in time order."""
        return {source.name: rank for rank, source in enumerate(self.sources)}

    def source_of(self, name: str) -> RunSource:
        """Return the run whose samples a figure needs.

        Raises
        ------
        NothingToDrawError
            If it is not where the tables or the options say.
        """
        for source in self.sources:
            if source.name == name:
                if not source.path.exists():
                    msg = f"the samples of run {name} are not there; name its folder"
                    raise NothingToDrawError(msg)
                return source
        msg = f"no table says where run {name} is"
        raise NothingToDrawError(msg)

    def open_run(self, name: str) -> Run:
        """Open the run of `source_of`."""
        return self.source_of(name).open()


@dataclass(frozen=True)
class ReportInputs:
    """Everything that a report shows, read once."""

    scores: Columns
    features: Columns
    """With `scores`: tables of the stage `score`; without columns where there are none."""
    verdict: Mapping[str, Any] | None
    """verdict.json, or None."""
    roles: Mapping[str, RoleTables]
    """Tables of the baseline and of the target."""
    loop: Mapping[str, Any] | None
    residuals: Columns | None
    spectrum: Columns | None
    """With `loop`, `residuals`: what `opamc model close` left, or None."""
    files: tuple[SourceFile, ...] = field(default=())
    """Every file that was read."""
    kept: KeptResults | None = None
    """Where drawings of the baseline alone may lie."""

    @property
    def axes(self) -> list[int]:
        """Axes with scores, ascending."""
        return sorted({int(axis) for axis in self.scores.get("axis", ())})

    def unhealthy(self) -> "ReportInputs":
        """Return the same with the scores of joints alone that are not healthy."""
        axes = [axis for axis in self.axes if self.state(axis) != "healthy"]
        mask = np.isin(self.scores["axis"], axes) if self.scores else np.empty(0, dtype=bool)
        return replace(self, scores=select(self.scores, mask))

    @property
    def all_axes(self) -> list[int]:
        """Axes with scores, and those that the verdict names without any, ascending."""
        named = {int(entry["axis"]) for entry in (self.verdict or {}).get("axes", ())}
        return sorted(named | set(self.axes))

    @property
    def unit(self) -> str:
        """Unit of the current: "A", or "Nm" where a torque stands for it."""
        units = {s.info.current_unit for role in self.roles.values() for s in role.sources}
        units |= {str(entry.get("unit", "A")) for entry in (self.loop or {}).get("axes", ())}
        return "Nm" if units == {"Nm"} else "A"

    @property
    def quantity(self) -> str:
        """What the current is called: "current (A)" or "torque (Nm)"."""
        return "torque (Nm)" if self.unit == "Nm" else "current (A)"

    def axis_verdict(self, axis: int) -> Mapping[str, Any] | None:
        """Return what the verdict says of an axis, if anything."""
        return _of_axis(self.verdict, axis)

    def loop_axis(self, axis: int) -> Mapping[str, Any]:
        """Return what the loop says of an axis; empty if nothing."""
        return _of_axis(self.loop, axis) or {}

    def state(self, axis: int) -> str | None:
        """Return the state of an axis, if the verdict names one."""
        entry = self.axis_verdict(axis)
        return None if entry is None else str(entry.get("state"))


def _of_axis(document: Mapping[str, Any] | None, axis: int) -> Mapping[str, Any] | None:
    entries = (document or {}).get("axes", ())
    return next((entry for entry in entries if entry.get("axis") == axis), None)


def read_inputs(out: Path, moved_to: Mapping[str, Sequence[Path]]) -> ReportInputs:
    """Read what an output folder holds for a report.

    Parameters
    ----------
    out
        The folder; scores.parquet with features.parquet, or loop.json, must be in it, all else
        may be.
    moved_to
        For each role the folders or files where its runs are now.

    Raises
    ------
    InputError
        If neither scores nor a loop is there, or any file is damaged or of another kind.
    """
    folder = _Folder(out)
    loop = folder.optional_json(files.LOOP)
    verdict = folder.optional_json(files.VERDICT)
    scores: Columns = {}
    features: Columns = {}
    if loop is None or verdict is not None or (out / files.SCORES).exists():
        scores = folder.table(files.SCORES, "score", tables.SCORES)
        features = folder.table(files.FEATURES, "score", tables.FEATURES)
        if not n_rows(scores):
            msg = f"{out / 'scores.parquet'}: has no rows; run `opamc score` on tables with motions"
            raise InputError(msg)
    roles = {role: _role_tables(folder, role, moved_to.get(role, ())) for role in ROLES}
    if verdict is not None:
        _refuse_mixture(out, verdict, folder.files)
    return ReportInputs(
        scores=scores,
        features=features,
        verdict=verdict,
        roles=roles,
        loop=loop,
        residuals=folder.optional_table(files.RESIDUALS, "model", tables.RESIDUALS),
        spectrum=folder.optional_table(files.ORDER_SPECTRUM, "model", tables.ORDER_SPECTRUM),
        files=tuple(folder.files),
    )


def _refuse_mixture(out: Path, verdict: Mapping[str, Any], files: Sequence[SourceFile]) -> None:
    """Refuse a verdict beside tables that it was not made from."""
    vouched = verdict.get("tables")
    if not isinstance(vouched, dict):
        return  # of an opamc that did not write them down
    for file in files:
        if file.name.endswith(".parquet") and vouched.get(file.name, file.sha256) != file.sha256:
            msg = (
                f"{out / file.name}: is not the table that {out / 'verdict.json'} was made from; "
                "diagnose again, or remove verdict.json to report the tables alone"
            )
            raise InputError(msg)


class _Folder:
    """An output folder, and the files that have been read of it."""

    def __init__(self, out: Path) -> None:
        self.out = out
        self.files: list[SourceFile] = []

    def table(self, name: str, stage: str, schema: pa.Schema) -> Columns:
        path = self.out / name
        table = read_table(path, stage, schema)
        self._note(path, table_record(path, table.schema.metadata))
        return to_columns(table)

    def optional_table(self, name: str, stage: str, schema: pa.Schema) -> Columns | None:
        return self.table(name, stage, schema) if (self.out / name).exists() else None

    def optional_json(self, name: str) -> Mapping[str, Any] | None:
        path = self.out / name
        if not path.exists():
            return None
        self._note(path, None)
        return read_json(path, path.stem, "make it again or remove it")

    def _note(self, path: Path, record: Mapping[str, Any] | None) -> None:
        name = path.relative_to(self.out).as_posix()
        self.files.append(SourceFile(name, file_sha256(path), record))


def _role_tables(folder: _Folder, role: str, moved_to: Sequence[Path]) -> RoleTables:
    motions = folder.optional_table(f"{role}/motions.parquet", "identify", tables.MOTIONS)
    segments = folder.optional_table(f"{role}/segments.parquet", "segment", tables.SEGMENTS)
    return RoleTables(
        motions=motions if motions is not None else segments,
        patterns=folder.optional_table(f"{role}/patterns.parquet", "patterns", tables.PATTERNS),
        sources=_sources(folder.out, role, moved_to),
        config=_recorded_config(folder.files, role),
    )


def _sources(out: Path, role: str, moved_to: Sequence[Path]) -> tuple[RunSource, ...]:
    for name in (files.SEGMENTS, files.MOTIONS, files.PATTERNS):
        path = out / role / name
        if not path.exists():
            continue
        record = table_record(path, read_schema(path, "make it again").metadata)
        if "runs" in record:
            found = read_sources(path, moved_to)
            return tuple(sorted(found, key=lambda s: (s.info.started_at or "", s.name)))
    return ()


def _recorded_config(files: Sequence[SourceFile], role: str) -> dict[str, Any]:
    mine = [file.record for file in files if file.name.startswith(f"{role}/") and file.record]
    return merged_config(mine)


def merged_config(records: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the configuration that several tables record each a part of."""
    config: dict[str, Any] = {}
    for record in records:
        for name, values in (record.get("config") or {}).items():
            # two stages may each record some options of one section
            both = isinstance(values, dict) and isinstance(config.get(name), dict)
            config[name] = {**config[name], **values} if both else values
    return config


def time_order(columns: Columns, rank: Mapping[str, int]) -> np.ndarray[Any, np.dtype[np.intp]]:
    """Return the order of rows by run in time, then by their place in the run."""
    unknown = len(rank)
    runs = np.array([rank.get(str(run), unknown) for run in columns["run"]], dtype=np.intp)
    within = [columns[name] for name in ("segment", "motion", "cycle") if name in columns]
    return np.asarray(np.lexsort((*within, runs)))
