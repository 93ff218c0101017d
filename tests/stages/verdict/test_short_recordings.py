"""What is said of a recording that fits no motion: that it is short, before anything else."""

from pathlib import Path
from types import SimpleNamespace

import pyarrow as pa
import pytest

from opamc_cli.stages.verdict.agreement.unjudged import Side, unjudged


def side(role, spans):
    rows = [
        {"run": run, "axis": 1, "cycle": cycle, "start": start, "stop": stop}
        for run, cycle, start, stop in spans
    ]
    measured = [
        SimpleNamespace(run=run, path=Path(run), axis=1, moves=True)
        for run in dict.fromkeys(row["run"] for row in rows)
    ]
    return Side(role, measured, (), pa.Table.from_pylist(rows))


@pytest.mark.parametrize(
    ("stop", "says"),
    [
        (700, "much shorter than the baseline's: its motions of axis 1 last 18% as long"),
        (3000, "fit no motion of the baseline's cycle: another program or speed"),
    ],
)
def test_a_recording_that_is_much_shorter_is_told_so_first(stop, says):
    nights = [("a", 0, 0, 2000), ("a", 1, 2000, 4000), ("b", 0, 0, 5000), ("broken", -1, 0, 9)]
    target = side("target", [("new", -1, 0, 400), ("new", -1, 400, stop)])
    (why,) = unjudged(side("baseline", nights), target).axes[1]
    assert says in why
    assert why.startswith("The target: ")
