"""Single joints: the decision beside three plain numbers, and beside what weather does not explain.

One joint of `sources/closed_loop_joint.py` a robot, six baseline nights in a hall of 5 K from night
to night that nobody logs, four healthy nights more and one with each fault. A rival's score is a
ratio of distances, its limit what 1 % of the healthy nights exceed.

    python benchmarks/decision/departures.py --robots 100 --first 9000
"""

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from closed_loop import HALL_K, RATES_HZ
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1] / "sources"))
from closed_loop_joint import FAULTS, draw_joint, record

from opamc_cli.config import load_config
from opamc_cli.decision.judge import Bundle, judge
from opamc_cli.decision.witnesses.deviation import PRIOR_DOF
from opamc_cli.stages.chain.compared.side import Side, Sides, read_side
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.verdict.evidence import bundles
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run

FloatArray = NDArray[np.float64]

BASELINE, HEALTHY = 6, 4
SIZES = (0.25, 1.0)
RIDGE = 0.01
"""Of the sessions' mean variance: what they differ by is not known better."""


def orthogonal_distance(sessions: FloatArray, unit: int, rest: list[int]) -> float:
    """Squared distance of a session from the span of the others' differences.

    The others' combination that comes nearest to the session is taken off; what is left is held
    against the error that such a combination has, which grows with its weights (M. Hubert,
    P. J. Rousseeuw and K. Vanden Branden, Technometrics 47, 2005, call it the orthogonal distance).

    Parameters
    ----------
    sessions : ndarray, shape (S, P)
        Mean course of each.
    unit : int
        The session in question.
    rest : list of int
        Those that it is compared with.
    """
    others = sessions[rest]
    mean, dof = others.mean(axis=0), len(rest) - 1
    squares = ((others - mean) ** 2).sum(axis=0)
    variance = (PRIOR_DOF * squares.mean() / dof + squares) / (PRIOR_DOF + dof)
    scale = np.sqrt(np.maximum(variance, 1e-9))
    spread, away = (others - mean) / scale, (sessions[unit] - mean) / scale
    gram = spread @ spread.T
    penalty = RIDGE * np.trace(gram) / dof + 1e-12
    weights = np.linalg.solve(gram + penalty * np.eye(len(rest)), spread @ away)
    left = away - weights @ spread
    return float(np.mean(left**2) / (1 + 1 / len(rest) + weights @ weights))


def ratio(cells: list[FloatArray], target: int) -> float:
    """Log of the target's mean distance over a baseline session's, each from the same rest."""
    logs = []
    for k in range(BASELINE):
        rest = [i for i in range(BASELINE) if i != k]
        own, other = (
            np.mean([orthogonal_distance(cell, unit, rest) for cell in cells])
            for unit in (k, target)
        )
        logs.append(np.log(other) - np.log(own))
    return float(np.mean(logs))


def plain(current: FloatArray) -> FloatArray:
    """Log of rms, rms of the successive differences, and mean size of a recording."""
    sizes = [np.mean(current**2) ** 0.5, np.mean(np.diff(current) ** 2) ** 0.5]
    return np.log([*sizes, np.mean(np.abs(current))])


def only(side: Side, name: str) -> Side:
    """Return one recording of a side."""

    def rows(table):
        return table.filter(np.array(table["run"].to_pylist()) == name)

    return replace(
        side,
        sources=tuple(source for source in side.sources if source.name == name),
        patterns=rows(side.patterns),
        witnesses={key: rows(table) for key, table in side.witnesses.items()},
    )


def scores(seed: int) -> list[tuple[tuple[str, float], dict[str, float], bool]]:
    """Return what each night was, its score by each method, and whether it is called changed."""
    joint, rate_hz = draw_joint(seed), RATES_HZ[seed % len(RATES_HZ)]
    colder = np.random.default_rng([79, seed]).normal(0, HALL_K, BASELINE + HEALTHY)
    nights = {f"b{k}": (k, ()) for k in range(BASELINE)}
    nights |= {f"h{k}": (BASELINE + k, ()) for k in range(HEALTHY)}
    nights |= {f"{f}-{s:g}": (BASELINE, (f, s)) for f in FAULTS for s in SIZES}
    numbers, found = {}, []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for night, (session, change) in nights.items():
            current, position = record(joint, session, colder[session], rate_hz, *change)
            side = "baseline" if night.startswith("b") and not change else "target"
            channels = {"axis1_current": current, "axis1_position": position}
            save_run(
                folder / side / f"{night}.parquet", RunInfo(sampling_rate_hz=rate_hz), channels
            )
            numbers[night] = plain(current)
        sides, reference = [], None
        for side in ("baseline", "target"):
            out = folder / "out" / side
            done = run_chain([folder / side], load_config(), out, reference=reference)
            reference = done.motions
            sides.append(read_side(done.patterns))
    own = np.array([numbers[f"b{k}"] for k in range(BASELINE)])
    for night, (_, change) in nights.items():
        if night not in {source.name for source in sides[1].sources}:
            continue
        bundle = bundles(Sides(sides[0], only(sides[1], night)))[1]
        if "profile" not in bundle.witnesses:
            print(f"{seed} {night}: no motion in common")
            continue
        judged = judge({1: Bundle(bundle.cells, bundle.witnesses)})[1]
        away = np.abs(numbers[night] - own.mean(axis=0)) / np.maximum(own.std(axis=0, ddof=1), 1e-9)
        courses = [cell.course for cell in bundle.witnesses["profile"].cells]
        found.append(
            (
                change or ("healthy", 0.0),
                {
                    "the decision": -np.log10(judged.p_value),
                    "three numbers": float(away.max()),
                    "course, beyond": ratio(courses, BASELINE),
                },
                judged.state in ("changed", "fault"),
            )
        )
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--first", type=int, default=9000)
    options = parser.parse_args()
    rows = [row for k in range(options.robots) for row in scores(options.first + k)]
    healthy = [row for row in rows if row[0][0] == "healthy"]
    alarms = sum(called for _, _, called in healthy)
    print(f"{alarms} of {len(healthy)} healthy nights alarm at the defaults")
    print("| change | size | found at the defaults | " + " | ".join(healthy[0][1]) + " |")
    print("|---|---|---" + "|---" * len(healthy[0][1]) + "|")
    for change in sorted({row[0] for row in rows} - {("healthy", 0.0)}):
        own = [row for row in rows if row[0] == change]
        cells = []
        for method in healthy[0][1]:
            usual = np.array([row[1][method] for row in healthy])
            values = np.array([row[1][method] for row in own])
            above = (values[:, np.newaxis] > usual).mean()
            equal = (values[:, np.newaxis] == usual).mean()
            share = np.mean(values > np.quantile(usual, 0.99))
            cells.append(f"{above + equal / 2:.3f}, {share:.2f}")
        called = np.mean([row[2] for row in own])
        print(f"| {change[0]} | {change[1]:g} | {called:.2f} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
