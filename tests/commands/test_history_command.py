"""What `opamc history` shows, and what its export may replace."""

import json

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from opamc_cli.commands.nightly.history import _export, _refuse_to_replace_others, _table
from opamc_cli.errors import UsageError

ROW = {
    **{"robot": "r1", "program": "pick", "axis": 3, "night": "2026-03-07", "state": "fault"},
    **{"health_index": 7.0, "p_value": 0.001, "cause": None, "alarm": 1, "n_runs": 1},
}


@pytest.mark.parametrize(
    ("programs", "told"), [(("pick", "pick"), False), (("pick", "place"), True)]
)
def test_programs_of_one_robot_are_told_apart(programs, told):
    shown = _table([{**ROW, "program": program} for program in programs], events=False)
    assert ("program" in [column.header for column in shown.columns]) is told


def test_a_cause_is_shown_in_words():
    (cause,) = [
        [*column.cells]
        for column in _table([{**ROW, "cause": "sensor_gain"}, ROW], events=False).columns
        if column.header == "cause"
    ]
    assert cause == ["sensor gain", ""]


def test_what_was_said_again_is_shown_once():
    """A robot without files from Saturday on was listed twice with the same words."""
    of = {"robot": "r1", "axis": None, "kind": "missing"}
    rows = [{**of, "time": f"2026-03-{day}", "text": text} for day, text in enumerate("abab", 10)]
    (time, *_, text) = _table(rows, events=True).columns
    assert [*time.cells] == ["2026-03-10", "2026-03-11"]
    assert [*text.cells] == ["a", "b"]


@pytest.mark.parametrize("ending", ["csv", "json", "parquet"])
def test_an_export_replaces_an_earlier_one_and_no_recording(tmp_path, ending):
    path = tmp_path / f"x.{ending}"
    _refuse_to_replace_others(path)
    for rows, table in ([], "verdict"), ([], "event"):
        _export(path, rows, table)
        _refuse_to_replace_others(path)
    if ending == "parquet":
        run = pa.table({"axis1_a": [0.0]})
        pq.write_table(run.replace_schema_metadata({"opamc": json.dumps({})}), path)
    else:
        path.write_text("t,i_u\n0,1\n", encoding="utf-8")
    with pytest.raises(UsageError, match="would be replaced"):
        _refuse_to_replace_others(path)
