"""`opamc simulate`: record the virtual testbed."""

from pathlib import Path
from typing import Annotated

import typer

from opamc_cli.commands.terminal.options import DEFAULT_OUT, Jobs, Json, Out, Overrides, Quiet
from opamc_cli.commands.terminal.output import Output
from opamc_cli.storage.schemas import files


def simulate(
    config: Annotated[
        Path,
        typer.Option(
            "--config",
            metavar="FILE",
            help="The testbed: a file, or `testbed`, `samples`, `closing`.",
        ),
    ],
    seed: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = 0,
    fault: Annotated[
        list[str] | None,
        typer.Option(metavar="AXIS[:SEVERITY]", help="Damage an axis's gear, such as 3 or 3:0.5."),
    ] = None,
    speed: Annotated[
        float | None, typer.Option(min=1, max=100, help="Speed override in percent.")
    ] = None,
    payload: Annotated[float | None, typer.Option(min=0, help="Payload in kg.")] = None,
    cycles: Annotated[int | None, typer.Option(min=1, help="Cycles per axis.")] = None,
    sessions: Annotated[int | None, typer.Option(min=1, help="Recording sessions.")] = None,
    first_session: Annotated[
        int | None, typer.Option(min=0, help="Number of the first session.")
    ] = None,
    truth_signals: Annotated[
        bool, typer.Option(help="Write i_q, angles and temperature beside the runs.")
    ] = True,
    out: Out = DEFAULT_OUT,
    overrides: Overrides = None,
    jobs: Jobs = 1,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Record the virtual testbed: one run per session, and truth.json."""
    from opamc_cli.config.testbed import load_testbed
    from opamc_cli.stages.recordings import simulate as stage
    from opamc_cli.storage.files.lock import output_lock
    from opamc_cli.storage.files.result import result

    settings = list(overrides or ())
    for key, value in (
        ("program.speed_percent", speed),
        ("program.payload_kg", payload),
        ("program.cycles", cycles),
        ("recording.sessions", sessions),
        ("recording.first_session", first_session),
    ):
        if value is not None:
            settings.append(f"{key}={value}")
    if fault:
        settings.append(f"faults=[{', '.join(_fault(text) for text in fault)}]")
    testbed = load_testbed(config, settings)
    output = Output(as_json, quiet)
    with (
        output_lock(out),
        # recordings are moved about by their users: plain files, no links
        result(out, files.TRUTH, linked=False) as staged,
        output.steps() as steps,
    ):
        outcome = stage.run(
            testbed, seed, staged, truth_signals=truth_signals, jobs=jobs, watch=steps("simulate")
        )
    named = {entry["run"] for entry in outcome.results}
    others = sorted(path.name for path in out.glob("session-*.parquet") if path.name not in named)
    if others:
        output.note(f"{out}: {others[0]} and the like ({len(others)}) are not of this simulation")
    rate = testbed.recording.sampling_rate_hz
    output.result(
        {
            "truth": str(out / files.TRUTH),
            "runs": [str(out / entry["run"]) for entry in outcome.results],
        },
        *(
            f"{out / entry['run']}: {entry['n_samples'] / rate:.1f} s, "
            f"{len(entry['segments'])} motions"
            for entry in outcome.results
        ),
        str(out / files.TRUTH),
    )
    raise typer.Exit(
        output.failures([str(error) for error in outcome.errors], len(outcome.results))
    )


def _fault(text: str) -> str:
    """Turn AXIS[:SEVERITY] into YAML."""
    from opamc_cli.errors import UsageError

    axis, _, severity = text.partition(":")
    try:
        return f"{{axis: {int(axis)}, severity: {float(severity or 1.0)}}}"
    except ValueError:
        msg = f"--fault {text}: write AXIS or AXIS:SEVERITY, such as 3 or 3:0.5"
        raise UsageError(msg) from None
