"""A measured machine with seeded faults: what the decision finds, and what plain rivals find.

Ten recordings of each state of a ball screw with a stepper motor (position and unsigned current,
25 Hz; see README.md of the measured data). A draw takes some healthy recordings as baseline and
some of a state as target, each recording a session of its own. The rivals are given what the
decision has to do without: their limit is the 99 % quantile of the score over splits of all
healthy recordings in the same sizes.

    python benchmarks/decision/actuator.py --quick
    python benchmarks/decision/actuator.py --draws 40 --seed 1
    python benchmarks/decision/actuator.py --causes --draws 10 --seed 11
"""

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations
from math import comb
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from sklearn.ensemble import IsolationForest

from opamc_cli.config import load_config
from opamc_cli.decision.judge import Bundle, Judgement
from opamc_cli.decision.sessions.odd_session import judge_without_odd
from opamc_cli.signal.ordinal.patterns import ordinal_counts
from opamc_cli.stages.chain.compared.side import Side, Sides, read_side
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.verdict.cause import explain, moving_samples
from opamc_cli.stages.verdict.evidence import bundles
from opamc_cli.stages.verdict.state import believed, with_cause
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run

DATA = Path(__file__).parents[3] / "shared" / "data" / "linear_actuator"
RATE_HZ = 25.0
SCREW_RAD_PER_MM = 0.02
"""Any constant would do: the stroke of 120 mm as 2.4 rad of a joint."""

HEALTHY = "normal"
CYCLE_SAMPLES = 324

FloatArray = NDArray[np.float64]


def record(folder: Path) -> dict[str, dict[str, FloatArray]]:
    """Write every recording as a run; return the current by state and run, cycle by cycle."""
    currents: dict[str, dict[str, FloatArray]] = {}
    for state in sorted(path for path in DATA.iterdir() if path.is_dir()):
        for file in sorted(state.glob("*.csv")):
            table = np.genfromtxt(file, delimiter=",", names=True)
            name = f"{state.name}-{file.stem}"
            save_run(
                folder / state.name / f"{name}.parquet",
                RunInfo(sampling_rate_hz=RATE_HZ, program="strokes"),
                {
                    "axis1_current": table["current_a"].astype(np.float32),
                    "axis1_position": table["position_mm"] * SCREW_RAD_PER_MM,
                },
            )
            cycles = table["current_a"].reshape(-1, CYCLE_SAMPLES)
            currents.setdefault(state.name, {})[name] = cycles
    return currents


class Machine:
    """The recordings with their tables, taken through the chain once."""

    def __init__(self, folder: Path) -> None:
        self.currents = record(folder / "runs")
        config = load_config()
        healthy = run_chain([folder / "runs" / HEALTHY], config, folder / "out" / HEALTHY)
        self.sides = {HEALTHY: read_side(healthy.patterns)}
        for state in self.currents:
            if state != HEALTHY:
                done = run_chain(
                    [folder / "runs" / state],
                    config,
                    folder / "out" / state,
                    reference=healthy.motions,
                )
                self.sides[state] = read_side(done.patterns)

    def judgement(
        self, baseline: Sequence[str], target: Sequence[str], state: str, without: str = ""
    ) -> tuple[Judgement, Bundle]:
        """Judge some runs of a state against some healthy ones."""
        sides = Sides(part(self.sides[HEALTHY], baseline), part(self.sides[state], target))
        bundle = bundles(sides)[1]
        kept = {name: one for name, one in bundle.witnesses.items() if name != without}
        return judge_without_odd({1: replace(bundle, witnesses=kept)})[1][1], bundle


def part(side: Side, runs: Sequence[str]) -> Side:
    """Return some runs of a side."""

    def rows(table: pa.Table) -> pa.Table:
        return table.filter(pc.is_in(table["run"], pa.array(list(runs))))

    return Side(
        side.path,
        tuple(source for source in side.sources if source.name in runs),
        rows(side.patterns),
        {name: rows(table) for name, table in side.witnesses.items()},
    )


def profile_distance(baseline: list[FloatArray], target: list[FloatArray]) -> float:
    """Root mean square distance of the mean current profiles, A."""
    means = [np.mean([run.mean(axis=0) for run in side], axis=0) for side in (baseline, target)]
    return float(np.sqrt(np.mean((means[0] - means[1]) ** 2)))


def isolation_forest(baseline: list[FloatArray], target: list[FloatArray]) -> float:
    """Mean anomaly score of the target's cycle profiles under a forest of the baseline's."""
    forest = IsolationForest(n_estimators=50, random_state=0).fit(np.concatenate(baseline))
    return float(-forest.score_samples(np.concatenate(target)).mean())


def of_feature(feature: Callable[[FloatArray], float]) -> Callable[..., float]:
    """Difference of the means of a feature of single runs."""

    def score(baseline: list[FloatArray], target: list[FloatArray]) -> float:
        means = [np.mean([feature(run) for run in side]) for side in (baseline, target)]
        return float(abs(means[0] - means[1]))

    return score


def rms(run: FloatArray) -> float:
    """Root mean square of the current, A."""
    return float(np.sqrt(np.mean(run**2)))


def kurtosis(run: FloatArray) -> float:
    """Kurtosis of the current."""
    centred = run - run.mean()
    return float(np.mean(centred**4) / np.mean(centred**2) ** 2)


def permutation_entropy(run: FloatArray) -> float:
    """Entropy of the current's ordinal patterns of order 4, bit."""
    counts = sum(ordinal_counts(cycle, [4], 1)[4].astype(float) for cycle in run)
    p = counts[counts > 0] / counts.sum()
    return float(-(p * np.log2(p)).sum())


RIVALS: dict[str, Callable[[list[FloatArray], list[FloatArray]], float]] = {
    "mean profile": profile_distance,
    "rms": of_feature(rms),
    "kurtosis": of_feature(kurtosis),
    "permutation entropy": of_feature(permutation_entropy),
    "isolation forest": isolation_forest,
}


def healthy_splits(n: int, n_baseline: int, n_target: int, most: int, seed: int):
    """Yield disjoint index sets of healthy runs in these sizes: all, or `most` drawn."""
    if comb(n, n_baseline) * comb(n - n_baseline, n_target) <= most:
        for own in combinations(range(n), n_baseline):
            for other in combinations([k for k in range(n) if k not in own], n_target):
                yield own, other
        return
    rng = np.random.default_rng([seed, n_baseline, n_target])
    for _ in range(most):
        order = rng.permutation(n)
        yield tuple(order[:n_baseline]), tuple(order[n_baseline : n_baseline + n_target])


def limits(machine: Machine, n_baseline: int, n_target: int, most: int, seed: int) -> dict:
    """Return each rival's limit: 1 % of the healthy splits lie above it."""
    runs = list(machine.currents[HEALTHY].values())
    scores: dict[str, list[float]] = {name: [] for name in RIVALS}
    for own, other in healthy_splits(len(runs), n_baseline, n_target, most, seed):
        for name, rival in RIVALS.items():
            scores[name].append(rival([runs[k] for k in own], [runs[k] for k in other]))
    return {name: float(np.quantile(values, 0.99)) for name, values in scores.items()}


def main() -> None:
    """Print what docs/decision.md says of a measured machine."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--sizes", type=int, nargs="*", default=[5])
    parser.add_argument("--without", default="", help="Leave a witness out.")
    parser.add_argument("--no-rivals", action="store_true")
    parser.add_argument("--causes", action="store_true", help="Only say what causes are named.")
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    draws = 3 if arguments.quick else arguments.draws
    with tempfile.TemporaryDirectory() as folder:
        machine = Machine(Path(folder))
        if arguments.causes:
            causes(machine, draws, arguments.seed)
            return
    for size in arguments.sizes:
        table(machine, size, size, draws, arguments)


def causes(machine: Machine, draws: int, seed: int) -> None:
    """Print which cause is named first for each state, what the verdict is, and how often."""
    config = load_config()
    for state in machine.currents:
        if state == HEALTHY:
            continue
        sides = [machine.sides[side].patterns for side in (HEALTHY, state)]
        moving = {run: at for side in sides for run, at in moving_samples(side)[1].items()}
        rng = np.random.default_rng([seed, *state.encode()])
        named: Counter[str] = Counter()
        for _ in range(draws):
            runs = [
                rng.choice(list(machine.currents[side]), 5, replace=False).tolist()
                for side in (HEALTHY, state)
            ]
            sources = [
                [s for s in machine.sides[side].sources if s.name in own]
                for side, own in zip((HEALTHY, state), runs, strict=True)
            ]
            found = explain(1, *sources, config.joint, moving)
            judged, _ = machine.judgement(*runs, state)
            cause = believed(judged, found or None, config.score)
            final = with_cause(judged, cause, config.score)
            named[f"{found['effect'] if found else 'none'}, {final.state}"] += 1
        print(state, dict(named.most_common()), flush=True)


def table(machine: Machine, n_baseline: int, n_target: int, draws: int, arguments) -> None:
    """Print what is found of each state in draws of these sizes, and the false alarms."""
    print(f"\n{n_baseline} healthy runs as baseline, {n_target} as target, {draws} draws")
    most = 20 if arguments.quick else 252
    healthy = list(machine.currents[HEALTHY])
    alarms, p_values = 0, []
    splits = list(healthy_splits(len(healthy), n_baseline, n_target, most, arguments.seed))
    for own, other in splits:
        judged, _ = machine.judgement(
            [healthy[k] for k in own],
            [healthy[k] for k in other],
            HEALTHY,
            arguments.without,
        )
        alarms += judged.state in ("changed", "fault")
        p_values.append(judged.p_value)
    print(f"healthy splits: {alarms} of {len(splits)} alarm; smallest p {np.nanmin(p_values):.2g}")
    limit = {}
    if not arguments.no_rivals:
        limit = limits(machine, n_baseline, n_target, 60 if arguments.quick else 252, 0)
    names = ["opamc", *limit, "patterns", "spectrum", "profile", "amplitude"]
    print("state," + ",".join(names) + ",median effect")
    for state in machine.currents:
        if state == HEALTHY:
            continue
        rng = np.random.default_rng([arguments.seed, *state.encode()])
        found = dict.fromkeys(names, 0)
        effects = []
        for _ in range(draws):
            own = rng.choice(healthy, n_baseline, replace=False).tolist()
            other = rng.choice(list(machine.currents[state]), n_target, replace=False).tolist()
            judged, _ = machine.judgement(own, other, state, arguments.without)
            found["opamc"] += judged.state in ("changed", "fault")
            effects.append(judged.effects)
            for name, p in judged.witnesses.items():
                found[name] += p <= 0.01
            sides = (
                [machine.currents[HEALTHY][name] for name in own],
                [machine.currents[state][name] for name in other],
            )
            for name, value in limit.items():
                found[name] += RIVALS[name](*sides) > value
        shares = ",".join(f"{found[name] / draws:.2f}" for name in names)
        effect = {name: np.nanmedian([one[name] for one in effects]) for name in effects[0]}
        print(f"{state},{shares},{' '.join(f'{k} {v:.2f}' for k, v in effect.items())}")


if __name__ == "__main__":
    main()
