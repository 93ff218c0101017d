"""Commands on small inputs, each over a result that is there already, for kills and faults."""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import yaml
from fuzz import Inputs

ROOT = Path(__file__).parents[2]
COMMAND = (sys.executable, "-m", "opamc_cli")


@dataclass(frozen=True)
class Trial:
    """A command, and the folder whose last result it replaces."""

    name: str
    arguments: tuple[str, ...]
    out: Path
    before: Path


def trials(folder: Path, names: tuple[str, ...] = ()) -> list[Trial]:
    """Return one trial of each kind of command (or of some), with inputs and last results."""
    inputs = Inputs(folder)
    (folder / "map.yaml").write_text(yaml.safe_dump(inputs.map))
    testbed = ROOT / "configs" / "samples.yaml"
    good, sides = folder / "good", ("baseline", "target")
    patterns = [inputs.out / role / "patterns.parquet" for role in sides]
    made: list[Trial] = []
    for name, arguments in {
        "diagnose": ["--baseline", good, "--target", inputs.target, "--set", "joint.explain=false"],
        "segment": [good],
        "identify": [inputs.out / "baseline" / "segments.parquet", "--runs", good],
        "patterns": [inputs.out / "baseline" / "motions.parquet", "--runs", good],
        "score": ["--baseline", patterns[0], "--target", patterns[1]],
        "sweep": ["--baseline", good, "--tau", "2:3", "--order", "4:4", "--jobs", "2"],
        "simulate": ["--config", testbed, "--cycles", "1", "--sessions", "2", "--jobs", "1"],
        "ingest": [inputs.log, "--map", folder / "map.yaml"],
        "report": [],
        "decide": [],
    }.items():
        if names and name not in names:
            continue
        out, before = folder / f"{name}-out", folder / f"{name}-before"
        if name in ("report", "decide"):
            shutil.copytree(inputs.out, before, symlinks=True)
        trial = Trial(name, (name, *map(str, arguments), "--out", str(out)), out, before)
        if not before.exists():
            ended = run(trial)
            assert ended.returncode == 0, (name, ended.stderr)
            shutil.copytree(out, before, symlinks=True)
        made.append(trial)
    return made


def reset(trial: Trial) -> None:
    """Put the last result back."""
    shutil.rmtree(trial.out, ignore_errors=True)
    shutil.copytree(trial.before, trial.out, symlinks=True)


def start(trial: Trial, **environment: str) -> "subprocess.Popen[str]":
    """Start a trial's command in a session of its own."""
    return subprocess.Popen(
        [*COMMAND, *trial.arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        start_new_session=True,
    )


def run(trial: Trial, **environment: str) -> "subprocess.CompletedProcess[str]":
    """Run a trial's command to its end."""
    process = start(trial, **environment)
    out, err = process.communicate(timeout=300)
    return subprocess.CompletedProcess(trial.arguments, process.returncode, out, err)
