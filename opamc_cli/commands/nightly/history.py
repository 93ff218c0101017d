"""`opamc history`: what is known of a cell's nights, as a table or a file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from opamc_cli.commands.nightly.nightly import DEFAULT_CELL, Cell, as_night
from opamc_cli.commands.terminal.options import Json, Quiet
from opamc_cli.commands.terminal.output import Output
from opamc_cli.errors import InputError, UsageError

if TYPE_CHECKING:
    from opamc_cli.storage.history.history import History

WITH_REASON = (
    "*, coalesce((SELECT reason FROM measure AS m WHERE (m.robot, m.program, m.axis, m.night) = "
    "(verdict.robot, verdict.program, verdict.axis, verdict.night)), '') AS reason"
)
"""Columns of a verdict, and why it is as it is."""

SHOWN = ("robot", "axis", "night", "state", "health_index", "p_value", "cause", "alarm", "n_runs")


def history(
    robot: Annotated[
        list[str] | None, typer.Option("--robot", metavar="NAME", help="This robot alone.")
    ] = None,
    axis: Annotated[int | None, typer.Option("--axis", min=1, help="This joint alone.")] = None,
    since: Annotated[
        str | None, typer.Option("--since", metavar="DATE", help="Nights from this one on.")
    ] = None,
    events: Annotated[
        bool, typer.Option("--events", help="What happened, instead of every night's verdict.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Export to a .csv, .parquet or .json file."),
    ] = None,
    cell: Cell = DEFAULT_CELL,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Show or export the history of a cell; the whole table is history.sqlite below its `out`."""
    from opamc_cli.config.cell import load_cell
    from opamc_cli.stages.nightly.inputs.recordings import some
    from opamc_cli.stages.nightly.start.run import open_history
    from opamc_cli.storage.history.rows import told_by

    if out is not None and out.suffix not in (".csv", ".parquet", ".json"):
        msg = f"--out {out}: the ending tells the format: .csv, .parquet or .json"
        raise UsageError(msg)
    output = Output(as_json, quiet)
    first = as_night(since)
    table = "event" if events else "verdict"
    column = "time" if events else "night"
    where, values = ["1"], []
    if robot:
        where.append(f"robot IN ({', '.join('?' * len(robot))})")
        values += list(robot)
    for condition, value in (("axis = ?", axis), (f"{column} >= ?", first)):
        if value is not None:
            where.append(condition)
            values.append(str(value))
    if out is not None:
        _refuse_to_replace_others(out)
    with open_history(load_cell(cell), read_only=True) as opened:
        known = {name for name, _ in opened.nights()}
        for name in robot or ():
            if name not in known:
                msg = f"--robot {name}: no night of it is known; there are {some(sorted(known))}"
                raise InputError(msg)
        axes = _axes(opened, robot) if axis is not None else set()
        if axis not in {None, *axes}:
            has = some([str(one) for one in sorted(axes)]) or "none yet"
            msg = f"--axis {axis}: nothing is known of it; there are {has}"
            raise InputError(msg)
        # of the verdicts what lies beside them as well
        columns = "*" if events else WITH_REASON
        rows = opened.rows(
            f"SELECT {columns} FROM {table} WHERE {' AND '.join(where)} "
            f"ORDER BY robot, {column}, axis",
            values,
        )
    for row in () if events else rows:
        told = told_by(row["reason"])
        row |= {"excused": told.excused, "in_part": told.in_part, "reason": told.text}
    if out is not None:
        _export(out, rows, table)
        output.result({"written": str(out), "rows": len(rows)}, f"{out}: {len(rows)} rows")
        return
    output.result({table: rows}, _table(rows, events) if rows else "nothing of that kind is known")


def _axes(history: "History", robots: list[str] | None) -> set[int]:
    """Return the joints of which anything is known.

    A healthy one may have no event, and one whose baseline is recorded anew no verdict.
    """
    return {
        row["axis"]
        for table in ("verdict", "event")
        for row in history.rows(f"SELECT DISTINCT robot, axis FROM {table}")
        if row["axis"] is not None and (not robots or row["robot"] in robots)
    }


def _table(rows: list[dict[str, Any]], events: bool) -> Any:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    from opamc_cli.commands.terminal.streams import printable
    from opamc_cli.stages.report.wording.numbers import number, p_value

    names = ["time", "robot", "axis", "kind", "text"] if events else [*SHOWN]
    if not events and len({(row["robot"], row["program"]) for row in rows}) > len(
        {row["robot"] for row in rows}
    ):
        names.insert(1, "program")
    table = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for name in names:
        table.add_column(name.replace("_", " "))
    if events:  # what is said again has the same words: shown once, of when it was first said
        first: dict[tuple[Any, ...], dict[str, Any]] = {}
        for row in rows:
            first.setdefault(tuple(row[of] for of in names[1:]), row)
        rows = [*first.values()]
    forms = {"health_index": number, "p_value": p_value, "cause": _in_words}
    for row in rows:
        table.add_row(
            *(
                forms[name](row[name])
                if name in forms
                else printable("" if row[name] is None else str(row[name]))
                for name in names
            )
        )
    return table


def _in_words(cause: str | None) -> str:
    return (cause or "").replace("_", " ")


def _refuse_to_replace_others(path: Path) -> None:
    """Refuse to write over what is no earlier export, such as a recording."""
    from opamc_cli.storage.files.parquet import read_schema

    if not path.is_file():
        return
    if path.suffix == ".parquet":
        try:
            ours = "robot" in read_schema(path, "").names
        except InputError:
            ours = False
    else:
        with path.open("rb") as file:
            ours = file.read(20).startswith((b"[", b'"robot","program"', b'"time","robot"'))
    if not ours:
        msg = f"--out {path}: is no export of `opamc history` and would be replaced; name another"
        raise UsageError(msg)


def _export(path: Path, rows: list[dict[str, Any]], table: str) -> None:
    import json

    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet

    from opamc_cli.storage.files.atomic import atomic_path, write_text
    from opamc_cli.storage.history.rows import arrow_schema

    if path.suffix == ".json":
        write_text(path, json.dumps(rows, indent=1, ensure_ascii=False) + "\n")
        return
    made = pa.Table.from_pylist(rows, schema=arrow_schema(table))
    with atomic_path(path) as temporary:
        if path.suffix == ".csv":
            pyarrow.csv.write_csv(made, temporary)
        else:
            pyarrow.parquet.write_table(made, temporary)
