"""Measured phase currents: divergence over the level of an inter-turn short circuit.

    python benchmarks/chain/itsc.py

Takes the public ITSC recordings (three phases of an induction motor, 60 Hz supply, 1000 Hz, 5 s;
five healthy, five at each of the levels A1..A4 = 10..40 % of phase A's turns) through the real
chain, for orders 4 and 5, γ 1 and 2, Hilbert and Clarke envelopes. Then asks `opamc diagnose` at
its defaults about every level, and about each healthy recording against the other four.
"""

import argparse
import io
import json
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from opamc_cli.__main__ import main as opamc
from opamc_cli.config import load_config
from opamc_cli.stages.chain import score
from opamc_cli.stages.chain.to_patterns import run_chain

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "itsc_phase_current"
LEVELS = ("A1", "A2", "A3", "A4")


def command(*arguments: str | Path) -> int:
    """Run an opamc command without its output; return its exit code."""
    try:
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            opamc([str(argument) for argument in arguments])
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def mean_divergences(
    healthy: Path, faulty: Path, out: Path, settings: list[str], order: int
) -> tuple[dict[str, float], float]:
    """Mean JSD by level ("healthy": leave one recording out), and its rank correlation."""
    config = load_config(None, [*settings, f"patterns.orders=[{order}]"])
    baseline = run_chain([healthy], config, out / "baseline")
    target = run_chain([faulty], config, out / "target", reference=baseline.motions)
    rows = score.run(baseline.patterns, target.patterns, config, out).scores.to_pylist()
    by_recording: dict[tuple[str, str], list[float]] = {}
    for row in rows:
        level = "healthy" if row["role"] == "baseline" else row["run"].split("_")[1]
        by_recording.setdefault((level, row["run"]), []).append(row["jsd"])
    mean = {key: float(np.mean(values)) for key, values in by_recording.items()}
    levels = ("healthy", *LEVELS)
    by_level = {
        level: float(np.mean([v for (lv, _), v in mean.items() if lv == level])) for level in levels
    }
    rank = spearmanr([levels.index(lv) for lv, _ in mean], list(mean.values())).statistic
    return by_level, float(rank)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA, help="Folder of the recordings.")
    arguments = parser.parse_args()
    if not arguments.data.is_dir():
        parser.error(f"{arguments.data}: no such folder; the recordings are not part of opamc")

    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        for group in ("healthy", "fault"):
            files = sorted((arguments.data / group).glob("*.csv"))
            mapped = ["--map", ROOT / "configs" / "maps" / "itsc.yaml", "--out", work / group]
            assert command("ingest", *files, *mapped) == 0

        print("Mean JSD (base 2) by level; ρ is Spearman's over all 25 recordings.\n")
        print("| envelope | order | γ | healthy | A1 | A2 | A3 | A4 | ρ | rises with every level |")
        print("|---|---|---|---|---|---|---|---|---|---|")
        for envelope in ("hilbert", "clarke"):
            for order in (4, 5):
                for gamma in (1, 2):
                    settings = [f"patterns.envelope={envelope}", f"patterns.gamma={gamma}"]
                    # one window per recording: as many patterns as there are for one estimate
                    settings.append("segment.windows=1")
                    mean, rank = mean_divergences(
                        work / "healthy", work / "fault", work / "out", settings, order
                    )
                    values = list(mean.values())
                    rises = "yes" if all(np.diff(values) > 0) else "no"
                    cells = " | ".join(f"{value:.4f}" for value in values)
                    print(f"| {envelope} | {order} | {gamma} | {cells} | {rank:.2f} | {rises} |")

        print("\n`opamc diagnose` at its defaults, healthy recordings as baseline:\n")
        print("| target | exit code | state | health index | p |")
        print("|---|---|---|---|---|")
        for level in LEVELS:
            target = work / level
            target.mkdir()
            for run in sorted((work / "fault").glob(f"SC_{level}_*.parquet")):
                (target / run.name).symlink_to(run)
            _print_verdict(level, work / "healthy", target, work / "verdict")
        for left_out in sorted((work / "healthy").glob("*.parquet")):
            others = work / f"without-{left_out.stem}"
            others.mkdir()
            for run in sorted((work / "healthy").glob("*.parquet")):
                if run != left_out:
                    (others / run.name).symlink_to(run)
            _print_verdict(f"healthy {left_out.stem[-3:]}", others, left_out, work / "verdict")


def _print_verdict(name: str, baseline: Path, target: Path, out: Path) -> None:
    code = command("diagnose", "--baseline", baseline, "--target", target, "--out", out)
    axis = json.loads((out / "verdict.json").read_text())["axes"][0]
    index, p = axis["health_index"], axis["p_value"]
    print(f"| {name} | {code} | {axis['state']} | {index:.1f} | {p:.4f} |")


if __name__ == "__main__":
    main()
