"""How soon the commands answer: help, a second start, closing the loop on ten minutes of one axis.

    python benchmarks/commands.py

Every figure is a process of its own with compiled code already cached, the median of several; wall
and processor seconds beside each other, since only the second holds on a busy machine.
"""

import argparse
import statistics
import subprocess
import tempfile
from pathlib import Path

from chain.pipeline import OPAMC, ROOT, Measured, measure

SAMPLE = ROOT / "data" / "samples" / "normal" / "session-000.parquet"


def median(command: list[str], times: int) -> Measured:
    """Run a command once unmeasured, then so many times; return the median of each figure."""
    measure(command)
    results = [measure(command) for _ in range(times)]
    return Measured(
        *(statistics.median(getattr(r, f) for r in results) for f in ("wall_s", "cpu_s", "peak_mb"))
    )


def show(what: str, reach: str, result: Measured) -> None:
    print(
        f"| {what} | {reach} | {result.wall_s:.2f} s | {result.cpu_s:.2f} s | "
        f"{result.peak_mb:.0f} MB |",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--minutes", type=float, default=10.0, help="Length of the joint's run.")
    parser.add_argument("--seed", type=int, default=1000)
    arguments = parser.parse_args()
    print("| what | reach | wall | processor | memory |")
    print("|---|---|---|---|---|")
    show("`opamc --help`", "0.2 s", median([*OPAMC, "--help"], arguments.times))
    show("`opamc segment --help`", "0.2 s", median([*OPAMC, "segment", "--help"], arguments.times))
    with tempfile.TemporaryDirectory() as folder:
        out = ["--out", folder, "--quiet"]
        segment = [*OPAMC, "segment", str(SAMPLE), *out]
        show(
            "start to the end of `opamc segment` on a short run",
            "1.5 s",
            median(segment, arguments.times),
        )
        runs = Path(folder) / "joint"
        # one cycle of four motions lasts about 4.5 s at full speed
        simulate = [*OPAMC, "simulate", "--config", str(ROOT / "configs" / "testbed.yaml")]
        simulate += ["--seed", str(arguments.seed), "--no-truth-signals", "--out", str(runs)]
        simulate += ["--cycles", str(round(arguments.minutes * 60 / 4.5)), "--set"]
        simulate += ["program.axes=[3]", "--set", "recording.columns=[current, position]"]
        simulate += ["--set", "effects=[{axis: 3, name: ripple, magnitude: 0.3}]"]
        subprocess.run(simulate, check=True, stdout=subprocess.DEVNULL)
        close = [*OPAMC, "model", "close", str(runs), "--axis", "3", *out]
        close += ["--model", str(ROOT / "configs" / "model.yaml")]
        show(
            f"`opamc model close`, {arguments.minutes:g} min of one axis at 2048 Hz",
            "20 s",
            measure(close),
        )


if __name__ == "__main__":
    main()
