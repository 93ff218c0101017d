"""Measured joints: a Kinova Gen3, joint by joint at constant speed, and two programs of all."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from panel.case import Case, Logged, Wanted

FOLDER = Path(__file__).parents[3] / "shared" / "data" / "kinova_gen3"
DECLARED = ("inertia", "gravity", "offset", "coulomb", "viscous")
PROGRAMS = ("Trajectory1", "RunTrajectory1")
RATE_HZ = 1000.0


def cases(seed: int, wanted: Wanted) -> Iterator[Case]:
    """Six joints one at a time, then both programs, each joint; the same for every seed."""
    if not FOLDER.is_dir():
        print(f"measured joints left out: {FOLDER} is not there")
        return
    for joint in range(1, 7):
        yield _case(f"joint {joint}", "one stroke", (f"joint_{joint}_trapez",), joint)
    for program in PROGRAMS:
        for joint in range(1, 8):
            yield _case(f"{program} joint {joint}", "program", (program,), joint)


def _case(name: str, stroke: str, files: tuple[str, ...], joint: int) -> Case:
    make = partial(read, files, joint)
    return Case("measured", name, stroke, "position", DECLARED, None, make)


def read(files: tuple[str, ...], joint: int) -> list[Logged]:
    """Read one joint of some recordings."""
    recordings = []
    for file in files:
        table = np.genfromtxt(FOLDER / f"{file}.csv", delimiter=",", names=True)
        recordings.append(
            Logged(
                RATE_HZ,
                current=table[f"Cur{joint}"],
                position=np.unwrap(table[f"Position{joint}"]),
                velocity=table[f"Velocity{joint}"],
                temperature=table[f"Temp{joint}"],
            )
        )
    return recordings
