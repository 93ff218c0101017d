"""Boundaries and cycles that the chain finds, against the testbed's truth.

    python benchmarks/chain/boundaries.py            # 20, 50, 100 %; 0, 1, 2 kg; down to 20 dB
    python benchmarks/chain/boundaries.py --quick
    python benchmarks/chain/boundaries.py --write    # and updates docs/validation/chain.md

Every axis is recorded alone with sensor noise set to a signal-to-noise ratio: power of the phase
current while the axis moves, over the power of the noise. Seeds begin at 1010: on earlier ones two
failings of the chain were found and mended.
"""

import argparse
import itertools
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from opamc_cli.config import load_config
from opamc_cli.config.testbed import TestbedConfig, load_testbed
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.testbed.robot import Recording, simulate

ROOT = Path(__file__).parents[2]
FIRST_SEED = 1010
BEGIN, END = "<!-- boundaries: begin -->", "<!-- boundaries: end -->"


@dataclass(frozen=True)
class Found:
    """What the chain made of one axis of one run."""

    errors_s: np.ndarray
    missed: int
    extra: int
    cycles_right: bool


def record(testbed: TestbedConfig, axis: int, seed: int, snr_db: float) -> Recording:
    """Record one axis with its sensor noise at a signal-to-noise ratio."""
    program = replace(testbed.program, axes=(axis,), order="together")

    def take(noise_a: float) -> Recording:
        sensor = replace(testbed.robot.sensor, noise_a=noise_a)
        robot = replace(testbed.robot, sensor=sensor)
        return simulate(robot, program, seed=seed, axes=[axis])

    clean = take(0.0)
    moving = np.concatenate([np.arange(s.start, s.stop) for s in clean.segments])
    power = float(np.mean(clean.axes[axis].phases_a[moving].astype(float) ** 2))
    return take(float(np.sqrt(power * 10 ** (-snr_db / 10))))


def look(recording: Recording, axis: int, folder: Path) -> Found:
    """Run the chain over one recording and compare it with the truth."""
    rate = recording.sampling_rate_hz
    path = folder / "run.parquet"
    phases = recording.axes[axis].phases_a
    columns = {
        f"axis{axis}_{name}": np.ascontiguousarray(phases[:, k]) for k, name in enumerate("abc")
    }
    save_run(path, RunInfo(sampling_rate_hz=rate), columns)
    chain = run_chain([path], load_config(None), folder)
    found = pq.read_table(chain.motions).to_pylist()
    errors, used = [], set()
    for truth in recording.segments:
        overlap = [min(truth.stop, row["stop"]) - max(truth.start, row["start"]) for row in found]
        best = int(np.argmax(overlap)) if overlap else -1
        if best < 0 or overlap[best] <= 0.5 * (truth.stop - truth.start) or best in used:
            continue
        used.add(best)
        errors.append((found[best]["start"] - truth.start) / rate)
        errors.append((found[best]["stop"] - truth.stop) / rate)
    cycles = len({row["cycle"] for row in found if row["cycle"] >= 0})
    return Found(
        errors_s=np.array(errors),
        missed=len(recording.segments) - len(used),
        extra=len(found) - len(used),
        cycles_right=cycles == 1 + max(s.cycle for s in recording.segments),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--quick", action="store_true", help="one seed, axes 2 and 6")
    parser.add_argument("--write", action="store_true", help="update docs/validation/chain.md")
    arguments = parser.parse_args()
    seeds = 1 if arguments.quick else arguments.seeds
    axes = (2, 6) if arguments.quick else (1, 2, 3, 4, 5, 6)
    lines = [
        "| speed | payload | SNR | start: median, largest | stop: median, largest | missed | extra "
        "| cycle count right |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for speed, payload, snr_db in itertools.product((20, 50, 100), (0, 1, 2), (40.0, 20.0)):
        testbed = load_testbed(
            ROOT / "configs" / "testbed.yaml",
            [f"program.speed_percent={speed}", f"program.payload_kg={payload}"],
        )
        results = []
        for axis in axes:
            for seed in range(arguments.first_seed, arguments.first_seed + seeds):
                recording = record(testbed, axis, seed, snr_db)
                with tempfile.TemporaryDirectory() as folder:
                    results.append(look(recording, axis, Path(folder)))
        errors = 1e3 * np.concatenate([r.errors_s for r in results])
        start, stop = np.abs(errors[0::2]), np.abs(errors[1::2])
        lines.append(
            f"| {speed} % | {payload} kg | {snr_db:.0f} dB "
            f"| {np.median(start):.1f}, {start.max():.0f} ms "
            f"| {np.median(stop):.1f}, {stop.max():.0f} ms "
            f"| {sum(r.missed for r in results)} | {sum(r.extra for r in results)} "
            f"| {sum(r.cycles_right for r in results)} of {len(results)} |"
        )
        print(lines[-1], flush=True)
    if arguments.write:
        path = ROOT / "docs" / "validation" / "chain.md"
        before, rest = path.read_text().split(BEGIN)
        note = (
            f"Seeds {arguments.first_seed} to {arguments.first_seed + seeds - 1}, six axes, four "
            "cycles of four motions each; `python benchmarks/chain/boundaries.py --write` makes "
            "this section."
        )
        section = "\n".join([BEGIN, "", note, "", *lines, "", END])
        path.write_text(before + section + rest.split(END)[1])


if __name__ == "__main__":
    main()
