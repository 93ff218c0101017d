"""`opamc ingest`: recordings of other programs become runs."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from opamc_cli.commands.terminal.options import DEFAULT_OUT, Jobs, Json, Out, Overrides, Quiet
from opamc_cli.commands.terminal.output import Output, folded
from opamc_cli.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from opamc_cli.stages.recordings.ingest import Ingested
    from opamc_cli.storage.ingest.time.stamps import StampAccount


def ingest(
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="FILE...",
            help="Recordings: CSV, MAT, HDF5, TDMS, Parquet, Feather, ROS bags, MDF; files, "
            "folders, quoted patterns, addresses such as s3://bucket/logs.",
        ),
    ],
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map",
            "--config",
            metavar="FILE",
            help="YAML file that says which channel is which column, in which unit; or the name "
            "of a shipped one: ur_rtde, kinova_gen3, kuka_kr, ros_joint_state.",
        ),
    ] = None,
    guess: Annotated[
        bool,
        typer.Option(
            "--guess",
            help="Print a map for these recordings, to be looked at, corrected and saved.",
        ),
    ] = False,
    overrides: Overrides = None,
    out: Out = DEFAULT_OUT,
    jobs: Jobs = 1,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Turn recordings of other programs into runs, one DIR/NAME.parquet per recording.

    With --set, keys of the map are overridden, such as sampling_rate_hz=2000. What has become a
    run already is skipped.
    """
    output = Output(as_json=as_json, quiet=quiet)
    if guess:
        _guess(files, overrides or (), output)
        return
    from opamc_cli.stages.recordings import ingest as stage
    from opamc_cli.storage.ingest.map.load import load_map

    own_map = map_file is None
    if map_file is None:
        map_file = _own_map(files)
    channels = load_map(map_file, overrides or ())
    with output.steps() as steps:
        outcome = stage.run(files, channels, out, jobs, steps("ingest"))
    for item in outcome.results:
        for note in _notes(item, own_map):
            output.note(note)
    rates = stage.rates_note(outcome.results)
    if rates is not None:
        output.note(rates)
    for doubt in folded([doubt for item in outcome.results for doubt in item.doubts]):
        output.failure(doubt)
    failures = [str(error) for error in outcome.errors]
    lost = [item.lost for item in outcome.results if item.lost]
    for sentence in lost:
        output.failure(sentence)
    output.result(
        {
            "runs": [_as_json(item) for item in outcome.results],
            "failed": failures,
            "notes": [rates] if rates else [],
        },
        *[_line(item) for item in outcome.results],
    )
    code = output.failures(failures, len(outcome.results))
    if lost:
        code = ExitCode.PARTIAL
    if code != ExitCode.DONE:
        raise typer.Exit(code)


def _guess(files: list[str], overrides: Sequence[str], output: Output) -> None:
    import codecs
    from contextlib import ExitStack

    from opamc_cli.storage.ingest.guess.write import guess_map
    from opamc_cli.storage.ingest.recordings import find_recordings, local_copy

    given = dict(each.partition("=")[::2] for each in overrides)
    if given.keys() - {"encoding"}:
        msg = "--guess takes --set encoding=NAME alone; change other keys in the map it prints"
        raise UsageError(msg)
    encoding = given.get("encoding")
    try:
        codecs.lookup(encoding or "utf-8")
    except LookupError as error:
        msg = f"--set encoding={encoding}: no such encoding; use utf-8, latin-1, cp1252, shift_jis"
        raise UsageError(msg) from error
    with ExitStack() as stack:
        paths = [stack.enter_context(local_copy(each.source)) for each in find_recordings(files)]
        text = guess_map(paths, encoding)
    output.result({"map": text}, text.rstrip("\n"), urgent=True)


def _own_map(files: list[str]) -> Path:
    """Return the shipped map of recordings that say themselves what is what: ROS joint states."""
    from opamc_cli.storage.ingest.formats import format_by_ending
    from opamc_cli.storage.ingest.recordings import find_recordings

    found = [Path(each.source) for each in find_recordings(files)]
    if all(format_by_ending(path) == "ros" for path in found):
        return Path("ros_joint_state")
    msg = "no --map; `opamc ingest FILE --guess` prints one to look at, correct and save"
    raise UsageError(msg)


def _line(item: "Ingested") -> str:
    length = f"{item.n_samples / item.sampling_rate_hz:.6g} s"
    shown = f"{item.run}: {item.n_samples} samples at {item.sampling_rate_hz:g} Hz, {length}"
    return f"{shown}; done before" if item.skipped else shown


def _notes(item: "Ingested", own_map: bool) -> list[str]:
    notes = []
    if item.stamps is not None:
        notes.append(f"{item.source}: {_account(item.stamps, item.sampling_rate_hz)}")
    if item.missing:
        counts = ", ".join(f"{name} {count}" for name, count in item.missing.items())
        notes.append(f"{item.source}: missing values (NaN) of {item.n_samples}: {counts}")
    named = [
        f"{column.removesuffix('_current').replace('axis', 'axis ')} is {joint}"
        for column, source in item.sources.items()
        if column.endswith("_current") and (joint := str(source).rpartition("/")[0]) and own_map
    ]
    if named:
        notes.append(f"{item.source}: {', '.join(named)}")
    if item.replaced:
        notes.append(f"{item.run}: made anew, for its recording or the map is another one now")
    return notes


def _account(stamps: "StampAccount", rate_hz: float) -> str:
    if stamps.even:
        known = f"time stamps are even ({stamps.measured_rate_hz:.6g} Hz, steps within "
        known += f"{stamps.jitter_s * 1e3:.3g} ms of it); "
        if stamps.resampled:
            return f"{known}resampled to {rate_hz:g} Hz"
        drifts = abs(stamps.measured_rate_hz / rate_hz - 1) > 1e-6
        taken = f" and taken as {rate_hz:g} Hz" if drifts else ""
        return f"{known}samples kept as they are{taken}"
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
        "source": item.source,
        "run": str(item.run),
        "sampling_rate_hz": item.sampling_rate_hz,
        "n_samples": item.n_samples,
        "duration_s": item.n_samples / item.sampling_rate_hz,
        "missing": dict(item.missing),
        "doubts": list(item.doubts),
        "lost": item.lost,
        "time_stamps": None if item.stamps is None else asdict(item.stamps),
        "sources": dict(item.sources),
        "skipped": item.skipped,
    }
