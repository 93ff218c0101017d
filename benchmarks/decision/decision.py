"""How far the decision can be trusted, and what else would have found the fault.

Fleets of virtual robots are recorded in several healthy sessions and in one target session at
each severity of damage; temperature, friction, sensor gain and mounting differ by session. The
recordings go through the chain's own stages (segment, identify, patterns); every method sees the
same envelopes of the same motions. With `--segments truth` the motions are cut where the testbed
knows them to be, so that the decision is measured without the segmentation.

    python benchmarks/decision/decision.py --quick
    python benchmarks/decision/decision.py --seeds 15000:15040 --jobs 2
"""

import argparse
import hashlib
import json
import math
import multiprocessing
import pickle
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import rivals
from numpy.typing import NDArray
from scipy.stats import kstest, rankdata

from opamc_cli.config import load_config
from opamc_cli.config.testbed import load_testbed
from opamc_cli.decision.divergence.discriminant import fit
from opamc_cli.decision.divergence.features import compare
from opamc_cli.decision.divergence.jensen_shannon import divergences_from_pool
from opamc_cli.decision.judge import Bundle, judge
from opamc_cli.signal.offset import mean_over_turns
from opamc_cli.signal.transform.analytic import clarke
from opamc_cli.stages.chain import patterns
from opamc_cli.stages.chain.compared.side import Side, Sides
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.chain.witnesses import WITNESSES
from opamc_cli.stages.recordings.identified import aligned_span, turning_motions
from opamc_cli.stages.verdict.evidence import bundles
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import MOTIONS
from opamc_cli.storage.sources import RunSource, sources_record
from opamc_cli.storage.tables import read_table, write_table
from opamc_cli.testbed.robot import simulate

ROOT = Path(__file__).resolve().parents[2]
CACHE = Path(__file__).resolve().parents[1] / "out" / "decision"

RECORDED_BY = ("testbed", "signal", "stages/chain", "stages/recordings")
SEVERITIES = (0.0, 0.1, 0.25, 0.5, 1.0)
ORDERS = (4, 5)
AXES = (1, 2, 3, 4, 5, 6)
RATE_HZ = 2048.0
POLE_PAIRS = 5

TEMPERATURE_SD_K = 5.0  # ±10 K
SENSOR_GAIN_SD = 0.01  # ±2 %


def fleet(n_cycles: int, speed_percent: float, payload_kg: float, remount: bool):
    config = load_testbed(ROOT / "configs" / "testbed.yaml")
    spread = replace(
        config.robot.spread,
        temperature_c=TEMPERATURE_SD_K,
        sensor_gain=SENSOR_GAIN_SD,
        remount=remount,
    )
    program = replace(
        config.program,
        order="together",
        lead_s=0.3,
        dwell_s=0.2,
        cycles=n_cycles,
        speed_percent=speed_percent,
        payload_kg=payload_kg,
    )
    return replace(config.robot, spread=spread), program


def faulty_axis(seed: int) -> int:
    return AXES[(seed // 100 + seed) % len(AXES)]


def run_name(session: int, severity: float) -> str:
    return f"{session}-{severity:g}"


def record(robot, program, seed: int, folder: Path, session: int, severity: float, axes):
    """Write one session's run; return its phase currents and the motions as they were taught."""
    faults = {faulty_axis(seed): replace(robot.damage, severity=severity)} if severity else {}
    recording = simulate(
        robot,
        program,
        seed=seed,
        session=session,
        axes=axes,
        faults=faults,
        sampling_rate_hz=RATE_HZ,
    )
    name = run_name(session, severity)
    phases = {
        f"axis{axis}_{phase}": np.ascontiguousarray(signals.phases_a[:, k])
        for axis, signals in recording.axes.items()
        for k, phase in enumerate("abc")
    }
    save_run(folder / f"{name}.parquet", RunInfo(sampling_rate_hz=RATE_HZ), phases)
    return name, recording


def taught_motions(folder: Path, recordings: dict, f_max_hz: float, out: Path) -> Path:
    """Write the motion table that a perfect segmentation and identification would have written."""
    lengths: dict[int, int] = {}
    rows, sources = [], []
    for name, recording in recordings.items():
        with Run(folder / f"{name}.parquet", name) as run:
            sources.append(RunSource.of(run))
        for number, s in enumerate(recording.segments):
            if s.axis not in recording.axes:
                continue
            length = lengths.setdefault(s.motion, s.stop - s.start - 2)
            rows.append(
                {
                    **{"run": name, "axis": s.axis, "segment": number, "start": s.start},
                    **{"stop": s.stop, "sampling_rate_hz": RATE_HZ, "f_max_hz": f_max_hz},
                    **{"direction": 0, "variance": 1.0, "edge": False, "kind": "motion"},
                    **{"signal": "phases", "cycle": s.cycle, "motion": s.motion, "lag": 0},
                    **{"similarity": 1.0, "reference": False, "reference_f_max_hz": f_max_hz},
                    "reference_samples": length,
                }
            )
    path = out / files.MOTIONS
    table = pa.Table.from_pylist(rows, schema=MOTIONS)
    extra = sources_record(sources, out)
    write_table(path, table, stage="identify", config={}, inputs=[], extra=extra)
    return path


def rival_rows(recordings: dict, motions: list[dict]) -> dict:
    """Reduce every identified segment to the rivals' features: by run and axis."""
    vectors = {}
    by_axis: dict[tuple[str, int], list[dict]] = {}
    for row in motions:
        if row["motion"] >= 0:
            by_axis.setdefault((row["run"], row["axis"]), []).append(row)
    for (name, axis), rows in by_axis.items():
        vector = clarke(*recordings[name].axes[axis].phases_a.T.astype(np.float64))
        spans = [aligned_span(row) for row in rows]
        # as the stage `patterns` does
        turning = ((vector[a:b], f_max_hz) for a, b, f_max_hz in turning_motions(rows))
        vector = vector - mean_over_turns(turning, RATE_HZ)
        envelope = np.abs(vector)
        # The square's angle does not jump where the torque changes its sign: half of it is the
        # carrier's, and the vector turned back by it is the torque current with its sign.
        carrier = np.unwrap(np.angle(vector**2)) / 2
        torque = (vector * np.exp(-1j * carrier)).real
        histogram = np.zeros(rivals.KDE_GRID_A.size)
        features = []
        for (a, b), row in zip(spans, rows, strict=True):
            part = envelope[a:b]
            both = np.concatenate(
                [
                    rivals.amplitude_features(part),
                    rivals.sideband_features(part, carrier[a:b], POLE_PAIRS),
                ]
            )
            features.append((row["cycle"], row["motion"], both))
            histogram += rivals.torque_histogram(torque[a:b])
        vectors[name, axis] = {"features": features, "histogram": histogram}
    return vectors


def record_fleet(job) -> dict:
    """Record one robot under one condition, and take its runs through the chain."""
    path = CACHE / f"{key(job)}.pickle"
    if path.exists():
        return pickle.loads(path.read_bytes())
    seed, speed, payload, n_sessions, n_cycles, remount, segments = job
    robot, program = fleet(n_cycles, speed, payload, remount)
    config = load_config()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        recordings: dict[str, dict] = {"baseline": {}, "target": {}}
        for session in range(n_sessions):
            name, recording = record(robot, program, seed, folder / "baseline", session, 0.0, AXES)
            recordings["baseline"][name] = recording
        for severity in SEVERITIES:
            axes = [faulty_axis(seed)] if severity else AXES
            name, recording = record(
                robot, program, seed, folder / "target", n_sessions, severity, axes
            )
            recordings["target"][name] = recording
        tables: dict[str, list[pa.Table]] = {
            name: []
            for name in ("motions", "patterns", *(witness.FILE_NAME for witness in WITNESSES))
        }
        reference = None
        for side in ("baseline", "target"):
            out = folder / f"{side}-out"
            if segments == "truth":
                f_max_hz = robot.electrical_hz_full_speed * program.speed_percent / 100
                motions = taught_motions(folder / side, recordings[side], f_max_hz, out)
                counted = patterns.run(motions, config, out)
                paths = (motions, counted.path)
            else:
                done = run_chain([folder / side], config, out, reference=reference)
                reference = done.motions
                paths = (done.motions, done.patterns)
            paths += tuple(paths[1].with_name(witness.FILE_NAME) for witness in WITNESSES)
            for name, table in zip(tables, paths, strict=True):
                stage = "identify" if name == "motions" else "patterns"
                tables[name].append(read_table(table, stage).replace_schema_metadata(None))
    both = recordings["baseline"] | recordings["target"]
    stored = {
        "tables": {
            name: pa.concat_tables(parts).combine_chunks()
            for name, parts in tables.items()
            if name != "motions"
        },
        "rivals": rival_rows(both, pa.concat_tables(tables["motions"]).to_pylist()),
    }
    CACHE.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".tmp")
    unfinished.write_bytes(pickle.dumps(stored))
    unfinished.rename(path)
    return stored


def key(job) -> str:
    settings = (*job, TEMPERATURE_SD_K, SENSOR_GAIN_SD, ORDERS, SEVERITIES, source_digest())
    return hashlib.sha256(repr(settings).encode()).hexdigest()[:24]


def source_digest() -> str:
    """Digest of everything the recordings depend on, so that no cache outlives its testbed."""
    files = [
        ROOT / "configs" / "testbed.yaml",
        *(
            file
            for part in RECORDED_BY
            for file in sorted((ROOT / "opamc_cli" / part).rglob("*.py"))
        ),
        Path(rivals.__file__),
    ]
    return hashlib.sha256(b"".join(f.read_bytes() for f in files)).hexdigest()


def of_runs(table: pa.Table, runs: list[str], axis: int | None = None) -> pa.Table:
    chosen = pc.is_in(table["run"], pa.array(runs))
    if axis is not None:
        chosen = pc.and_(chosen, pc.equal(table["axis"], axis))
    return table.filter(chosen)


def axis_bundle(stored, axis: int, baseline: list[str], target: str):
    """Return what `judge` takes of one axis."""
    sides = []
    for runs in (baseline, [target]):
        own = {name: of_runs(table, runs, axis) for name, table in stored["tables"].items()}
        sources = tuple(
            RunSource(name, Path(name), "", 0, RunInfo(sampling_rate_hz=RATE_HZ)) for name in runs
        )
        sides.append(Side(Path("patterns.parquet"), sources, own.pop("patterns"), own))
    return bundles(Sides(*sides)).get(axis, Bundle([]))


def thesis_features(cells, order: int) -> list[float]:
    """Δμ, Δσ² and KS as the thesis takes them: one session before, the pool holds its segments."""
    jsd: dict[str, list[float]] = {"b": [], "t": []}
    for cell in cells:
        if cell.order == order:
            jsd["b"] += divergences_from_pool(cell.cycles, cell.cycles).tolist()
            jsd["t"] += divergences_from_pool(cell.target_cycles, cell.cycles).tolist()
    f = compare(jsd["b"], jsd["t"])
    return [f.delta_mu, f.delta_var, f.ks]


FEATURE_SLICES = {
    "rms, kurtosis, crest": slice(0, 3),
    "sidebands": slice(3, 11),
    "permutation entropy": slice(11, 13),
}


def evaluate(job) -> list[dict]:
    """Judge a robot, or take what was judged by the same code before."""
    path = CACHE / f"{key(job)}-{judge_digest()[:12]}.json"
    if not path.exists():
        CACHE.mkdir(parents=True, exist_ok=True)
        temporary = path.with_suffix(".tmp")
        temporary.write_text(json.dumps(judge_fleet(job)))
        temporary.rename(path)
    return json.loads(path.read_text())


def judge_digest() -> str:
    files = [*sorted((ROOT / "opamc_cli" / "decision").rglob("*.py")), Path(rivals.__file__)]
    return hashlib.sha256(b"".join(f.read_bytes() for f in files)).hexdigest()


def judge_fleet(job) -> list[dict]:
    """Score every axis of one robot at every severity of its faulty axis, by every method."""
    seed, speed, payload, n_sessions, *_ = job
    stored = record_fleet(job)
    bad = faulty_axis(seed)
    names = [run_name(s, 0.0) for s in range(n_sessions)]
    results = []
    six, one, scores = {}, {}, {}
    for severity in SEVERITIES:
        target = run_name(n_sessions, severity)
        for axis in AXES if severity == 0 else [bad]:
            six[axis] = axis_bundle(stored, axis, names, run_name(n_sessions, severity))
            one[axis] = axis_bundle(stored, axis, names[:1], run_name(n_sessions, severity))
            scores[axis] = rival_scores(stored, axis, names, target, seed)
        judged, single = (judge(bundles_of_axes) for bundles_of_axes in (six, one))
        for axis in AXES:
            j, j1 = judged[axis], single[axis]
            results.append(
                {
                    "seed": seed,
                    "speed": speed,
                    "payload": payload,
                    "severity": severity,
                    "axis": axis,
                    "bad": axis == bad and severity > 0,
                    "p": j.p_value,
                    "state": j.state,
                    "state_one": j1.state,
                    "p_one": j1.p_value,
                    "thesis4": thesis_features(one[axis].cells, 4),
                    "thesis5": thesis_features(one[axis].cells, 5),
                    "scores": {
                        "opamc": -float(np.log10(j.p_value)),
                        "opamc, one baseline session": -float(np.log10(j1.p_value)),
                        **scores[axis],
                    },
                }
            )
    return results


def feature_table(stored, axis: int, run: str, motions: list[int]) -> NDArray[np.float64]:
    """Return the features of one axis and session, shape (cycles, motions, features).

    Cycles in which a motion was not found are left out.
    """
    rows = {(c, m): f for c, m, f in stored["rivals"][run, axis]["features"]}
    table = of_runs(stored["tables"]["patterns"], [run], axis).select(
        ["cycle", "motion", "order", "counts"]
    )
    entropies: dict[tuple[int, int], list[float]] = {}
    for row in table.to_pylist():
        entropy = rivals.permutation_entropy(np.array(row["counts"], dtype=np.float64))
        entropies.setdefault((row["cycle"], row["motion"]), []).append(entropy)
    cycles = [c for c in sorted({c for c, _ in rows}) if all((c, m) in rows for m in motions)]
    return np.array(
        [[np.concatenate([rows[c, m], entropies[c, m]]) for m in motions] for c in cycles]
    )


def rival_scores(stored, axis: int, baseline: list[str], target: str, seed: int) -> dict:
    runs = (*baseline, target)
    if not all((run, axis) in stored["rivals"] for run in runs):
        # Of a known motion nothing was found: whoever looks for it is told so.
        return dict.fromkeys((*FEATURE_SLICES, "kernel density KL", "isolation forest"), np.inf)
    found = [{m for _, m, _ in stored["rivals"][run, axis]["features"]} for run in runs]
    motions = sorted(set.intersection(*found))
    features = [feature_table(stored, axis, run, motions) for run in runs]
    by_session = np.array([f.mean(axis=0) for f in features])
    scores = {
        name: rivals.standardised_distance(by_session[:-1][..., part], by_session[-1][..., part])
        for name, part in FEATURE_SLICES.items()
    }
    density = [rivals.kernel_density(stored["rivals"][run, axis]["histogram"]) for run in runs]
    own = [
        np.mean([rivals.symmetric_kl(a, b) for b in density[:-1] if b is not a])
        for a in density[:-1]
    ]
    other = np.mean([rivals.symmetric_kl(density[-1], b) for b in density[:-1]])
    logs = np.log(own)
    scores["kernel density KL"] = float((np.log(other) - logs.mean()) / max(logs.std(ddof=1), 0.1))
    flat = np.concatenate([f.reshape(-1, f.shape[-1]) for f in features[:-1]])
    scale = flat.std(axis=0) + 1e-12
    scores["isolation forest"] = rivals.isolation_score(
        flat / scale, features[-1].reshape(-1, flat.shape[1]) / scale, seed
    )
    return scores


def add_thesis_scores(results: list[dict]) -> None:
    """Score by the thesis's LDA, trained on the other half of the robots, normal and severity 1.

    A joint of which no motion fits tells nothing, of no method: it counts as not found.
    """
    for order in ORDERS:
        name = f"thesis, order {order}"
        for half in (0, 1):
            train = [
                r
                for r in results
                if r["seed"] // 100 % 2 != half
                and np.isfinite(r[f"thesis{order}"]).all()
                and (r["severity"] == 1.0 if r["bad"] else r["severity"] == 0)
            ]
            rows = np.array([r[f"thesis{order}"] for r in train])
            labels = np.array([r["bad"] for r in train])
            if not labels.any() or labels.all():
                train = [r for r in results if np.isfinite(r[f"thesis{order}"]).all()]
                rows = np.array([r[f"thesis{order}"] for r in train])
                labels = np.array([r["bad"] for r in train])
            model = fit(rows, labels)
            for r in results:
                if r["seed"] // 100 % 2 == half:
                    r["scores"][name] = float(model.project(r[f"thesis{order}"]))
    for r in results:
        r["scores"] = {k: v if math.isfinite(v) else -math.inf for k, v in r["scores"].items()}


def auc(healthy: NDArray[np.float64], faulty: NDArray[np.float64]) -> float:
    ranks = rankdata(np.concatenate([healthy, faulty]))[len(healthy) :]
    return float((ranks.sum() - len(faulty) * (len(faulty) + 1) / 2) / (len(healthy) * len(faulty)))


def report(results: list[dict], command: str) -> str:
    """Return the figures as Markdown."""
    add_thesis_scores(results)
    methods = list(results[0]["scores"])
    conditions = sorted({(r["speed"], r["payload"]) for r in results})
    healthy = [r for r in results if r["severity"] == 0.0]
    robots = {r["seed"] for r in results}
    lines = [
        f"{len(robots)} robots ({len(robots) // len(conditions)} at each of {len(conditions)} "
        f"conditions), {len(healthy)} healthy joints; `{command}`",
        "",
        "AUC pools joints of all conditions; det: share found where 1 % of healthy joints are "
        "called faulty; axis: right one of six named at severity 1.",
        "",
        table_head(
            ["method"]
            + [f"AUC {s:g}" for s in SEVERITIES[1:]]
            + [f"det {s:g}" for s in SEVERITIES[1:]]
            + ["axis", "found from"]
        ),
    ]
    lines += [row_of(results, healthy, method) for method in methods]
    lines += [
        "",
        "Found from: least severity found in at least 90 % of robots at 1 % false alarms. AUC at "
        "severity 0.25 and 0.5 by speed (%) and payload (kg):",
        "",
        table_head(["method"] + [f"{s:g} %, {p:g} kg" for s, p in conditions]),
    ]
    for method in methods:
        cells = []
        for condition in conditions:
            own = [r for r in results if (r["speed"], r["payload"]) == condition]
            a = np.array([r["scores"][method] for r in own if r["severity"] == 0.0])
            faulty = {
                s: np.array([r["scores"][method] for r in own if r["bad"] and r["severity"] == s])
                for s in (0.25, 0.5)
            }
            cells.append(" / ".join(f"{auc(a, b):.3f}" for b in faulty.values()))
        lines.append(f"| {method} | " + " | ".join(cells) + " |")
    lines += ["", "The decision at its defaults:", ""]
    for state, what in (("state", "six baseline sessions"), ("state_one", "one baseline session")):
        alarms = np.array([r[state] in ("changed", "fault") for r in healthy])
        found = [
            np.mean(
                [
                    r[state] in ("changed", "fault")
                    for r in results
                    if r["bad"] and r["severity"] == severity
                ]
            )
            for severity in SEVERITIES[1:]
        ]
        listed = ", ".join(f"{f:.1%} at {s:g}" for f, s in zip(found, SEVERITIES[1:], strict=True))
        lines.append(
            f"- {what}: false alarms on healthy joints {alarms.sum()} of {alarms.size} "
            f"({alarms.mean():.2%}); damage found {listed}"
        )
    p = np.array([r["p"] for r in healthy])
    one_each = np.array([r["p"] for r in healthy if r["axis"] == faulty_axis(r["seed"])])
    clustered = clustered_ks(p, np.array([r["seed"] for r in healthy]))
    shares = ", ".join(f"{np.mean(p < q):.4f} below {q:g}" for q in (0.5, 0.1, 0.05, 0.01))
    lines.append(
        f"- p-values of healthy joints against uniform: KS p = "
        f"{kstest(one_each, 'uniform').pvalue:.3f} with one joint of each robot (independent), "
        f"{kstest(p, 'uniform').pvalue:.3f} with all as if they were independent, {clustered:.3f} "
        f"with all, robots drawn as a whole; {shares}"
    )
    return "\n".join(lines)


def clustered_ks(p: NDArray[np.float64], robot: NDArray[np.int64], draws: int = 2000) -> float:
    """KS test for uniformity that lets the joints of one robot depend on each other.

    The statistic's distribution under uniformity is that of the distance between a bootstrap's
    distribution, robots drawn with replacement, and the sample's own.
    """
    grid = np.linspace(0.0, 1.0, 501)
    _, place = np.unique(robot, return_inverse=True)
    by_robot = np.zeros((place.max() + 1, grid.size))
    np.add.at(by_robot, place, p[:, np.newaxis] <= grid)
    sizes = np.bincount(place)
    own = by_robot.sum(axis=0) / p.size
    rng = np.random.default_rng(0)
    drawn = rng.multinomial(len(sizes), np.full(len(sizes), 1 / len(sizes)), size=draws)
    distances = np.abs(drawn @ by_robot / (drawn @ sizes)[:, np.newaxis] - own).max(axis=1)
    observed = np.abs(own - grid).max()
    return float((1 + np.sum(distances >= observed)) / (1 + draws))


def table_head(names: list[str]) -> str:
    return "| " + " | ".join(names) + " |\n" + "|---" * len(names) + "|"


def row_of(results: list[dict], healthy: list[dict], method: str) -> str:
    a = np.array([r["scores"][method] for r in healthy])
    limit = np.quantile(a, 0.99)
    aucs, found = [], []
    for severity in SEVERITIES[1:]:
        b = np.array(
            [r["scores"][method] for r in results if r["bad"] and r["severity"] == severity]
        )
        aucs.append(auc(a, b))
        found.append(float(np.mean(b > limit)))
    groups: dict[tuple, list[dict]] = {}
    for r in results:
        if r["severity"] == 1.0:
            groups.setdefault((r["seed"], r["speed"], r["payload"]), []).append(r)
    named = np.mean([max(g, key=lambda r: r["scores"][method])["bad"] for g in groups.values()])
    early = next((f"{s:g}" for s, f in zip(SEVERITIES[1:], found, strict=True) if f >= 0.9), "-")
    cells = [f"{x:.4f}" for x in aucs] + [f"{x:.2f}" for x in found] + [f"{named:.3f}", early]
    return f"| {method} | " + " | ".join(cells) + " |"


def write_section(path: Path, text: str) -> None:
    """Put the figures between their markers in a document, or at its end."""
    begin, end = "<!-- decision: begin -->", "<!-- decision: end -->"
    document = path.read_text(encoding="utf-8")
    if begin in document:
        before, rest = document.split(begin, 1)
        after = rest.split(end, 1)[1]
    else:
        before, after = document.rstrip() + "\n\n", "\n"
    path.write_text(f"{before}{begin}\n\n{text}\n\n{end}{after}", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", default="15000:15040", help="first:stop")
    parser.add_argument("--conditions", default="20/0,20/1,20/2,50/0,50/1,50/2,100/0,100/1,100/2")
    parser.add_argument("--sessions", type=int, default=6, help="baseline sessions")
    parser.add_argument("--cycles", type=int, default=4)
    parser.add_argument(
        "--remount", action="store_true", help="take the gear apart between sessions"
    )
    parser.add_argument(
        "--segments",
        choices=("chain", "truth"),
        default="chain",
        help="where motions are cut: by the chain's own stages, or where they were taught",
    )
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--quick", action="store_true", help="4 robots, 3 conditions")
    parser.add_argument(
        "--write", action="store_true", help="put the figures in docs/validation/decision.md"
    )
    options = parser.parse_args()
    first, stop = map(int, options.seeds.split(":"))
    conditions = [tuple(map(float, c.split("/"))) for c in options.conditions.split(",")]
    if options.quick:
        stop, conditions = first + 4, conditions[:1] + conditions[3:4] + conditions[6:7]
    jobs = [
        # every condition has robots of its own, or their sessions would not be independent
        (
            *(100 * seed + place, speed, payload, options.sessions, options.cycles),
            *(options.remount, options.segments),
        )
        for seed in range(first, stop)
        for place, (speed, payload) in enumerate(conditions)
    ]
    started = time.perf_counter()
    if options.jobs > 1:
        with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
            nested = pool.map(evaluate, jobs, chunksize=1)
    else:
        nested = [evaluate(job) for job in jobs]
    results = [row for rows in nested for row in rows]
    settings = f" --segments {options.segments}" + (" --remount" if options.remount else "")
    command = f"python benchmarks/decision/decision.py --seeds {first}:{stop}{settings}"
    text = report(results, command)
    print(text)
    print(f"\n{len(jobs)} fleets in {time.perf_counter() - started:.0f} s")
    if options.write:
        write_section(ROOT / "docs" / "validation" / "decision.md", text)


if __name__ == "__main__":
    main()
