"""Run the commands of README.md and put their output in, or check that it still is theirs.

    python benchmarks/readme.py            # write
    python benchmarks/readme.py --check    # exit 1 with the first block that differs

Every block that begins with ``$`` is run, in order, in a folder with the files that a reader would
have: the example of `opamc example`, and recordings of the same virtual robot as a controller logs
them, with a clock that jitters (`logs/`, made here). A comment above a block keeps its first lines:
``<!-- lines: 8 -->``. Blocks that name measured recordings are passed over where these are absent.

Words have to be equal, numbers within 2 %: another machine's libraries round otherwise.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from opamc_cli.storage.runs.run import Run

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
MEASURED = ROOT.parent / "shared" / "data" / "kinova_gen3" / "joint_5_trapez.csv"
BLOCK = re.compile(r"(?:<!-- lines: (\d+) -->\n)?```\n(\$ .*?)```\n", re.DOTALL)
NUMBER = re.compile(r"-?[0-9]+(?:\.[0-9]+)?")
WITHIN = 0.02
SIMULATE = (
    "opamc simulate --config samples --seed 11 --no-truth-signals --cycles 2 "
    "--set recording.columns=[current,position,velocity] --set recording.sampling_rate_hz=500"
)


def make_logs(work: Path) -> None:
    """Record the virtual robot and write what a controller's logger would have written."""
    run(f"{SIMULATE} --sessions 5 --out sim/normal", work)
    run(f"{SIMULATE} --first-session 5 --sessions 2 --fault 3 --out sim/today", work)
    rng = np.random.default_rng(0)
    for path in sorted((work / "sim").rglob("*.parquet")):
        with Run(path) as recording:
            data = recording.read(recording.columns)
            fine_s = np.arange(recording.n_samples) / recording.sampling_rate_hz
        rate_hz = 125 * rng.uniform(0.99, 1.01)
        n = int((fine_s[-1] - 0.1) * rate_hz)
        stamps_s = (np.arange(n) + 0.3 * rng.uniform(-1, 1, n)) / rate_hz + 0.05
        names, columns = ["timestamp"], [stamps_s + 3600]
        for kind, column in (("q", "position"), ("qd", "velocity"), ("current", "current")):
            for axis in (1, 2, 3):
                names.append(f"actual_{kind}_{axis - 1}")
                columns.append(np.interp(stamps_s, fine_s, data[f"axis{axis}_{column}"]))
        target = work / "logs" / path.parent.name / f"{path.stem}.csv"
        target.parent.mkdir(parents=True, exist_ok=True)
        np.savetxt(
            target,
            np.column_stack(columns),
            fmt="%.7f",
            delimiter=",",
            header=",".join(names),
            comments="",
        )


def run(command: str, work: Path) -> str:
    """Return what a command prints: its result, or its error."""
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "COLUMNS": "120",
    }
    ended = subprocess.run(
        command,
        shell=True,
        cwd=work,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if ended.returncode not in (0, 1, 2):
        sys.exit(f"{command}: exit code {ended.returncode}\n{ended.stderr}")
    # notes on stderr would fill the page; an error is what its block is about
    return ended.stderr if ended.returncode == 2 else ended.stdout


def filled(match: re.Match[str], work: Path) -> str:
    """Return a block with the output of its commands."""
    lines, body = match[1], match[2]
    commands = [line[2:] for line in body.splitlines() if line.startswith("$ ")]
    if any("kinova" in command for command in commands) and not MEASURED.exists():
        return match[0]
    shown: list[str] = []
    for command in commands:
        output = run(command.replace("kinova/", f"{MEASURED.parent}/"), work)
        output = output.replace(f"{MEASURED.parent}/", "kinova/")
        told = output.rstrip().splitlines()
        limit = int(lines) if lines else len(told)
        shown += [f"$ {command}", *told[:limit], *(["..."] if len(told) > limit else [])]
    head = f"<!-- lines: {lines} -->\n" if lines else ""
    text = "\n".join(line.rstrip() for line in shown)
    return f"{head}```\n{text}\n```\n"


def written_anew(work: Path) -> str:
    """Return README.md with what its commands print in a folder that holds `make_logs`' logs."""
    return BLOCK.sub(lambda match: filled(match, work), README.read_text(encoding="utf-8"))


def differs(old: str, new: str) -> str | None:
    """Return the first line that is another one, numbers aside that are nearly equal."""
    for one, other in zip([*old.splitlines(), ""], [*new.splitlines(), ""], strict=False):
        numbers = [list(map(float, NUMBER.findall(line))) for line in (one, other)]
        words = [re.sub(r"\s+", " ", NUMBER.sub("#", line)) for line in (one, other)]
        if words[0] != words[1] or any(
            abs(a - b) > WITHIN * max(abs(a), abs(b)) for a, b in zip(*numbers, strict=True)
        ):
            return f"README: {one}\n   now: {other}"
    return None


def main() -> None:
    """Write README.md, or compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true")
    check = parser.parse_args().check
    old = README.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        make_logs(work)
        new = written_anew(work)
    if not check:
        README.write_text(new, encoding="utf-8")
    elif (where := differs(old, new)) is not None:
        sys.exit(f"{where}\nwrite it anew with python benchmarks/readme.py")


if __name__ == "__main__":
    main()
