"""Give the command thousands of wrong inputs: each must end in a sentence and the right code.

    python tests/reliability/fuzz.py --count 5000 --minutes 10 --seed 1

Every input is made from a good one by `mutations`. A failure is an exit code of 70 or of a signal,
a traceback or a warning of a library, an exit other than 0, 1 and 5 without a sentence, more than
30 s, or more than 2 GB. Failing inputs are kept and named.
"""

import argparse
import contextlib
import io
import json
import os
import random
import re
import resource
import shutil
import signal
import sqlite3
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from pyarrow import feather
from scipy.io import savemat

sys.path.insert(0, str(Path(__file__).parent))
from mutations import ODD_YAML, damaged, mutated, table_mutated
from recordings import columns, record

from opamc_cli.__main__ import main

ROOT = Path(__file__).parents[2]
LONGEST_S = 30
MOST_BYTES = 2 << 30
GOOD_CODES = {0, 1, 2, 3, 4, 5}
ALONE = ("--set", "joint.explain=false")


CELL = {
    "runs": "logs/{robot}/{night}/*.parquet",
    "robots": "auto",
    "baseline": {"nights": 2},
    "out": "nightly",
    "set": {"joint.explain": False},
    "alarm": {"nights": 2, "of": 3, "gross": 0.9},
    "keep": {"reports": 30},
}
CLOSED = {
    "joint": {"gear_ratio": 100, "pole_pairs": 5},
    "effects": [
        {"effect": "inertia", "coefficients": [0.1]},
        {"effect": "coulomb", "coefficients": [0.5]},
        {"effect": "ripple", "parameters": {"order": 2.0}, "coefficients": [0.1, 0.2]},
    ],
    "closed": {"unit": "A", "rmse": 0.1, "r2": 0.9, "speed_rad_s": 2.0, "temperature_c": None},
}


class TooLongError(Exception):
    """An input that took longer than it may."""


def call(*arguments: object) -> tuple[int, str, str]:
    """Run the command in this process; return exit code, standard output and error."""
    out, err = io.StringIO(), io.StringIO()
    code: Any = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as ended:
            code = ended.code
    return int(code or 0), out.getvalue(), err.getvalue()


class Inputs:
    """The good inputs, and how each kind of wrong one is made from them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.runs = [record(folder / "good" / f"{seed}.parquet", seed) for seed in range(3)]
        self.target = record(folder / "good-target" / "9.parquet", 9)
        self.out = folder / "diagnosed"
        code, _, err = call(
            *("diagnose", "--baseline", folder / "good", "--target", self.target),
            *("--out", self.out, *ALONE),
        )
        assert code == 0, err
        self.log = folder / "log.csv"
        rows = np.column_stack([*columns(0).values()])[:500]
        np.savetxt(self.log, rows, delimiter=",", fmt="%.4f")
        self.map = {
            "sampling_rate_hz": 1000,
            "header": False,
            "skip_rows": 0,
            "separator": ",",
            "columns": {
                name: {"source": i, "unit": "A", "scale": 1.0} for i, name in enumerate(columns(0))
            },
            "metadata": {"robot": "R1", "speed_percent": 50, "started_at": "2026-03-01T00:00:00Z"},
        }
        self.short = record(
            folder / "short" / "s.parquet", 1, lambda c: c.update({k: v[:50] for k, v in c.items()})
        )
        self.loop = {
            "axes": [
                {
                    "axis": 1,
                    "declared": ["inertia"],
                    "sealed": ["cycle 1"],
                    "before": {"rmse_a": 0.1, "r2": 0.9},
                    "steps": [
                        {
                            "effect": "ripple",
                            "domain": "motor-angle",
                            "parameters": {"order": 2.0},
                            "interpretation": "kinematic error",
                            "gain": 0.2,
                            "p_value": 0.01,
                            "decoy_gain": 0.0,
                            "ties": ["coulomb"],
                            "rmse_before_a": 0.1,
                            "rmse_after_a": 0.08,
                        }
                    ],
                    "after": {"rmse_a": 0.08, "r2": 0.95},
                    "floor_a": 0.05,
                    "explained_share": 0.5,
                    "rejected": [{"effect": "spring", "why": "no gain", "gain": 0.0}],
                    "untestable": [{"effect": "warmup", "why": "no temperature"}],
                    "verdict": "partial",
                }
            ]
        }

    def make(self, kind: str, rng: random.Random, place: Path) -> list[object]:
        """Return the arguments of a command that is given one wrong input."""
        return list(getattr(self, f"_{kind}")(rng, place))

    def _yaml(self, tree: Any, rng: random.Random, path: Path) -> Path:
        if rng.random() < 0.4:
            text = yaml.safe_dump(tree, default_flow_style=rng.random() < 0.3, allow_unicode=True)
            lines = text.splitlines() or [""]
            at = rng.randrange(len(lines))
            key = lines[at].partition(":")[0]
            lines[at] = f"{key}: {rng.choice(ODD_YAML)}"
            path.write_text("\n".join(lines))
        elif rng.random() < 0.3:
            path.write_bytes(damaged(yaml.safe_dump(tree).encode(), rng))
        else:
            with contextlib.suppress(yaml.YAMLError):
                path.write_text(yaml.safe_dump(mutated(tree, rng)), encoding="utf-8")
        if not path.exists():
            path.write_text("")
        return path

    def _config(self, rng: random.Random, place: Path) -> list[object]:
        tree = yaml.safe_load((ROOT / "configs" / "default.yaml").read_text())
        return ["config", "check", "--config", self._yaml(tree, rng, place / "c.yaml")]

    def _set(self, rng: random.Random, place: Path) -> list[object]:
        keys = (
            "score.base",
            "patterns.orders",
            "segment",
            "patterns.tau",
            "x",
            "",
            "a.b.c",
            "report.title",
        )
        text = rng.choice((*ODD_YAML, "1", "[4, 5]", "x" * 3000, "\t", "1e300", "-1"))
        return ["config", "check", "--set", f"{rng.choice(keys)}={text}"]

    def _map(self, rng: random.Random, place: Path) -> list[object]:
        file = self._yaml(self.map, rng, place / "map.yaml")
        return ["ingest", self.log, "--map", file, "--out", place / "out"]

    def _csv(self, rng: random.Random, place: Path) -> list[object]:
        (place / "map.yaml").write_text(yaml.safe_dump(self.map))
        (place / "log.csv").write_bytes(damaged(self.log.read_bytes(), rng))
        return ["ingest", place / "log.csv", "--map", place / "map.yaml", "--out", place / "out"]

    def _model(self, rng: random.Random, place: Path) -> list[object]:
        tree = yaml.safe_load((ROOT / "configs" / "model.yaml").read_text())
        tree = {"library": [], "without": [], **tree}
        tree["effects"] = [
            *tree.get("effects", []),
            {"effect": "ripple", "parameters": {"order": 2.0}},
        ]
        file = self._yaml(tree, rng, place / "model.yaml")
        return ["model", "fit", self.short, "--model", file, "--out", place / "out"]

    def _testbed(self, rng: random.Random, place: Path) -> list[object]:
        tree = yaml.safe_load((ROOT / "configs" / "samples.yaml").read_text())
        base = ROOT / "configs" / str(tree.get("based_on", "testbed.yaml"))
        tree["based_on"] = str(base)
        file = self._yaml(tree, rng, place / "testbed.yaml")
        small = ("--cycles", "1", "--sessions", "1", "--no-truth-signals")
        return ["simulate", "--config", file, *small, "--out", place / "out"]

    def _run(self, rng: random.Random, place: Path) -> list[object]:
        file = place / "run.parquet"
        match rng.randrange(3):
            case 0:
                file.write_bytes(damaged(self.runs[0].read_bytes(), rng))
            case 1:
                table_mutated(self.runs[0], file, rng)
            case _:
                table = pq.read_table(self.runs[0])
                info = json.loads(table.schema.metadata[b"opamc"])
                raw = json.dumps(mutated(info, rng)).encode()
                if rng.random() < 0.3:
                    raw = damaged(raw, rng)
                pq.write_table(table.replace_schema_metadata({b"opamc": raw}), file)
        return ["segment", file, "--out", place / "out"]

    def _table(self, rng: random.Random, place: Path) -> list[object]:
        name, command = rng.choice(
            (
                ("segments", "identify"),
                ("motions", "patterns"),
                ("patterns", "score"),
                ("patterns", "decide"),
                ("spectra", "decide"),
                ("scores", "report"),
                ("features", "report"),
                ("motions", "report"),
            )
        )
        out = shutil.copytree(self.out, place / "out")
        file = out / f"{name}.parquet"
        file = file if file.exists() else out / "baseline" / f"{name}.parquet"
        content = file.read_bytes()
        file.unlink()
        match rng.randrange(3):
            case 0:
                file.write_bytes(damaged(content, rng))
            case 1:
                source = place / "source.parquet"
                source.write_bytes(content)
                table_mutated(source, file, rng)
            case _:
                table = pq.read_table(io.BytesIO(content))
                info = json.loads(table.schema.metadata[b"opamc_table"])
                raw = json.dumps(mutated(info, rng)).encode()
                pq.write_table(table.replace_schema_metadata({b"opamc_table": raw}), file)
        runs = ("--runs", self.folder / "good")
        verdict = out / "verdict.json"
        if command == "report" and rng.random() < 0.8:
            verdict.unlink()  # which would refuse the table by its hash
        sides = _sides(out)
        return {
            "identify": ["identify", file, *runs, "--out", place / "o"],
            "patterns": ["patterns", file, *runs, "--out", place / "o"],
            "score": ["score", *sides, "--out", place / "o"],
            "decide": ["decide", "--out", out],
            "report": ["report", "--out", out, "--baseline", self.folder / "good"],
        }[command]

    def _verdict(self, rng: random.Random, place: Path) -> list[object]:
        out = shutil.copytree(self.out, place / "out")
        name = rng.choice(("verdict.json", "loop.json"))
        tree = (
            json.loads((out / "verdict.json").read_text()) if name == "verdict.json" else self.loop
        )
        raw = json.dumps(mutated(tree, rng)).encode()
        if rng.random() < 0.2:
            raw = damaged(raw, rng)
        (out / name).write_bytes(raw)
        return ["report", "--out", out]

    def _cell(self, rng: random.Random, place: Path) -> list[object]:
        for number, run in enumerate(self.runs):
            night = place / "logs" / "r1" / f"2026-03-0{number + 1}"
            night.mkdir(parents=True)
            (night / "run.parquet").symlink_to(run)
        file = self._yaml(CELL, rng, place / "cell.yaml")
        return ["nightly", file, "--dry-run", "--jobs", "1"]

    def _history(self, rng: random.Random, place: Path) -> list[object]:
        """Change a value of the history of a cell, or its bytes."""
        good = self.folder / "cell"
        if not good.exists():
            self._cell(random.Random(0), good)
            (good / "cell.yaml").write_text(yaml.safe_dump(CELL))
            code, _, err = call("nightly", good / "cell.yaml", "--jobs", "1")
            assert code == 0, err
        (place / "cell").mkdir()
        for name in ("cell.yaml", "logs"):
            (place / "cell" / name).symlink_to(good / name)
        out = place / "cell" / "nightly"
        out.mkdir()
        history = out / "history.sqlite"
        with sqlite3.connect(good / "nightly" / "history.sqlite") as source:
            source.execute("VACUUM INTO ?", (str(history),))
        if rng.random() < 0.3:
            history.write_bytes(damaged(history.read_bytes(), rng))
        else:
            with sqlite3.connect(history) as base, contextlib.suppress(sqlite3.Error):
                table = rng.choice(("file", "night", "verdict", "measure", "event", "baseline"))
                names = [row[1] for row in base.execute(f"PRAGMA table_info({table})")]
                value = rng.choice((None, "x", "", "[]", "{}", "1e300", -1, 2**40, 1e300, b"\xff"))
                base.execute(f"UPDATE {table} SET {rng.choice(names)} = ?", (value,))
            base.close()
        seen = ["history", "--cell", place / "cell" / "cell.yaml"]
        return rng.choice((["nightly", place / "cell" / "cell.yaml", "--jobs", "1"], seen))

    def _closed(self, rng: random.Random, place: Path) -> list[object]:
        file = self._yaml(CLOSED, rng, place / "model.yaml")
        return ["model", "evaluate", self.short, "--model", file, "--out", place / "out"]

    def _foreign(self, rng: random.Random, place: Path) -> list[object]:
        """Damage a table of another program, guess its map or use one."""
        table = pa.table({"t": np.arange(500) / 1000, "i_1": np.sin(np.arange(500) / 9)})
        name = rng.choice(("log.parquet", "log.feather", "log.mat"))
        good = place / name
        if name.endswith("parquet"):
            pq.write_table(table, good)
        elif name.endswith("feather"):
            feather.write_feather(table, good)
        else:
            savemat(good, {n: table[n].to_numpy() for n in table.column_names})
        good.write_bytes(damaged(good.read_bytes(), rng))
        if rng.random() < 0.4:
            return ["ingest", good, "--guess"]
        (place / "map.yaml").write_text("time: t\ncolumns: {axis1_current: {source: i_1, unit: A}}")
        return ["ingest", good, "--map", place / "map.yaml", "--out", place / "out"]

    def _latent(self, rng: random.Random, place: Path) -> list[object]:
        sides = _sides(self.out)
        good = self.folder / "latent.json"
        if not good.exists():
            for axis in (1, 2):
                call(
                    "score",
                    *sides,
                    "--learn",
                    good,
                    "--fault-axis",
                    axis,
                    "--out",
                    self.folder / "l",
                )
        tree = json.loads(good.read_text())
        raw = json.dumps(mutated(tree, rng)).encode()
        (place / "latent.json").write_bytes(damaged(raw, rng) if rng.random() < 0.2 else raw)
        flag = rng.choice(("--lda", "--learn"))
        return ["score", *sides, flag, place / "latent.json", "--out", place / "o"]


def _sides(out: Path) -> tuple[object, ...]:
    sides = [out / role / "patterns.parquet" for role in ("baseline", "target")]
    return ("--baseline", sides[0], "--target", sides[1])


KINDS = {
    "config": 3,
    "set": 2,
    "map": 3,
    "csv": 2,
    "model": 2,
    "testbed": 1,
    "run": 4,
    "table": 5,
    "verdict": 2,
    "latent": 1,
    "cell": 1,
    "history": 2,
    "closed": 2,
    "foreign": 2,
}
"""How often each kind of input is drawn."""


def wrong(code: int, out: str, err: str, seconds: float) -> str | None:
    """Return what is wrong with an end, or None."""
    if code not in GOOD_CODES:
        last = err.strip().splitlines()[-1] if err.strip() else f"exit {code}"
        return re.sub(r"[0-9]+|'[^']*'|/[^ :]*", "…", last)[:160]
    for line in err.splitlines():
        if "Traceback" in line or "Warning" in line:
            return line[:160]
    if code in (2, 3, 4) and "opamc: " not in err and "Error: " not in err:
        return f"exit {code} without a sentence"
    longest = max((len(line) for line in err.splitlines()), default=0)
    if longest > 1200:
        return f"a sentence of {longest} characters"
    if seconds > LONGEST_S:
        return f"{seconds:.0f} s"
    return None


@contextmanager
def bounded_memory(most: int) -> Iterator[None]:
    """Bound the address space for a while: what comes after, such as a browser, needs more."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def fuzz(count: int, minutes: float, seed: int, kept: Path | None = None) -> Counter[str]:
    """Try `count` inputs in at most so many minutes; return how each kind of them ended."""
    ends: Counter[str] = Counter()
    kinds, weights = zip(*KINDS.items(), strict=True)
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as name, bounded_memory(3 * MOST_BYTES):
        inputs = Inputs(Path(name))
        for number in range(count):
            if time.monotonic() - begun > 60 * minutes:
                break
            rng = random.Random(f"{seed} {number}")
            kind = rng.choices(kinds, weights)[0]
            place = Path(name) / "case"
            place.mkdir()
            arguments = inputs.make(kind, rng, place)
            why = _try(arguments)
            ends[f"{kind}: {why}"] += 1
            if why is not None and not why.startswith("exit ") and kept is not None:
                shutil.copytree(place, kept / f"{number}-{kind}", dirs_exist_ok=True)
                print(number, kind, why, " ".join(map(str, arguments))[:300], flush=True)
            shutil.rmtree(place)
    return ends


def _try(arguments: list[object]) -> str:
    def late(*_: object) -> None:
        raise TooLongError

    signal.signal(signal.SIGALRM, late)
    signal.alarm(10 * LONGEST_S)
    begun = time.process_time()  # of a machine that others use too
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default")
            code, out, err = call(*arguments)
        why = wrong(code, out, err, time.process_time() - begun)
        return f"exit {code}" if why is None else f"WRONG {why}"
    except TooLongError:
        return f"WRONG longer than {LONGEST_S} s"
    except BaseException:  # noqa: BLE001 - whatever gets through is what is looked for
        return f"WRONG {traceback.format_exc().strip().splitlines()[-1][:160]}"
    finally:
        signal.alarm(0)


def peak_bytes() -> int:
    """Return the most memory that this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=5000)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, default=Path("fuzz-failures"))
    chosen = parser.parse_args()
    os.environ["OPAMC_DEBUG"] = ""
    ended = fuzz(chosen.count, chosen.minutes, chosen.seed, chosen.keep)
    for end, number in sorted(ended.items()):
        print(f"{number:6d}  {end}")
    failures = sum(number for end, number in ended.items() if "WRONG" in end)
    total, peak = sum(ended.values()), peak_bytes() / 1e9
    print(f"{total} inputs, {failures} wrong ends, {peak:.2f} GB at most")
    sys.exit(bool(failures))
