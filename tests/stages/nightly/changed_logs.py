"""Logs of a cell that a test adds to and changes."""

import shutil
import sqlite3
from dataclasses import replace
from datetime import date

import numpy as np
from cell_logs import night

from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run


def states(cell):
    """Return what became of every night of r1."""
    with sqlite3.connect(cell.parent / "nightly" / "history.sqlite") as db:
        query = "SELECT night, status FROM night WHERE robot = 'r1' ORDER BY night"
        return [status for _, status in db.execute(query).fetchall()]


def add_night(logs, index, robot="r1"):
    """Have a robot recorded in one more night."""
    shutil.copytree(logs / robot / night(4), logs / robot / night(index))
    set_clock(logs / robot / night(index) / "cycle.parquet", f"{night(index)}T22:00:00+00:00")


def set_clock(path, started_at, scale=None):
    """Have a recording say that it began at another time, with samples of its own."""
    with Run(path) as run:
        info, columns = replace(run.info, started_at=started_at), run.read(run.columns)
    scale = scale or 1 + 1e-4 * (date.fromisoformat(started_at[:10]).toordinal() % 1000)
    save_run(path, info, {name: values * np.float32(scale) for name, values in columns.items()})
