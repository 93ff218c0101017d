"""Robots of a simulator by which nothing was chosen: false alarms, and what is found and named.

Three joints each, six baseline nights and one more; the hall's temperature (5 K from night to
night) is not logged. The second joint has a fault.

    python benchmarks/decision/closed_loop.py --robots 20 --first 1000
    python benchmarks/decision/closed_loop.py --robots 100 --first 2000 --sizes # healthy alone
"""

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "sources"))
from closed_loop_joint import FAULTS, ClosedLoopJoint, draw_joint, record

from opamc_cli import api
from opamc_cli.errors import OpamcError
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run

JOINTS = 3
FAULTY = 2
NIGHTS = 6
HALL_K = 5.0
RATES_HZ = (125.0, 250.0, 500.0, 1000.0)
SIZES = (0.25, 1.0, 3.0)
HEALTHY = ("healthy", 0.0)


def save_night(
    path: Path,
    joints: list[ClosedLoopJoint],
    night: int,
    colder_k: float,
    rate_hz: float,
    change: tuple[str, float] = HEALTHY,
) -> None:
    """Write all joints of a night; the shorter programs wait at their end."""
    parts = []
    for number, joint in enumerate(joints, 1):
        what = change if number == FAULTY and change != HEALTHY else ()
        parts.append(record(joint, night, colder_k, rate_hz, *what))
    longest = max(current.size for current, _ in parts)
    channels = {}
    for number, (current, position) in enumerate(parts, 1):
        lacking = longest - current.size
        rest = np.resize(current[-round(0.3 * rate_hz) :], lacking)
        channels[f"axis{number}_current"] = np.concatenate([current, rest])
        channels[f"axis{number}_position"] = np.pad(position, (0, lacking), mode="edge")
    save_run(path, RunInfo(sampling_rate_hz=rate_hz), channels)


def judged(seed: int, changes: list[tuple[str, float]]) -> dict[tuple[str, float], list | str]:
    """Diagnose one robot; a sentence where no joint can be judged."""
    joints = [draw_joint(JOINTS * seed + number) for number in range(JOINTS)]
    colder = np.random.default_rng([79, seed]).normal(0, HALL_K, NIGHTS + 1)
    rate_hz = RATES_HZ[seed % len(RATES_HZ)]
    found: dict[tuple[str, float], list | str] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for night in range(NIGHTS):
            save_night(folder / f"b/{night}.parquet", joints, night, colder[night], rate_hz)
        for change in changes:
            target = folder / f"{change[0]}{change[1]:g}" / "tonight.parquet"
            save_night(target, joints, NIGHTS, colder[NIGHTS], rate_hz, change)
            settings = {"joint.pole_pairs": 5}
            try:
                done = api.diagnose(folder / "b", target, out=folder / "out", settings=settings)
                found[change] = done.verdict["axes"]
            except OpamcError as error:
                found[change] = str(error)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--first", type=int, default=1000)
    parser.add_argument("--sizes", type=float, nargs="*", default=list(SIZES))
    options = parser.parse_args()
    changes = [HEALTHY] + [(fault, size) for fault in FAULTS for size in options.sizes]
    states: dict[tuple[str, float], Counter] = {change: Counter() for change in changes}
    causes: dict[tuple[str, float], Counter] = {change: Counter() for change in changes}
    alarms, below = 0, []
    for seed in range(options.first, options.first + options.robots):
        for change, axes in judged(seed, changes).items():
            if isinstance(axes, str):
                states[change]["not judged"] += 1
                print(f"{seed} {change}: {axes}")
                continue
            if change == HEALTHY:
                alarms += any(axis["state"] in ("changed", "fault") for axis in axes)
                below += [axis["p_value"] for axis in axes if axis["p_value"] is not None]
            axis = axes[FAULTY - 1]
            states[change][axis["state"]] += 1
            if axis["state"] in ("changed", "fault"):
                causes[change][(axis["cause"] or {}).get("effect")] += 1
    p = np.array(below)
    print(
        f"{alarms} of {options.robots} healthy robots alarm; of {p.size} healthy joints p is below "
        f"0.1 for {np.mean(p < 0.1):.1%}, 0.01 for {np.mean(p < 0.01):.1%}"
    )
    print("| change | size | joint 2 | causes |\n|---|---|---|---|")
    for change in changes[1:]:
        seen = ", ".join(f"{n} {state}" for state, n in states[change].most_common())
        named = ", ".join(f"{n} {cause}" for cause, n in causes[change].most_common())
        print(f"| {change[0]} | {change[1]:g} | {seen} | {named} |")


if __name__ == "__main__":
    main()
