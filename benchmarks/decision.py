"""How far the decision can be trusted, and what else would have found the fault.

Fleets of virtual robots are recorded in several healthy sessions and in one target session at
each severity of damage; temperature, friction, sensor gain and mounting differ by session. Every
method sees the same envelopes of the same motions. The motions are cut where the testbed knows
them to be, so that what is measured is the decision and not the segmentation.

    python benchmarks/decision.py --quick
    python benchmarks/decision.py --seeds 1000:1040 --jobs 2
"""

import argparse
import hashlib
import json
import multiprocessing
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import rivals
from numpy.typing import NDArray
from scipy.stats import kstest, rankdata

from opamc_cli.config.testbed import load_testbed
from opamc_cli.signal.analytic import clarke
from opamc_cli.signal.ordinal import ordinal_counts, time_delay
from opamc_cli.stats.decision import judge
from opamc_cli.stats.discriminant import fit
from opamc_cli.stats.divergence import divergences_from_pool
from opamc_cli.stats.features import compare
from opamc_cli.stats.sessions import Cell, inflation_within_sessions
from opamc_cli.testbed.robot import simulate

ROOT = Path(__file__).resolve().parents[1]
CACHE = Path(__file__).resolve().parent / "out" / "decision"

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


def record(robot, program, seed: int, session: int, axis: int, severity: float) -> dict:
    """Record one axis in one session and reduce it to what the methods need."""
    faults = {axis: replace(robot.damage, severity=severity)} if severity else {}
    recording = simulate(
        robot,
        program,
        seed=seed,
        session=session,
        axes=[axis],
        faults=faults,
        sampling_rate_hz=RATE_HZ,
    )
    segments = [s for s in recording.segments if s.axis == axis]
    vector = clarke(*recording.axes[axis].phases_a.T.astype(np.float64))
    # as the stage `patterns` does: the sensors' offset is the mean over the turns of all motions
    vector = vector - np.concatenate([vector[s.start : s.stop] for s in segments]).mean()
    envelope = np.abs(vector)
    # The square's angle does not jump where the torque changes its sign: half of it is the
    # carrier's, and the vector turned back by it is the torque current with its sign.
    carrier = np.unwrap(np.angle(vector**2)) / 2
    torque = (vector * np.exp(-1j * carrier)).real
    f_max_hz = robot.electrical_hz_full_speed * program.speed_percent / 100
    n_motions = 1 + max(s.motion for s in segments)
    shape = (program.cycles, n_motions)
    counts = {order: np.zeros((*shape, np.prod(range(1, order + 1))), np.int32) for order in ORDERS}
    features = np.zeros((*shape, 3 + 8 + 2))
    histogram = np.zeros((program.cycles, rivals.KDE_GRID_A.size), np.int32)
    for s in segments:
        part = envelope[s.start : s.stop]
        for order in ORDERS:
            tau = time_delay(RATE_HZ, f_max_hz, order, 2.0)
            counts[order][s.cycle, s.motion] = ordinal_counts(part, [order], tau)[order]
        features[s.cycle, s.motion] = np.concatenate(
            [
                rivals.amplitude_features(part),
                rivals.sideband_features(part, carrier[s.start : s.stop], POLE_PAIRS),
                [rivals.permutation_entropy(counts[o][s.cycle, s.motion]) for o in ORDERS],
            ]
        )
        histogram[s.cycle] += rivals.torque_histogram(torque[s.start : s.stop]).astype(np.int32)
    return {"counts": counts, "features": features, "histogram": histogram}


def record_fleet(job) -> dict:
    """Record one robot under one condition: all axes, all sessions, all severities."""
    seed, speed, payload, n_sessions, n_cycles, remount = job
    path = CACHE / f"{key(job)}.npz"
    if path.exists():
        with np.load(path) as stored:
            return dict(stored)
    robot, program = fleet(n_cycles, speed, payload, remount)
    rows = []
    for axis in AXES:
        rows += [(axis, s, 0.0) for s in range(n_sessions + 1)]
    rows += [(faulty_axis(seed), n_sessions, severity) for severity in SEVERITIES[1:]]
    done = [record(robot, program, seed, session, axis, sev) for axis, session, sev in rows]
    stored = {
        "rows": np.array(rows),
        "features": np.array([d["features"] for d in done]).astype(np.float32),
        "histogram": np.array([d["histogram"] for d in done]),
        **{f"counts{o}": np.array([d["counts"][o] for d in done]) for o in ORDERS},
    }
    CACHE.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(f".{seed}.tmp.npz")
    np.savez_compressed(temporary, **stored)
    temporary.rename(path)
    return stored


def key(job) -> str:
    settings = (*job, TEMPERATURE_SD_K, SENSOR_GAIN_SD, ORDERS, SEVERITIES, source_digest())
    return hashlib.sha256(repr(settings).encode()).hexdigest()[:24]


def source_digest() -> str:
    """Digest of everything the recordings depend on, so that no cache outlives its testbed."""
    files = [
        ROOT / "configs" / "testbed.yaml",
        *sorted((ROOT / "opamc_cli" / "testbed").glob("*.py")),
        *sorted((ROOT / "opamc_cli" / "signal").glob("ordinal*.py")),
        Path(rivals.__file__),
    ]
    return hashlib.sha256(b"".join(f.read_bytes() for f in files)).hexdigest()


def pick(stored, axis: int, session: int, severity: float) -> int:
    rows = stored["rows"]
    match = (rows[:, 0] == axis) & (rows[:, 1] == session) & (rows[:, 2] == severity)
    return int(np.flatnonzero(match)[0])


def cells_of(stored, baseline: list[int], target: list[int]) -> list[Cell]:
    cells = []
    for order in ORDERS:
        counts = stored[f"counts{order}"].astype(np.float64)
        for motion in range(counts.shape[2]):
            own, other = counts[baseline, :, motion], counts[target, :, motion]
            cycles = own.reshape(-1, own.shape[-1])
            session = np.repeat(np.arange(len(baseline)), own.shape[1])
            cells.append(
                Cell(
                    motion=motion,
                    order=order,
                    tau=0,
                    baseline=own.sum(axis=1),
                    target=other.sum(axis=1),
                    cycles=cycles,
                    target_cycles=other.reshape(-1, other.shape[-1]),
                    inflation=inflation_within_sessions(cycles, session),
                )
            )
    return cells


def thesis_features(stored, baseline: int, target: int, order: int) -> list[float]:
    """Δμ, Δσ² and KS as the thesis takes them: one session before, the pool holds its segments."""
    counts = stored[f"counts{order}"].astype(np.float64)
    jsd: dict[str, list[float]] = {"b": [], "t": []}
    for motion in range(counts.shape[2]):
        pool = counts[baseline, :, motion]
        jsd["b"] += divergences_from_pool(pool, pool).tolist()
        jsd["t"] += divergences_from_pool(counts[target, :, motion], pool).tolist()
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
    files = sorted((ROOT / "opamc_cli" / "stats").glob("*.py"))
    return hashlib.sha256(b"".join(f.read_bytes() for f in files)).hexdigest()


def judge_fleet(job) -> list[dict]:
    """Score every axis of one robot at every severity of its faulty axis, by every method."""
    seed, speed, payload, n_sessions, *_ = job
    stored = record_fleet(job)
    bad = faulty_axis(seed)
    results = []
    scores_healthy: dict[int, dict[str, float]] = {}
    for severity in SEVERITIES:
        cells, one = {}, {}
        for axis in AXES:
            baseline = [pick(stored, axis, s, 0.0) for s in range(n_sessions)]
            target = pick(stored, axis, n_sessions, severity if axis == bad else 0.0)
            cells[axis] = cells_of(stored, baseline, [target])
            one[axis] = cells_of(stored, baseline[:1], [target])
        judged, single = judge(cells), judge(one)
        for axis in AXES:
            baseline = [pick(stored, axis, s, 0.0) for s in range(n_sessions)]
            target = pick(stored, axis, n_sessions, severity if axis == bad else 0.0)
            if axis == bad or severity == 0.0:
                scores_healthy[axis] = rival_scores(stored, baseline, target, seed)
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
                    "thesis4": thesis_features(stored, baseline[0], target, 4),
                    "thesis5": thesis_features(stored, baseline[0], target, 5),
                    "scores": {
                        "opamc": -float(np.log10(j.p_value)),
                        "opamc, one baseline session": -float(np.log10(j1.p_value)),
                        **scores_healthy[axis],
                    },
                }
            )
    return results


def rival_scores(stored, baseline: list[int], target: int, seed: int) -> dict[str, float]:
    features = stored["features"].astype(np.float64)
    by_session = features.mean(axis=1)
    scores = {
        name: rivals.standardised_distance(
            by_session[baseline][..., part], by_session[target][..., part]
        )
        for name, part in FEATURE_SLICES.items()
    }
    density = {
        row: rivals.kernel_density(stored["histogram"][row].sum(axis=0).astype(float))
        for row in (*baseline, target)
    }
    own = [
        np.mean([rivals.symmetric_kl(density[a], density[b]) for b in baseline if b != a])
        for a in baseline
    ]
    other = np.mean([rivals.symmetric_kl(density[target], density[b]) for b in baseline])
    logs = np.log(own)
    scores["kernel density KL"] = float((np.log(other) - logs.mean()) / max(logs.std(ddof=1), 0.1))
    flat = features[baseline].reshape(-1, features.shape[-1])
    scale = flat.std(axis=0) + 1e-12
    scores["isolation forest"] = rivals.isolation_score(
        flat / scale, features[target].reshape(-1, features.shape[-1]) / scale, seed
    )
    return scores


def add_thesis_scores(results: list[dict]) -> None:
    """Score by the thesis's LDA, trained on the other half of the robots, normal and severity 1."""
    for order in ORDERS:
        name = f"thesis, order {order}"
        for half in (0, 1):
            train = [
                r
                for r in results
                if r["seed"] // 100 % 2 != half
                and (r["severity"] == 1.0 if r["bad"] else r["severity"] == 0)
            ]
            rows = np.array([r[f"thesis{order}"] for r in train])
            labels = np.array([r["bad"] for r in train])
            if not labels.any() or labels.all():
                rows = np.array([r[f"thesis{order}"] for r in results])
                labels = np.array([r["bad"] for r in results])
            model = fit(rows, labels)
            for r in results:
                if r["seed"] // 100 % 2 == half:
                    r["scores"][name] = float(model.project(r[f"thesis{order}"]))


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
    shares = ", ".join(f"{np.mean(p < q):.4f} below {q:g}" for q in (0.5, 0.1, 0.05, 0.01))
    lines.append(
        f"- p-values of healthy joints against uniform: KS p = "
        f"{kstest(one_each, 'uniform').pvalue:.3f} with one joint of each robot (independent), "
        f"{kstest(p, 'uniform').pvalue:.3f} with all; {shares}"
    )
    return "\n".join(lines)


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
    parser.add_argument("--seeds", default="1000:1040", help="first:stop")
    parser.add_argument("--conditions", default="20/0,20/1,20/2,50/0,50/1,50/2,100/0,100/1,100/2")
    parser.add_argument("--sessions", type=int, default=6, help="baseline sessions")
    parser.add_argument("--cycles", type=int, default=4)
    parser.add_argument(
        "--remount", action="store_true", help="take the gear apart between sessions"
    )
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--quick", action="store_true", help="4 robots, 3 conditions")
    parser.add_argument(
        "--write", action="store_true", help="put the figures in docs/validation.md"
    )
    options = parser.parse_args()
    first, stop = map(int, options.seeds.split(":"))
    conditions = [tuple(map(float, c.split("/"))) for c in options.conditions.split(",")]
    if options.quick:
        stop, conditions = first + 4, conditions[:1] + conditions[3:4] + conditions[6:7]
    jobs = [
        # every condition has robots of its own, or their sessions would not be independent
        (100 * seed + place, speed, payload, options.sessions, options.cycles, options.remount)
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
    remount = " --remount" if options.remount else ""
    command = f"python benchmarks/decision.py --seeds {first}:{stop}{remount}"
    text = report(results, command)
    print(text)
    print(f"\n{len(jobs)} fleets in {time.perf_counter() - started:.0f} s")
    if options.write:
        write_section(ROOT / "docs" / "validation.md", text)


if __name__ == "__main__":
    main()
