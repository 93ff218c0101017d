"""Whether `opamc nightly` is silent where it must not be: random walks over a cell's states.

A walk is 30 to 50 steps: files that come, come late, are cut, copied, replaced, renamed, gone; a
cell.yaml that is changed; alarms acknowledged, baselines begun anew; an old history put back;
starts that are killed. The diagnosis is a table: what a recording says is known by its hash. After
each start what was said is held against what is so:

- an alarm that was told ends with a line of its own, and a new one is told;
- a robot or joint that is newly not judged is named, and the exit code is that of docs/nightly.md;
- a second start changes nothing and says nothing;
- the history that a walk leaves is that of one start over all its files (where none was lost);
- `--dry-run` changes nothing and foresees all nights that are done;
- metrics, page, `--json` and history tell the same alarms.

    python benchmarks/nightly/nightly_walk.py 9000 40                # seeds 9000 to 9039, 3 s each
    python benchmarks/nightly/nightly_walk.py 9027 1 --shrink 60  # the fewest steps found in 60 s
    python benchmarks/nightly/nightly_walk.py 9027 1 --verbose       # each step, and what was said

In walks of even seeds no file is lost or changed.
"""

import argparse
import gc
import io
import re
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout, suppress
from pathlib import Path

from walk.by_table import answer_by
from walk.cell import ViolationError, World
from walk.checks import check_afresh, start
from walk.steps import STEPS, Op, add, generate

from opamc_cli.__main__ import main


def walk(ops: Sequence[Op], *, loses: bool, log: Callable[..., None] = lambda *_: None) -> str:
    """Return what a walk has violated, and by which step; empty if nothing."""
    shared = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None) as name:
        world = World(Path(name), log)
        op: Op = ()
        try:
            for op in ops:
                log("--", op)
                (start if op[0] == "start" else STEPS[op[0]][0])(world, *op[1:])
                world.save()
            if not loses:
                op = ("afresh",)
                check_afresh(world)
        except ViolationError as error:
            return f"{error} at {op}".replace(name, ".")
    return ""


def shrink(ops: list[Op], found: str, seconds: float, *, loses: bool) -> list[Op]:
    """Leave out steps as long as the same is violated."""

    def kind(text: str) -> str:
        return re.sub(r"[\d'\"]", "", text)[:20]

    until = time.monotonic() + seconds
    changed = True
    while changed:
        changed = False
        for index in reversed(range(len(ops))):
            less = ops[:index] + ops[index + 1 :]
            if time.monotonic() < until and kind(walk(less, loses=loses)) == kind(found):
                ops, changed = less, True
    return ops


def load_everything() -> None:
    """Load in this process what each start would load in its own."""
    with tempfile.TemporaryDirectory() as name, redirect_stdout(io.StringIO()):
        world = World(Path(name))
        answer_by(world.table)
        for code in ("HH", "HH", "GH"):
            add(world, {"r1": code})
        for options in (["--json"], ["--dry-run"]):
            with suppress(SystemExit):
                main(["nightly", str(world.cell), *options])
    gc.freeze()


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("first", type=int, help="first seed")
    parser.add_argument("count", type=int, help="how many")
    parser.add_argument("--shrink", type=float, default=0.0, metavar="SECONDS")
    parser.add_argument("--verbose", action="store_true")
    chosen = parser.parse_args()
    violated = 0
    load_everything()
    begun = time.monotonic()
    for seed in range(chosen.first, chosen.first + chosen.count):
        steps, losing_files = generate(seed), bool(seed % 2)
        log = print if chosen.verbose else lambda *_: None
        found = walk(steps, loses=losing_files, log=log)
        if found:
            violated += 1
            print(f"seed {seed}, {len(steps)} steps: {found:.900}", flush=True)
            if chosen.shrink:
                fewest = shrink(steps, found, chosen.shrink, loses=losing_files)
                print(f"  {fewest}\n  {walk(fewest, loses=losing_files):.300}", flush=True)
    took = time.monotonic() - begun
    print(f"{violated} of {chosen.count} walks violated, {took:.0f} s")
    sys.exit(violated > 0)
