"""`opamc ingest`: recordings of other programs become runs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from opamc_cli.commands.options import DEFAULT_OUT, Jobs, Json, Out, Overrides, Quiet
from opamc_cli.commands.output import Output
from opamc_cli.errors import ExitCode

if TYPE_CHECKING:
    from opamc_cli.stages.ingest import Ingested
    from opamc_cli.storage.ingest.stamps import StampAccount


def ingest(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE", help="CSV, MAT, HDF5 or TDMS recordings.")
    ],
    map_file: Annotated[
        Path,
        typer.Option(
            "--map",
            metavar="FILE",
            help="YAML file that says which channel is which column, in which unit.",
        ),
    ],
    overrides: Overrides = None,
    out: Out = DEFAULT_OUT,
    jobs: Jobs = 1,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Turn recordings of other programs into runs, one DIR/<name>.parquet per file.

    With --set, keys of the map are overridden, such as sampling_rate_hz=2000.
    """
    from opamc_cli.stages import ingest as stage
    from opamc_cli.storage.ingest.map import load_map

    output = Output(as_json=as_json, quiet=quiet)
    outcome = stage.run(files, load_map(map_file, overrides or ()), out, jobs)
    for item in outcome.results:
        if item.stamps is not None:
            output.note(f"{item.source}: {_account(item.stamps, item.sampling_rate_hz)}")
        if item.missing:
            counts = ", ".join(f"{name} {count}" for name, count in item.missing.items())
            output.note(f"{item.source}: missing values (NaN) of {item.n_samples}: {counts}")
    failures = [str(error) for error in outcome.errors]
    output.result(
        {"runs": [_as_json(item) for item in outcome.results], "failed": failures},
        *[
            f"{item.run}: {item.n_samples} samples at {item.sampling_rate_hz:g} Hz, "
            f"{item.n_samples / item.sampling_rate_hz:.6g} s"
            for item in outcome.results
        ],
    )
    code = output.failures(failures, len(outcome.results))
    if code != ExitCode.DONE:
        raise typer.Exit(code)


def _account(stamps: "StampAccount", rate_hz: float) -> str:
    if stamps.even:
        drifts = abs(stamps.measured_rate_hz / rate_hz - 1) > 1e-6
        return (
            f"time stamps are even ({stamps.measured_rate_hz:.6g} Hz, steps within "
            f"{stamps.jitter_s * 1e3:.3g} ms of it); samples kept as they are"
            + (f" and taken as {rate_hz:g} Hz" if drifts else "")
        )
    dropped = [
        f"{count} {what}"
        for count, what in (
            (stamps.n_duplicates, "repeated"),
            (stamps.n_backward, "backward"),
            (stamps.n_unreadable, "unreadable"),
        )
        if count
    ]
    gaps = (
        f"{stamps.n_gaps} gaps left as NaN (longest {stamps.longest_gap_s:.6g} s)"
        if stamps.n_gaps
        else "no gaps"
    )
    return (
        f"time stamps are uneven ({stamps.measured_rate_hz:.6g} Hz, jitter up to "
        f"{stamps.jitter_s * 1e3:.3g} ms), resampled to {rate_hz:g} Hz; "
        f"{stamps.n_bridged} missing samples interpolated; {gaps}; "
        f"rows dropped for their stamp: {', '.join(dropped) or 'none'}"
    )


def _as_json(item: "Ingested") -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "source": str(item.source),
        "run": str(item.run),
        "sampling_rate_hz": item.sampling_rate_hz,
        "n_samples": item.n_samples,
        "duration_s": item.n_samples / item.sampling_rate_hz,
        "missing": dict(item.missing),
        "time_stamps": None if item.stamps is None else asdict(item.stamps),
    }
