"""A cell over half a year: what the memory of the nights is worth beside each night alone.

Virtual robots of three joints are recorded every night over six months: the hall warms and cools
with the season, one morning in ten is cold, nights are missing, payloads change (some logged, some
not), gears are exchanged (and the new baseline declared), and some joints wear from severity 0 to 1
within 30 to 90 nights. Every recording goes through the true chain (segment, identify, patterns)
and the true decision against the robot's baseline of six nights; what `opamc nightly` does besides
(tables, pages, the search for causes) is left out. The nights then go through the same alarm rule
as the command's.

    python benchmarks/year.py --robots 4 --nights 60 --first-seed 100
    python benchmarks/year.py --first-seed 41000
"""

import argparse
import json
import shutil
import tempfile
import time
from collections import Counter
from dataclasses import asdict, dataclass, field, replace
from datetime import date, timedelta
from functools import cache
from pathlib import Path

import numpy as np

from opamc_cli.config import load_config
from opamc_cli.config.cell import AlarmConfig
from opamc_cli.config.testbed import TestbedConfig, load_testbed
from opamc_cli.stages.chain import identify, patterns, segment
from opamc_cli.stages.chain.compared.side import Sides, read_side
from opamc_cli.stages.nightly.alarms.robot import settle_robot
from opamc_cli.stages.processes.kept import KeptResults
from opamc_cli.stages.verdict.decision import decide
from opamc_cli.storage.history.rows import AlarmRow
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.testbed.robot import simulate

ROOT = Path(__file__).resolve().parents[1]
CACHE = Path(__file__).resolve().parent / "out" / "year"

BASELINE_NIGHTS = 6
AXES = (1, 2, 3)
SEASON_K = 5.0  # a hall without air conditioning: 17 to 27 degrees over the year
COLD_SHARE, COLD_K = 0.1, -8.0  # a morning after a night without heating
MISSING_SHARE = 0.05
PAYLOAD_KG = 1.0
FAULT_EFFECT = 0.3
FIRST_NIGHT = date(2026, 1, 1)


@dataclass(frozen=True)
class Life:
    """What happens to one robot; nights count from 0."""

    seed: int
    wearing_axis: int | None
    wear_starts: int
    wear_nights: int
    exchanged_axis: int | None
    exchanged_at: int
    payload_from: int | None
    unlogged_payload_at: tuple[int, ...]
    missing: tuple[int, ...]
    season_phase: float

    def severity(self, night: int) -> float:
        """Return the damage of the wearing axis, 0 to 1."""
        return float(np.clip((night - self.wear_starts) / self.wear_nights, 0, 1))


def lives(n_robots: int, n_nights: int, first_seed: int) -> list[Life]:
    """Draw what happens to each robot: a quarter wears, a twelfth gets a new gear."""
    drawn = []
    for index in range(n_robots):
        rng = np.random.default_rng([first_seed, index])
        wears = index % 4 == 0
        exchanged = index % 12 == 1
        gap = int(rng.integers(20, n_nights - 10))
        gone = set(np.flatnonzero(rng.random(n_nights) < MISSING_SHARE).tolist())
        gone |= set(range(gap, gap + 4)) if index % 3 == 2 else set()
        drawn.append(
            Life(
                seed=first_seed + index,
                wearing_axis=int(rng.choice(AXES)) if wears else None,
                wear_starts=int(rng.integers(n_nights // 5, n_nights // 2)),
                wear_nights=int(rng.integers(30, 91)),
                exchanged_axis=int(rng.choice(AXES)) if exchanged else None,
                exchanged_at=int(rng.integers(n_nights // 3, 2 * n_nights // 3)),
                payload_from=int(rng.integers(n_nights // 3, n_nights - 20))
                if index % 6 == 3
                else None,
                unlogged_payload_at=tuple(rng.integers(20, n_nights, 2).tolist())
                if index % 6 == 5
                else (),
                missing=tuple(sorted(gone)),
                season_phase=float(rng.uniform(0, 365)),
            )
        )
    return drawn


@cache
def testbed() -> TestbedConfig:
    """Return the robot of data/samples."""
    return load_testbed(ROOT / "configs" / "samples.yaml")


def record(life: Life, night: int, folder: Path) -> Path:
    """Record one night of a robot; three cycles of two motions of all joints together, 6 s."""
    config = testbed()
    rng = np.random.default_rng([life.seed, night, 7])
    ambient = 22 + SEASON_K * np.sin(2 * np.pi * (night + life.season_phase) / 365)
    ambient += COLD_K if rng.random() < COLD_SHARE else 0.0
    joints = [
        replace(joint, thermal=replace(joint.thermal, ambient_c=float(ambient)))
        for joint in config.robot.joints
    ]
    if life.exchanged_axis and night >= life.exchanged_at:
        at = life.exchanged_axis - 1
        gear, friction = joints[at].gear, joints[at].friction
        joints[at] = replace(
            joints[at],
            gear=replace(
                gear,
                error_2_circular_rad=gear.error_2_circular_rad * 1.4,
                error_4_flexspline_rad=gear.error_4_flexspline_rad * 0.6,
            ),
            friction=replace(friction, coulomb_nm=friction.coulomb_nm * 0.85),
        )
    # nobody takes a gear apart between two nights: its mounting stays
    spread = replace(config.robot.spread, remount=False)
    robot = replace(config.robot, joints=tuple(joints), spread=spread)
    loaded = life.payload_from is not None and night >= life.payload_from
    payload = PAYLOAD_KG if loaded else 0.0
    program = replace(
        config.program,
        waypoints_rad=(0.0, 1.5),
        cycles=3,
        lead_s=0.3,
        dwell_s=0.2,
        payload_kg=PAYLOAD_KG / 2 if night in life.unlogged_payload_at else payload,
    )
    damage = {}
    if life.wearing_axis and life.severity(night) > 0:
        damage[life.wearing_axis] = replace(robot.damage, severity=life.severity(night))
    recording = simulate(robot, program, seed=life.seed, session=night, faults=damage)
    columns = {}
    for axis, signals in recording.axes.items():
        for index, phase in enumerate("abc"):
            columns[f"axis{axis}_{phase}"] = np.ascontiguousarray(signals.phases_a[:, index])
        columns[f"axis{axis}_temperature"] = signals.temperature_c
    path = folder / f"night-{night:03d}.parquet"
    info = RunInfo(
        recording.sampling_rate_hz, program="cycle", speed_percent=100.0, payload_kg=payload
    )
    save_run(path, info, columns)
    return path


@dataclass(frozen=True)
class Measured:
    """What the decision measured of one joint in one night."""

    night: int
    axis: int
    state: str
    p_value: float
    distance: float
    common: float
    effect: float
    temperature_c: float
    payload_kg: float
    severity: float


def measure_robot(life: Life, n_nights: int) -> list[Measured]:
    """Record all nights of a robot and judge each against its baseline."""
    config = load_config()
    found: list[Measured] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        kept = KeptResults(folder / "kept")
        baseline: list[Path] = []
        condition: tuple[bool, bool] | None = None
        for night in range(n_nights):
            if night in life.missing:
                continue
            now = (
                life.exchanged_axis is not None and night >= life.exchanged_at,
                life.payload_from is not None and night >= life.payload_from,
            )
            if now != condition:
                condition, baseline = now, []
                shutil.rmtree(folder / "baseline", ignore_errors=True)
            run = record(life, night, folder)
            if len(baseline) < BASELINE_NIGHTS:
                baseline.append(run)
                continue
            if not (folder / "baseline").exists():
                tables(baseline, folder / "baseline", config, None, kept)
            tables([run], folder / "target", config, folder / "baseline" / "motions.parquet", None)
            found += judged(folder, config, life, night)
            run.unlink()
    return found


def tables(runs, out, config, reference, kept):
    """Run the chain over one side."""
    segmented = segment.run(runs, config, out, kept=kept)
    identified = identify.run(segmented.path, config, out, reference=reference, kept=kept)
    patterns.run(identified.path, config, out, kept=kept)


def judged(folder: Path, config, life: Life, night: int) -> list[Measured]:
    """Judge one night from its tables."""
    sides = Sides(
        read_side(folder / "baseline" / "patterns.parquet"),
        read_side(folder / "target" / "patterns.parquet"),
        config.score.day_starts_at,
    )
    loaded = life.payload_from is not None and night >= life.payload_from
    warm: dict[int, list[float]] = {}
    for key, part in sides.rows[1].items():
        warm.setdefault(key[0], []).extend(part.rows["temperature_c"])
    return [
        Measured(
            night,
            axis,
            one.state,
            one.p_value,
            float(np.log(one.distance_ratio)),
            one.allowed_log_ratio,
            one.effect,
            float(np.median(warm.get(axis, [np.nan]))),  # a night may lack an axis
            PAYLOAD_KG if loaded else 0.0,
            life.severity(night) if axis == life.wearing_axis else 0.0,
        )
        for axis, one in decide(sides, config).judgements.items()
    ]


Cell = list[tuple[Life, list[Measured]]]


def measured_cell(n_robots: int, n_nights: int, first_seed: int, only_known: bool) -> Cell:
    """Measure every robot of a cell, those that wear first; what was measured before is read."""
    cell = []
    for life in sorted(lives(n_robots, n_nights, first_seed), key=lambda one: not one.wearing_axis):
        path = CACHE / f"{first_seed}-{n_nights}" / f"robot-{life.seed}.json"
        if not path.exists():
            if only_known:
                continue
            started = time.perf_counter()
            found = measure_robot(life, n_nights)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps([asdict(one) for one in found]))
            print(f"robot {life.seed}: {time.perf_counter() - started:.0f} s", flush=True)
        cell.append((life, [Measured(**row) for row in json.loads(path.read_text())]))
    return cell


def history_of(life: Life, rows: list[Measured], *, chart: bool) -> list[dict[str, object]]:
    """Return what the history would hold.

    Without the chart, nothing but each night's verdict, and nights that only changed count, too.
    """
    return [
        {
            **{"robot": str(life.seed), "program": "cycle", "axis": one.axis},
            **{"night": day(one.night), "effect": one.effect},
            "state": "fault" if one.state == "changed" and not chart else one.state,
            **{"distance": one.distance if chart else None, "common": one.common},
            "p_value": one.p_value if chart else None,
            **{"harmless": 0, "cause": None, "reason": "", "temperature_c": one.temperature_c},
            "baseline": f"{one.payload_kg} {one.night >= life.exchanged_at}"
            if life.exchanged_axis
            else str(one.payload_kg),
        }
        for one in sorted(rows, key=lambda one: (one.axis, one.night))
    ]


def day(night: int) -> str:
    """Return a night's date."""
    return (FIRST_NIGHT + timedelta(night)).isoformat()


def number(text: str) -> int:
    """Return the number of a night's date."""
    return (date.fromisoformat(text) - FIRST_NIGHT).days


@dataclass
class Score:
    """How an alarm rule did over a cell."""

    false: int = 0
    alarmed: list[tuple[int, float, int, int]] = field(default_factory=list)
    missed: list[int] = field(default_factory=list)
    forecasts: list[tuple[int, bool]] = field(default_factory=list)
    trends: list[str] = field(default_factory=list)
    """What was said of the trend at each alarm of a wearing joint."""


def evaluate(cell: Cell, rule: AlarmConfig, *, chart: bool) -> Score:
    """Let every robot's nights go through the command's own alarm rule."""
    score = Score()
    for life, rows in cell:
        series = history_of(life, rows, chart=chart)
        settled = settle_robot(str(life.seed), series, [], [], rule, FAULT_EFFECT, BASELINE_NIGHTS)
        found = False
        for alarm in settled.alarms:
            raised = number(alarm.raised)
            severity = life.severity(raised) if alarm.axis == life.wearing_axis else 0.0
            if severity == 0:
                score.false += 1
            elif not found:
                found = True
                until_half = life.wear_starts + life.wear_nights / 2 - raised
                told = as_first_told(life, series, alarm.raised, rule)
                since = number(told.since)
                score.trends.append(kind_of(json.loads(told.trend)))
                score.alarmed.append((life.seed, severity, round(until_half), since))
        if life.wearing_axis and not found:
            score.missed.append(life.seed)
        if life.wearing_axis and chart:
            score.forecasts += forecasts(life, rows, series)
    return score


def kind_of(trend: dict[str, object]) -> str:
    """Return what a trend comes to."""
    if not trend:
        return "too few nights"
    if trend["reach"] is not None:
        return "forecast" if trend["reach"] != [0, 0] else "at fault level"
    return "grows" if trend["distance"][1] > 0 else "no trend"


def as_first_told(
    life: Life, series: list[dict[str, object]], until: str, rule: AlarmConfig
) -> AlarmRow:
    """Return the wearing joint's alarm as it was told in a night."""
    known = [row for row in series if row["axis"] == life.wearing_axis and row["night"] <= until]
    return settle_robot(str(life.seed), known, [], [], rule, FAULT_EFFECT, BASELINE_NIGHTS).alarms[
        -1
    ]


def forecasts(
    life: Life, rows: list[Measured], series: list[dict[str, object]]
) -> list[tuple[int, bool]]:
    """Hold each night's forecast of the fault level against the night that reached it."""
    own = sorted((one for one in rows if one.axis == life.wearing_axis), key=lambda o: o.night)
    nights = np.array([one.night for one in own])
    effects = np.array([one.effect for one in own])
    # the level is reached in the night around which the median of seven nights is above it
    smooth = np.array([np.median(effects[max(0, t - 3) : t + 4]) for t in range(len(own))])
    above = np.flatnonzero((smooth >= FAULT_EFFECT) & (nights >= life.wear_starts))
    if not above.size:
        return []
    reached = int(nights[above[0]])
    found = []
    for night in nights[(nights >= life.wear_starts) & (nights < reached)].tolist():
        known = [row for row in series if row["night"] <= day(night)]
        known = [row for row in known if row["axis"] == life.wearing_axis]
        alarms = settle_robot(
            str(life.seed), known, [], [], AlarmConfig(), FAULT_EFFECT, BASELINE_NIGHTS
        ).alarms
        trend = json.loads(alarms[-1].trend) if alarms and not alarms[-1].cleared else {}
        if trend.get("reach"):
            low, high = trend["reach"]
            found.append((life.seed, bool(low <= reached - night <= high)))
    return found


def report(cell: Cell) -> str:
    """Return the figures as a table."""
    nights = sum(len({one.night for one in rows}) for _, rows in cell)
    wearing = sum(life.wearing_axis is not None for life, _ in cell)
    lines = [
        f"{len(cell)} robots, {nights / 365:.1f} robot-years judged, {wearing} joints that wear",
        "",
        "| | with memory | each night alone, 2 of 3 | 3 of 4 |",
        "|---|---|---|---|",
    ]
    scores = [
        evaluate(cell, AlarmConfig(), chart=True),
        evaluate(cell, AlarmConfig(), chart=False),
        evaluate(cell, AlarmConfig(nights=3, of=4), chart=False),
    ]
    rows = {
        "false alarms (per robot-year)": lambda s: f"{s.false} ({s.false / (nights / 365):.2f})",
        "wearing joints alarmed": lambda s: f"{len(s.alarmed)} of {wearing}",
        "before severity 0.5": lambda s: f"{sum(a[1] < 0.5 for a in s.alarmed)} of {wearing}",
        "severity at the alarm, median (largest)": lambda s: (
            f"{np.median([a[1] for a in s.alarmed]):.2f} ({max(a[1] for a in s.alarmed):.2f})"
        ),
        "nights before severity 0.5, median": lambda s: (
            f"{np.median([a[2] for a in s.alarmed]):.0f}"
        ),
    }
    for name, of in rows.items():
        lines.append(f"| {name} | {' | '.join(of(s) if s.alarmed else '–' for s in scores)} |")
    begun = {life.seed: life.wear_starts for life, _ in cell}
    off = [a[3] - begun[a[0]] for a in scores[0].alarmed]
    right = sum(abs(o) <= 5 for o in off)
    lines.append(f"\n'since when' off by (nights): {off}; within 5 nights: {right} of {len(off)}")
    lines.append(f"the trend as it was told at the alarm: {dict(Counter(scores[0].trends))}")
    told = scores[0].forecasts
    inside = sum(ok for _, ok in told)
    lines.append(
        f"forecasts of the fault level: {len(told)} nights of {len({s for s, _ in told})} joints, "
        f"{inside} held the night in which it was reached"
    )
    return "\n".join(lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--robots", type=int, default=24)
    parser.add_argument("--nights", type=int, default=180)
    parser.add_argument("--first-seed", type=int, default=41000)
    parser.add_argument("--known", action="store_true", help="only robots measured before")
    options = parser.parse_args()
    print(report(measured_cell(options.robots, options.nights, options.first_seed, options.known)))
