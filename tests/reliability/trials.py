"""Commands on small inputs, each over a result that is there already, for kills and faults."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import yaml
from forks import Ended, Fork
from fuzz import CLOSED, Inputs
from recordings import record

ROOT = Path(__file__).parents[2]
COMMAND = (sys.executable, "-m", "opamc_cli")
LONGEST_S = 600.0
QUICK = ("--set", "joint.explain=false")
CELL = {
    "runs": "nights/{robot}/{night}/*.parquet",
    "robots": "auto",
    "baseline": {"nights": 2},
    "out": "nightly-out",
    "set": {"joint.explain": False},
}


@dataclass(frozen=True)
class Trial:
    """A command, and the folder whose last result it replaces."""

    name: str
    arguments: tuple[str, ...]
    out: Path
    before: Path
    codes: tuple[int, ...] = (0,)


def trials(folder: Path, names: tuple[str, ...] = ()) -> list[Trial]:
    """Return one trial of each kind of command (or of some), with inputs and last results."""
    ready = Fork(lambda: _prepare(folder)).wait(LONGEST_S)
    assert ready.returncode == 0, ready.stderr
    good, out = folder / "good", folder / "diagnosed"
    target = folder / "good-target" / "9.parquet"
    patterns = [out / role / "patterns.parquet" for role in ("baseline", "target")]
    short = ROOT / "configs" / "samples.yaml"
    made: list[Trial] = []
    for name, arguments in {
        "diagnose": ["diagnose", "--baseline", good, "--target", target, *QUICK],
        "segment": ["segment", good],
        "identify": ["identify", out / "baseline" / "segments.parquet", "--runs", good],
        "patterns": ["patterns", out / "baseline" / "motions.parquet", "--runs", good],
        "score": ["score", "--baseline", patterns[0], "--target", patterns[1]],
        "decide": ["decide"],
        "report": ["report"],
        "sweep": ["sweep", "--baseline", good, "--tau", "2:3", "--order", "4:4", "--jobs", "1"],
        "select": ["select", out / "baseline" / "motions.parquet", "--runs", good, "--order", "3"],
        "simulate": ["simulate", "--config", short, "--cycles", "1", "--sessions", "2"],
        "ingest": ["ingest", folder / "log.csv", "--map", folder / "map.yaml"],
        "fit": ["model", "fit", target, "--axis", "1"],
        "trace": ["model", "trace", target, "--axis", "1"],
        "close": ["model", "close", target, "--axis", "1"],
        "evaluate": ["model", "evaluate", target, "--model", folder / "closed.yaml"],
        "nightly": ["nightly", folder / "cell.yaml"],
    }.items():
        if names and name not in names:
            continue
        place, before = folder / f"{name}-out", folder / f"{name}-before"
        if name in ("report", "decide"):
            shutil.copytree(out, before, symlinks=True)
        words = [str(argument) for argument in arguments]
        words += [] if name == "nightly" else ["--out", str(place)]
        trial = Trial(name, tuple(words), place, before)
        if not before.exists():
            ended = run(trial)
            assert ended.returncode in trial.codes, (name, ended.stderr)
            shutil.copytree(place, before, symlinks=True)
            if name in NEW:
                Fork(lambda: NEW[name](folder)).wait(LONGEST_S)  # noqa: B023 - it ends at once
        made.append(trial)
    return made


def _new_log(folder: Path) -> None:
    lines = (folder / "log.csv").read_text().splitlines()
    (folder / "log.csv").write_text("\n".join([*lines, lines[-1]]) + "\n")


def _new_night(folder: Path) -> None:
    record(folder / "nights" / "r1" / "2026-03-04" / "run.parquet", 12)


NEW: dict[str, Callable[[Path], None]] = {"ingest": _new_log, "nightly": _new_night}
"""What is done once the last result is there, where a command leaves alone what it has done."""


def _prepare(folder: Path) -> None:
    inputs = Inputs(folder)
    (folder / "map.yaml").write_text(yaml.safe_dump(inputs.map))
    (folder / "cell.yaml").write_text(yaml.safe_dump(CELL))
    (folder / "closed.yaml").write_text(yaml.safe_dump(CLOSED))
    for number, run in enumerate([*inputs.runs[:2], inputs.target]):
        night = folder / "nights" / "r1" / f"2026-03-0{number + 1}"
        night.mkdir(parents=True)
        shutil.copyfile(run, night / "run.parquet")


def reset(trial: Trial) -> None:
    """Put the last result back."""
    shutil.rmtree(trial.out, ignore_errors=True)
    shutil.copytree(trial.before, trial.out, symlinks=True)


def run(trial: Trial, at_end: Callable[[], object] = lambda: None, **environment: str) -> Ended:
    """Run a trial's command to its end."""
    return Fork(trial.arguments, environment, at_end).wait(LONGEST_S)


class Started:
    """A command that an interpreter of its own runs, from its first millisecond."""

    def __init__(self, arguments: tuple[str, ...]) -> None:
        self._process = subprocess.Popen(
            [*COMMAND, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONFAULTHANDLER": "1"},
            start_new_session=True,
        )
        self.pid = self._process.pid

    def wait(self, timeout_s: float) -> Ended:
        """Return how it ended."""
        out, err = self._process.communicate(timeout=timeout_s)
        return Ended(self._process.returncode, out, err)
