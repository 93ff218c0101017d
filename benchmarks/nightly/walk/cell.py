"""A cell whose logs and cell.yaml are changed step by step, and what somebody has heard of it."""

import hashlib
import json
import os
import re
import signal
import sqlite3
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import nightly_kills
import numpy as np

from opamc_cli.__main__ import main
from opamc_cli.stages.nightly.publish import metrics, page
from opamc_cli.stages.nightly.start import record
from opamc_cli.storage.history.history import History
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run
from walk.by_table import answer_by

ROBOTS = ("r1", "r2", "r3", "r4")
TO_COME = "2031-01-01"
"""What a clock that was never set may say."""


class ViolationError(Exception):
    """What was said is not what is so."""


def kill_after(ticks: int) -> None:
    """Have this process killed at one of its next writes."""
    left = iter(range(ticks))

    def ticking(write: Callable[..., Any]) -> Callable[..., Any]:
        def called(*args: Any, **named: Any) -> Any:
            if next(left, None) is None:
                os.kill(os.getpid(), signal.SIGKILL)
            return write(*args, **named)

        return called

    for of, name in (
        (History, "transaction"),
        (page, "write_text"),
        (metrics, "write_text"),
        (record, "replace_folder"),
        (record, "remove_folder"),
    ):
        setattr(of, name, ticking(getattr(of, name)))


@dataclass(frozen=True)
class Said:
    """How a command ended and what it printed."""

    code: int
    out: str
    err: str

    def names(self, robot: str, axis: int | None = None, how: str = "") -> bool:
        """Whether a line is of a robot, and of a joint of it."""
        for line in self.out.splitlines():
            head = line if axis is None else line.split(" axis ")[0]
            of_axis = axis is None or re.search(rf"axis {axis}\b", line)
            if of_axis and re.search(rf"(?<!\w){robot}\b", head) and re.search(how, line):
                return True
        return False


@dataclass
class Heard:
    """What somebody knows who reads what is printed."""

    alarms: dict[tuple[str, str, int], tuple[str, str | None]] = field(default_factory=dict)
    """Night in which it was raised, and why it was acknowledged, by robot, program and axis."""
    failed: dict[str, set[str]] = field(default_factory=dict)
    """Why a robot is not judged, without numbers and paths."""
    unjudged: set[tuple[str, str, int, str]] = field(default_factory=set)
    """Joints that were not judged: robot, program, axis and night."""
    rebased: set[str] = field(default_factory=set)


class World:
    """A cell, its logs, and what somebody has heard of it."""

    def __init__(self, folder: Path, log: Callable[..., None] = lambda *_: None) -> None:
        self.folder, self.log = folder, log
        self.logs, self.out, self.cell = folder / "logs", folder / "nightly", folder / "cell.yaml"
        self.robots: str | list[str] = ["r1", "r2", "r3"]
        self.axes: dict[str, list[int]] = {}
        self.alarm = {"nights": 2, "of": 3, "gross": 0.9, "remind_after": 7}
        self.baseline, self.options, self.keep = "{nights: 2}", {}, 30
        self.last = -1
        self.trash: list[dict[Path, bytes]] = []
        self.table: dict[str, str] = {}
        self.heard = Heard()
        self.copied: Heard | None = None
        self.written = self.starts = 0
        self.save()

    def save(self) -> None:
        """Write cell.yaml."""
        values: dict[str, Any] = {
            "runs": "logs/{robot}/{night}/*.parquet",
            "alarm": self.alarm,
            "keep": {"reports": self.keep},
            "set": self.options,
            "robots": "auto",
        }
        if self.robots != "auto":
            values["robots"] = {
                robot: {"axes": self.axes[robot]} if robot in self.axes else {}
                for robot in self.robots
            }
        lines = [f"{key}: {json.dumps(value)}" for key, value in values.items()]
        self.cell.write_text("\n".join([*lines, f"baseline: {self.baseline}"]) + "\n")

    def record(self, robot: str, of: str, code: str, name: str = "a", **said: Any) -> None:
        """Write a recording of a night that says what a code means."""
        self.written += 1
        path = self.logs / robot / of / f"{name}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        draw = np.random.default_rng(self.written)
        columns = {
            f"axis{axis}_{phase}": draw.normal(size=200).astype(np.float32)
            for axis in (1, 2)
            for phase in "abc"
        }
        said = {"program": "cycle", "started_at": f"{of}T22:00:00+00:00", **said}
        save_run(path, RunInfo(200.0, **said), columns)
        self.table[hashlib.sha256(path.read_bytes()).hexdigest()] = code

    def nights(self, robot: str) -> list[Path]:
        """Return a robot's folders of nights, in order."""
        folder = self.logs / robot
        return sorted(folder.iterdir()) if folder.is_dir() else []

    def pick(self, robot: str, index: int) -> list[Path]:
        """Return one folder of a robot's nights, or nothing if it has none."""
        found = self.nights(robot)
        return [found[index % len(found)]] if found else []

    def discard(self, *paths: Path) -> None:
        """Remove files, so that they can be restored."""
        if paths:
            self.trash.append({path: path.read_bytes() for path in paths})
        for path in paths:
            path.unlink()
            if not any(path.parent.iterdir()):
                path.parent.rmdir()

    def call(self, *args: object, kill: int | None = None) -> Said:
        """Call the command in a process of its own that has everything loaded already."""
        streams = self.folder / "out.txt", self.folder / "err.txt"
        child = os.fork()
        if not child:
            code = 70
            try:
                for descriptor, path in enumerate(streams, start=1):
                    os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), descriptor)
                sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
                if kill is not None:
                    kill_after(kill)
                answer_by(self.table)
                main([str(one) for one in args])
                code = 0
            except SystemExit as ended:
                code = int(ended.code or 0)
            except BaseException:  # noqa: BLE001  (a child must not go on as its parent)
                traceback.print_exc()
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(code)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        said = Said(code, *(path.read_text() for path in streams))
        self.log("   $", *args, *([] if kill is None else ["KILL", kill]), said)
        if code != -signal.SIGKILL:
            demand(code in (0, 1, 2, 3, 4, 6) and "Traceback" not in said.err, f"bug: {said}")
        return said

    def rows(self, query: str) -> list[tuple[Any, ...]]:
        """Return what the history holds."""
        path = self.out / "history.sqlite"
        if not path.is_file():
            return []
        db = sqlite3.connect(path)
        try:
            return db.execute(query).fetchall()
        finally:
            db.close()

    def history(self) -> dict[str, Any]:
        """Return the whole history but for what was read of files."""
        path = self.out / "history.sqlite"
        return {**nightly_kills.dump(path), "file": None} if path.is_file() else {}

    def watched(self) -> set[str]:
        """Return the robots that the cell's file names."""
        if self.robots != "auto":
            return set(self.robots)
        known = {robot for (robot,) in self.rows("SELECT DISTINCT robot FROM night")}
        return known | {path.parts[-3] for path in self.logs.glob("*/*/*.parquet")}

    def standing(self) -> dict[tuple[str, str, int], tuple[str, str | None]]:
        """Return the alarms that stand: raised and acknowledged, by robot, program and axis."""
        columns = "robot, program, axis, raised, acknowledged"
        query = f"SELECT {columns} FROM alarm WHERE cleared IS NULL ORDER BY raised"
        return {row[:3]: row[3:] for row in self.rows(query)}

    def metrics(self) -> tuple[dict[str, bool], dict[tuple[str, str, int], int]]:
        """Return which robots failed and which alarms stand, as metrics.prom says."""
        text = (self.out / "metrics.prom").read_text()
        failed = re.findall(r'opamc_robot_failed\{robot="([^"]*)"\} (\d)', text)
        of = r'opamc_joint_alarm\{robot="([^"]*)",program="([^"]*)",axis="(\d+)"\} ([12])'
        alarms = {(one, two, int(axis)): int(n) for one, two, axis, n in re.findall(of, text)}
        return {robot: value == "1" for robot, value in failed}, alarms


def demand(is_so: object, otherwise: str) -> None:
    """Raise a violation unless something is so."""
    if not is_so:
        raise ViolationError(otherwise)
