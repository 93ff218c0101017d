"""How well motions are found: boundaries, largest frequency, direction, against generated truth.

    python benchmarks/chain/segmentation.py [--seeds N] [--quick]

Every seed draws a program of six moves (62.8, 157 or 314 Hz, shapes and lengths of the ramps,
rests of 0.2 to 1.2 s), a joint (holding torque or none, friction, inertia) and a signal-to-noise
ratio, with sensor offsets in half of the recordings. The seeds start at 1000: none of them was
looked at while the thresholds were chosen.
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "sources"))
from axis import segments_of
from carriers import Move, Recording, Torque, record

FS_HZ = 2048.0
FIRST_SEED = 1000


@dataclass(frozen=True)
class Draw:
    """What one seed drew."""

    moves: list[Move]
    recording: Recording
    f_max_hz: float
    snr_db: int
    held: bool


def draw(seed: int) -> Draw:
    rng = np.random.default_rng(seed)
    f_max_hz = float(rng.choice([62.8, 157.0, 314.0]))
    moves = [
        Move(
            f_max_hz * (1 if rng.random() < 0.6 else rng.uniform(0.4, 1)),
            int(rng.choice([-1, 1])),
            ramp_s=rng.uniform(0.12, 0.4),
            cruise_s=rng.uniform(0.02, 1),
            rest_s=rng.uniform(0.2, 1.2),
        )
        for _ in range(6)
    ]
    held = bool(rng.random() < 0.7)
    torque = Torque(
        hold=rng.uniform(-1, 1) if held else 0.0,
        swing=0.3 if held else 0.0,
        friction=rng.uniform(0.15, 0.5),
        viscous=rng.uniform(0, 0.3),
        inertia=rng.uniform(0.2, 1.2),
    )
    smooth = bool(rng.random() < 0.7)
    snr_db = int(rng.choice([20, 30, 40]))
    clean = record(moves, torque=torque, smooth=smooth, seed=seed)
    rms_a = float(clean.phases[:, clean.frequency_hz != 0].std())
    recording = record(
        moves,
        torque=torque,
        smooth=smooth,
        noise=rms_a * 10 ** (-snr_db / 20),
        offset=float(rng.choice([0, 0.03])) * rms_a,
        seed=seed,
    )
    return Draw(moves, recording, f_max_hz, snr_db, held)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=300, help="recordings to draw")
    parser.add_argument("--quick", action="store_true", help="40 recordings")
    arguments = parser.parse_args()
    n_seeds = 40 if arguments.quick else arguments.seeds
    rows = []
    n_missed = 0
    for seed in range(FIRST_SEED, FIRST_SEED + n_seeds):
        drawn = draw(seed)
        spans, motions = segments_of(drawn.recording.phases, FS_HZ)
        if len(spans) != len(drawn.moves):
            n_missed += 1
            continue
        for span, motion, truth, move in zip(
            spans, motions, drawn.recording.intervals, drawn.moves, strict=True
        ):
            rows.append(
                (
                    drawn.f_max_hz,
                    drawn.snr_db,
                    drawn.held,
                    1e3 * abs(span[0] - truth[0]) / FS_HZ,
                    1e3 * abs(span[1] - truth[1]) / FS_HZ,
                    100 * abs(motion.f_max_hz / move.f_max_hz - 1),
                    motion.direction == move.direction,
                )
            )
    found = np.array(rows, dtype=float)
    print(f"{n_seeds} recordings, {n_missed} with a motion too many or too few")
    print("| | motions | start ms, median (90 %) | stop ms | f_max % | direction |")
    print("|---|---|---|---|---|---|")
    groups = [("all", np.ones(len(found), dtype=bool))]
    groups += [(f"{f:g} Hz", found[:, 0] == f) for f in (62.8, 157, 314)]
    groups += [(f"{snr} dB", found[:, 1] == snr) for snr in (20, 30, 40)]
    groups += [("held", found[:, 2] == 1), ("not held", found[:, 2] == 0)]
    for name, chosen in groups:
        part = found[chosen]
        median, most = np.median(part, axis=0), np.quantile(part, 0.9, axis=0)
        start, stop, f_max = (f"{median[c]:.1f} ({most[c]:.1f})" for c in (3, 4, 5))
        print(f"| {name} | {len(part)} | {start} | {stop} | {f_max} | {part[:, 6].mean():.1%} |")


if __name__ == "__main__":
    main()
