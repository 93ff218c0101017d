"""`opamc nightly`: every night of a cell of robots that is new, and what has changed."""

from collections.abc import Callable
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from opamc_cli.commands.terminal.options import Jobs, Json, Quiet
from opamc_cli.commands.terminal.output import Output
from opamc_cli.errors import UsageError

if TYPE_CHECKING:
    from opamc_cli.config.cell import CellConfig

RUN = "run"
DEFAULT_CELL = Path("cell.yaml")
OUT = "`out` in the cell's file"
AHEAD_DAYS = 31
"""Days beyond the last night and today in which a new baseline may be announced."""


class _RunByDefault(TyperGroup):
    """A group whose first argument may be the cell's file instead of a subcommand."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        asks_for_help = args[:1] in (["--help"], ["-h"])
        if args and args[0] not in self.commands and not asks_for_help:
            args = [RUN, *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    cls=_RunByDefault,
    help="Look after a cell of robots night by night: `opamc nightly cell.yaml`, with the options "
    "of `opamc nightly run --help`.",
    no_args_is_help=True,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Cell = Annotated[Path, typer.Option("--cell", metavar="FILE", help="The cell's file.")]
Why = Annotated[str, typer.Option("--why", metavar="TEXT", help="Kept in the history.")]


def as_night(text: str | None) -> str | None:
    """Check that a night is a date."""
    if text is None:
        return None
    try:
        return date.fromisoformat(text).isoformat()
    except ValueError:
        msg = f"{text!r} is no date; write YYYY-MM-DD"
        raise UsageError(msg) from None


@app.command(RUN)
def run(
    cell: Annotated[Path, typer.Argument(metavar="CELL", help="The cell's file, cell.yaml.")],
    night: Annotated[
        str | None, typer.Option("--night", metavar="DATE", help="This night alone.")
    ] = None,
    since: Annotated[
        str | None, typer.Option("--since", metavar="DATE", help="Nights from this one on.")
    ] = None,
    robot: Annotated[
        list[str] | None, typer.Option("--robot", metavar="NAME", help="This robot alone.")
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what would be done, and why; do nothing.")
    ] = False,
    jobs: Jobs = 1,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="Dask scheduler, tcp://host:port."),
    ] = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Judge every robot's nights that are new; print the robots that need a look."""
    from opamc_cli.stages.processes.parallel import one_thread_each

    # numpy with threads of its own could not be copied into the workers
    with one_thread_each():
        from opamc_cli.stages.nightly.start import run as stage
    from opamc_cli.commands.nightly.claim import check_apart, claim
    from opamc_cli.config.cell import load_cell
    from opamc_cli.stages.nightly.morning import as_told, over, silent, tell
    from opamc_cli.stages.nightly.start.outcome import Wanted
    from opamc_cli.storage.files.lock import output_lock
    from opamc_cli.storage.files.parquet import forgo_pandas
    from opamc_cli.storage.history.rows import OF_START, STANDING, THE_CELL, Event
    from opamc_cli.storage.schemas import files

    forgo_pandas()
    output = Output(as_json, quiet)
    loaded = load_cell(cell)
    wanted = Wanted(as_night(night), as_night(since), tuple(robot) if robot else None)
    if wanted.night and wanted.since and wanted.night < wanted.since:
        msg = f"--night {wanted.night} is before --since {wanted.since}; give one of them"
        raise UsageError(msg)
    check_apart(loaded, cell)
    with output_lock(loaded.out, OUT), stage.open_history(loaded) as history:
        claim(loaded, cell)
        if dry_run:
            _print_plan(output, stage.plan(loaded, str(cell), history, wanted))
            return
        with output.steps() as steps:
            outcome = stage.run(
                loaded, str(cell), history, wanted, jobs=jobs, scheduler=scheduler, progress=steps
            )
        summary = outcome.summary.only(outcome.robots)
        told_of = {*outcome.robots, THE_CELL}
        untold = [one for one in history.events(untold=True) if one.robot in told_of]
        now: list[Event] = []
        no_more: list[Event] = []
        if wanted == Wanted():
            now = [*outcome.thinned, *outcome.strays, *outcome.unnamed]
            now += silent(history, _today(), loaded.alarm.remind_after)
            now += [one for said in outcome.gathering.values() for one in said]
            untold += history.untold(now)
            no_more += history.told(OF_START)
        standing = [
            as_told(one) for one in history.alarms(standing=True) if one.robot in outcome.robots
        ]
        stood = [
            one
            for one in history.told(STANDING)
            if wanted.robots is None or one.robot in outcome.robots
        ]
        ended = list(over(history, loaded, stood))
        untold += [*history.untold(standing), *ended]
        morning = tell(summary, untold, outcome, loaded.out, cell)
        if outcome.ended:
            output.failure(outcome.ended)
        page = loaded.out / files.PAGE
        output.result(
            {
                **morning.values,
                **_beside(outcome),
                "page": str(page),
            },
            *morning.lines,
            *(() if quiet else morning.standing),
            *([] if quiet and morning.lines else [f"{summary.headline()}; {page}"]),
            urgent=bool(morning.lines),
        )
        # only now: a start that is killed before says it next time
        for one in ended:
            history.record_news(one)
        history.tell([*untold, *standing, *now], no_more=[*stood, *no_more])
    raise typer.Exit(morning.exit_code)


def _beside(outcome: Any) -> dict[str, list[str]]:
    """Return what no night tells of, for `--json`."""
    return {
        "absent": outcome.absent,
        "strays": [stray.time for stray in outcome.strays],
        "unnamed": [one.robot for one in outcome.unnamed],
    }


def _print_plan(output: Output, outcome: Any) -> None:
    todo = [night for night in outcome.planned.values() if night.why]
    n_done = len(outcome.planned) - len(todo)
    with_nights = {night.robot for night in outcome.planned.values()}
    empty = [robot for robot in outcome.robots if robot not in with_nights]
    odd = (
        *outcome.absent,
        *([] if outcome.absent else [f"{robot}: no recording" for robot in empty]),
        *(f"{stray.robot} {stray.text}" for stray in outcome.strays),
        *(one.text for one in outcome.unnamed),
    )
    output.result(
        {
            "nights": [
                {
                    "robot": night.robot,
                    "night": night.night,
                    "why": night.why,
                    "baseline": night.in_baseline,
                    "runs": sum(len(one.targets) for one in night.comparisons),
                }
                for night in todo
            ],
            "done": n_done,
            **_beside(outcome),
        },
        *odd,
        *(
            f"{night.robot} {night.night}: {night.why}"
            + (", part of the baseline" if night.in_baseline else "")
            for night in todo
        ),
        f"{len(todo)} night{'s' * (len(todo) != 1)} to be done, {n_done} "
        f"{'is' if n_done == 1 else 'are'} done",
        urgent=bool(odd),
    )


@app.command("acknowledge")
def acknowledge(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="Its name.")],
    why: Why,
    axis: Annotated[
        int | None, typer.Option("--axis", min=1, help="The joint; else: that files are missing.")
    ] = None,
    cell: Cell = DEFAULT_CELL,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Silence a joint's alarm until it is over or at fault, or that a robot has no files."""
    from opamc_cli.storage.history.rows import Declared

    why = _reason(why)

    def said(history: Any, loaded: "CellConfig") -> tuple[Declared, str]:
        _check_known(history, loaded, robot)
        if axis is None:
            last = max((night for _, night in history.nights()), default="")
            own = {night for name, night in history.nights() if name == robot}
            if own == {""} or not last:
                why_not = f"{robot} has files that tell no night" if own else "no night is known"
                msg = f"{why_not}; there is nothing to acknowledge"
                raise UsageError(msg)
            if last in own:
                msg = f"{robot} lacks no file of the last night; name the joint by --axis"
                raise UsageError(msg)
            since = f"files since {max(own)}" if own else "file at all"
            text = f"no {since}, acknowledged: {why}"
            return Declared(_now(), robot, None, "gone", last, why), text
        standing = [
            alarm
            for alarm in history.alarms(standing=True)
            if (alarm.robot, alarm.axis) == (robot, axis)
        ]
        if not standing:
            msg = f"no alarm stands on axis {axis} of {robot}; `opamc history` shows what does"
            raise UsageError(msg)
        # what is silenced is what was there until now
        night = max(night for name, night in history.nights() if name == robot)
        text = f"axis {axis}: alarm since {standing[0].since} acknowledged: {why}"
        return Declared(_now(), robot, axis, "acknowledged", night, why), text

    _declare(cell, said, Output(as_json, quiet))


@app.command("rebaseline")
def rebaseline(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="Its name.")],
    begin: Annotated[
        str, typer.Option("--from", metavar="DATE", help="First night of the new baseline.")
    ],
    why: Why,
    undo: Annotated[
        bool, typer.Option("--undo", help="Take the new baseline of that date back.")
    ] = False,
    cell: Cell = DEFAULT_CELL,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Begin a new baseline for a robot, such as after maintenance."""
    from opamc_cli.storage.history.rows import Declared, begun_anew

    night = as_night(begin)
    assert night is not None
    why = _reason(why)

    def said(history: Any, loaded: "CellConfig") -> tuple[Declared, str]:
        _check_known(history, loaded, robot)
        begun = [of for name, of in begun_anew(history.declared()) if name == robot]
        if undo and night not in begun:
            has = f"there are {', '.join(begun)}" if begun else "there is none"
            msg = f"--from {night}: no baseline of {robot} was begun then by `rebaseline`; {has}"
            raise UsageError(msg)
        if undo:
            text = f"new baseline from {night} on taken back: {why}"
            return Declared(_now(), robot, None, "taken-back", night, why), text
        last = max([_now()[:10], *(of for _, of in history.nights())])
        if date.fromisoformat(night) > date.fromisoformat(last) + timedelta(AHEAD_DAYS):
            msg = f"--from {night}: lies more than a month ahead; check the year"
            raise UsageError(msg)
        text = f"new baseline from {night} on: {why}"
        return Declared(_now(), robot, None, "rebaselined", night, why), text

    _declare(cell, said, Output(as_json, quiet))


def _check_known(history: Any, loaded: "CellConfig", robot: str) -> None:
    """Refuse a name that is none of the cell's: it is mistyped."""
    known = {name for name, _ in history.nights()}
    known |= set() if loaded.robots == "auto" else set(loaded.robots)
    if robot not in known:
        has = f"it has {', '.join(sorted(known)[:8])}" if known else "no night is known yet"
        msg = f"{robot} is none of the cell's robots; {has}"
        raise UsageError(msg)


def _declare(path: Path, said: Callable[..., Any], output: Output) -> None:
    """Keep what a user declares, and bring alarms and pages up to date where nobody else does."""
    from opamc_cli.config.cell import load_cell
    from opamc_cli.errors import LockedError
    from opamc_cli.stages.nightly.settle import settle_cell
    from opamc_cli.stages.nightly.start.run import open_history
    from opamc_cli.storage.files.lock import output_lock

    loaded = load_cell(path)
    open_history(loaded, read_only=True)._db.close()
    with open_history(loaded) as history:
        declared, text = said(history, loaded)
        history.declare(declared, text)
        history.tell(one for one in history.events(untold=True) if one.kind == declared.kind)
        try:
            with output_lock(loaded.out, OUT):
                settle_cell(loaded, str(path), history, ())
        except LockedError:
            output.note("the pages follow when the run that is under way ends")
    output.result({"robot": declared.robot, "text": text}, f"{declared.robot} {text}")


def _reason(why: str) -> str:
    """Return a reason as one line that every terminal can show."""
    from opamc_cli.commands.terminal.streams import printable

    told = printable(" ".join(why.split()))
    if not told:
        msg = "--why is blank; say what was found or done"
        raise UsageError(msg)
    return told


def _today() -> date:
    return datetime.now(UTC).date()


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
