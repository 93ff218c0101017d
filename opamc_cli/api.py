"""What a notebook calls: the stages as functions, their results as tables.

Every function does what the command of its name does, under the same lock and with the same files
in `out`, and raises `opamc_cli.errors.OpamcError` where the command ends with a sentence.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import pyarrow as pa

from opamc_cli.config import Config, load_config
from opamc_cli.config.joint_model import load_joint_model
from opamc_cli.errors import InputError, OpamcError, UsageError
from opamc_cli.stages import diagnose as whole
from opamc_cli.stages.chain import identify as cycles
from opamc_cli.stages.chain import patterns as counts
from opamc_cli.stages.chain import score as scores
from opamc_cli.stages.chain import segment as motions
from opamc_cli.stages.model import model as joint_model
from opamc_cli.storage.files.lock import output_lock
from opamc_cli.storage.files.result import result
from opamc_cli.storage.runs.finding import find_runs
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import TABLES
from opamc_cli.storage.tables import read_table as read_stage_table
from opamc_cli.storage.tables import record_at

OUT = "opamc-out"

AnyPath = str | PathLike[str]
AnyPaths = AnyPath | Iterable[AnyPath]
STEPS = pa.schema(
    [
        ("axis", pa.int16()),
        *((name, pa.string()) for name in ("effect", "domain", "interpretation", "parameters")),
        *((name, pa.float64()) for name in ("gain", "p_value", "rmse_before_a", "rmse_after_a")),
    ]
)
Settings = Mapping[str, object]
"""Options by their dotted names, such as ``{"joint.gear_ratio": 100}``."""


@dataclass(frozen=True)
class Rows:
    """A table and what goes with it."""

    table: pa.Table
    """Arrow table; columns and units as in docs/formats.md."""
    path: Path | None = None
    """Its file; None where it is made of another result."""
    notes: tuple[str, ...] = ()
    """One sentence for each thing that is doubtful but was used."""
    errors: tuple[OpamcError, ...] = ()
    """One for each run, or axis of a run, that could not be used."""

    def to_pandas(self) -> Any:
        """Return the rows as a data frame.

        Raises
        ------
        UsageError
            If pandas is not installed.
        """
        try:
            return self.table.to_pandas()
        except ModuleNotFoundError as error:
            msg = "data frames need pandas: pip install pandas; `.table` is the same in Arrow"
            raise UsageError(msg) from error


@dataclass(frozen=True)
class RunRows(Rows):
    """Samples of a run, with what it says of itself."""

    info: RunInfo | None = None
    """Sampling rate, robot, program and so on."""


@dataclass(frozen=True)
class Scores:
    """Divergences of every segment, and what is told of each motion."""

    scores: Rows
    features: Rows


@dataclass(frozen=True)
class Diagnosis(Rows):
    """A verdict: one row per axis, all of verdict.json, and the page."""

    verdict: Mapping[str, Any] | None = None
    report: Path | None = None


@dataclass(frozen=True)
class ClosedLoop(Rows):
    """Closed loops: one row per axis and step, and all of loop.json, one object per axis."""

    axes: tuple[Mapping[str, Any], ...] = ()


def read_run(path: AnyPath, columns: str | Sequence[str] | None = None) -> RunRows:
    """Read the samples of a run.

    Parameters
    ----------
    path
        The file.
    columns
        Such as ``["axis1_a", "axis1_position"]``, or one; None: all.

    Raises
    ------
    InputError
        If it is no run, or has no such column.
    """
    with Run(Path(path)) as run:
        if columns is None:
            columns = run.columns
        names = [columns] if isinstance(columns, str) else list(columns)
        for name in names:
            if name not in run.columns:
                msg = f"{path}: has no column {name}; it has {', '.join(run.columns)}"
                raise InputError(msg)
        return RunRows(pa.table(run.read(names)), Path(path), info=run.info)


def read_table(path: AnyPath) -> Rows:
    """Read a stage table, after the checks that the next stage would make.

    Raises
    ------
    InputError
        If it is missing, damaged or no stage table.
    """
    file = Path(path)
    stage = record_at(file)["stage"]
    return Rows(read_stage_table(file, stage, TABLES.get(file.name)), file)


def segment(
    runs: AnyPaths, *, out: AnyPath = OUT, settings: Settings | None = None, jobs: int = 1
) -> Rows:
    """Cut runs into motions, axis by axis; writes segments.parquet.

    Parameters
    ----------
    runs
        Run files and folders of them.
    out
        Folder of the table.
    settings
        Options that differ from the defaults.
    jobs
        Worker processes.
    """
    return _stage(motions.run, _paths(runs), out, settings, jobs)


def _stage(
    run: Callable[..., Any], source: object, out: AnyPath, settings: Settings | None, jobs: int
) -> Rows:
    folder = Path(out)
    with output_lock(folder):
        done = run(source, _config(settings), folder, jobs=jobs)
    return Rows(done.table, done.path, getattr(done, "notes", ()), done.errors)


def identify(
    segments: AnyPath | None = None,
    *,
    out: AnyPath = OUT,
    settings: Settings | None = None,
    jobs: int = 1,
) -> Rows:
    """Find the cycles and motions of a segment table; writes motions.parquet.

    Parameters
    ----------
    segments
        Table of `segment`; None: the one in `out`.
    out, settings, jobs
        As of `segment`.
    """
    return _stage(cycles.run, Path(segments or Path(out) / files.SEGMENTS), out, settings, jobs)


def patterns(
    motions: AnyPath | None = None,
    *,
    out: AnyPath = OUT,
    settings: Settings | None = None,
    jobs: int = 1,
) -> Rows:
    """Count ordinal patterns of every motion; writes patterns.parquet and the witnesses' tables.

    Parameters
    ----------
    motions
        Table of `identify`; None: the one in `out`.
    out, settings, jobs
        As of `segment`.
    """
    return _stage(counts.run, Path(motions or Path(out) / files.MOTIONS), out, settings, jobs)


def score(
    baseline: AnyPath, target: AnyPath, *, out: AnyPath = OUT, settings: Settings | None = None
) -> Scores:
    """Compare the target's patterns with the baseline's; writes scores and features.

    Parameters
    ----------
    baseline, target
        Tables of `patterns`.
    out, settings
        As of `segment`.
    """
    folder = Path(out)
    with output_lock(folder):
        done = scores.run(Path(baseline), Path(target), _config(settings), folder)
    return Scores(
        Rows(done.scores, done.scores_path, done.notes), Rows(done.features, done.features_path)
    )


def diagnose(
    baseline: AnyPaths,
    target: AnyPaths,
    *,
    out: AnyPath = OUT,
    settings: Settings | None = None,
    jobs: int = 1,
) -> Diagnosis:
    """Judge target runs against baseline runs, joint by joint, as `opamc diagnose` does.

    Parameters
    ----------
    baseline, target
        Run files and folders of them.
    out, settings, jobs
        As of `segment`.
    """
    folder = Path(out)
    with output_lock(folder):
        done = whole.run(_paths(baseline), _paths(target), _config(settings), folder, jobs=jobs)
    rows = [
        {
            **{name: axis[name] for name in ("axis", "state", "health_index", "p_value")},
            **axis["features"],
            "cause": (axis["cause"] or {}).get("effect"),
        }
        for axis in done.verdict["axes"]
    ]
    return Diagnosis(
        pa.Table.from_pylist(rows),
        done.verdict_path,
        done.notes,
        done.errors,
        verdict=done.verdict,
        report=done.report_path,
    )


def close_loop(
    runs: AnyPaths,
    model: AnyPath = "model",
    *,
    axes: Sequence[int] = (),
    out: AnyPath = OUT,
    settings: Settings | None = None,
    seed: int = 0,
    jobs: int = 1,
) -> ClosedLoop:
    """Find and name what a declared model of a joint lacks, as `opamc model close` does.

    Parameters
    ----------
    runs
        Run files and folders of them.
    model
        What is declared: a YAML file, or a shipped one by its name.
    axes
        From 1; empty: all.
    out, settings
        As of `segment`; options are those of the model, such as ``{"joint.gear_ratio": 100}``.
    seed
        Of what is drawn.
    jobs
        Worker processes.
    """
    folder = Path(out)
    declared = load_joint_model(Path(model), _overrides(settings))
    with output_lock(folder), result(folder, *joint_model.close_files(folder)) as staged:
        done = joint_model.close(declared, find_runs(_paths(runs)), axes, staged, seed, jobs=jobs)
    rows = [
        {**step, "axis": axis["axis"], "parameters": json.dumps(step["parameters"])}
        for axis in done.results
        for step in axis["steps"]
    ]
    loop = folder / files.LOOP
    steps = pa.Table.from_pylist(rows, schema=STEPS)
    return ClosedLoop(steps, loop, errors=done.errors, axes=done.results)


def _paths(given: AnyPaths) -> list[Path]:
    return [Path(given)] if isinstance(given, str | PathLike) else [Path(one) for one in given]


def _overrides(settings: Settings | None) -> list[str]:
    return [
        f"{name}={json.dumps(value, default=_plain)}" for name, value in (settings or {}).items()
    ]


def _plain(value: object) -> Any:
    """Return what JSON has no word for: numbers and arrays of numpy, paths."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _config(settings: Settings | None) -> Config:
    return load_config(None, _overrides(settings))
