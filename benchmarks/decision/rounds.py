"""Recordings that hold a program less than twice, or begin anywhere in it.

Single joints of the closed loop, six baseline nights; a hall that is 5 K colder or warmer from
night to night. Each recording is so many rounds of the program long.

    python benchmarks/decision/rounds.py --first 9500 --joints 40 --rounds 1.4 1.8
    python benchmarks/decision/rounds.py --first 9500 --joints 40 --rounds 1.4 1.8 --anywhere
"""

import argparse
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "sources"))
from closed_loop_joint import LOOP_HZ, draw_joint, program, record

from opamc_cli.config import load_config
from opamc_cli.decision.judge import judge
from opamc_cli.errors import OpamcError
from opamc_cli.stages.chain.compared.side import Sides, read_side
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.verdict.evidence import bundles
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run

NIGHTS = 6
HALL_K = 5.0
RATES_HZ = (125.0, 250.0, 500.0, 1000.0)
CHANGES = ("backlash", 0.25), ("backlash", 1.0), ("tooth", 1.0), ("friction", 1.0)
HEALTHY_NIGHTS = 3


def states(seed: int, rounds: float, anywhere: bool) -> list[tuple[str, str]]:
    """Judge three healthy nights and four changes of one joint."""
    joint, rate_hz = replace(draw_joint(seed), cycles=5), RATES_HZ[seed % len(RATES_HZ)]
    round_s = program(joint).size / LOOP_HZ
    rng = np.random.default_rng([6, seed])
    colder = rng.normal(0, HALL_K, NIGHTS + HEALTHY_NIGHTS + 1)
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder, config = Path(name), load_config()

        def save(path: str, night: int, *change) -> None:
            current, position = record(joint, night, colder[night], rate_hz, *change)
            start = int(rng.uniform(0, round_s) * rate_hz) if anywhere else 0
            part = slice(start, start + int(rounds * round_s * rate_hz))
            channels = {"axis1_current": current[part], "axis1_position": position[part]}
            save_run(folder / path, RunInfo(sampling_rate_hz=rate_hz), channels)

        for night in range(NIGHTS):
            save(f"baseline/{night}.parquet", night)
        baseline = run_chain([folder / "baseline"], config, folder / "out")
        healthy = [("healthy", (), NIGHTS + night) for night in range(HEALTHY_NIGHTS)]
        changed = [(f"{c[0]} {c[1]:g}", c, NIGHTS + HEALTHY_NIGHTS) for c in CHANGES]
        for number, (label, change, night) in enumerate(healthy + changed):
            save(f"{number}/tonight.parquet", night, *change)
            try:
                target = run_chain(
                    [folder / str(number)],
                    config,
                    folder / f"{number}-out",
                    reference=baseline.motions,
                )
                bundle = bundles(Sides(read_side(baseline.patterns), read_side(target.patterns)))
                found.append((label, judge(bundle)[1].state if 1 in bundle else "no motion"))
            except OpamcError:
                found.append((label, "refused"))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=9500)
    parser.add_argument("--joints", type=int, default=40)
    parser.add_argument("--rounds", type=float, nargs="*", default=[1.4, 1.8])
    parser.add_argument("--anywhere", action="store_true", help="Begin anywhere in the program.")
    options = parser.parse_args()
    for rounds in options.rounds:
        seen: dict[str, Counter] = {}
        for seed in range(options.first, options.first + options.joints):
            for label, state in states(seed, rounds, options.anywhere):
                seen.setdefault(label, Counter())[state] += 1
        for label, counts in seen.items():
            print(f"{rounds:g} rounds, {label}: {dict(counts.most_common())}", flush=True)


if __name__ == "__main__":
    main()
