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
ACTUATOR = FOLDER.parent / "linear_actuator"
ACTUATOR_HZ = 25.0
SCREW_RAD_PER_MM = 0.02
"""Any constant would do: the stroke of 120 mm as 2.4 rad of a joint."""
FIVE = tuple(f"run_{k:02d}" for k in range(1, 6))


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
                others={
                    axis: np.unwrap(table[f"Position{axis}"])
                    for axis in range(1, 8)
                    if axis != joint
                },
            )
        )
    return recordings


def actuator_cases(seed: int, wanted: Wanted) -> Iterator[Case]:
    """One recording of every state of the ball screw, and five together; the same for all seeds."""
    if not ACTUATOR.is_dir():
        print(f"the actuator left out: {ACTUATOR} is not there")
        return
    for state in sorted(path.name for path in ACTUATOR.iterdir() if path.is_dir()):
        for name, files in (("one run", ("run_01",)), ("five runs", FIVE)):
            make = partial(read_actuator, state, files)
            declared = ("inertia", "offset", "coulomb", "viscous")
            yield Case("actuator", f"{state}, {name}", name, "position", declared, None, make)


def read_actuator(state: str, files: tuple[str, ...]) -> list[Logged]:
    """Read the strokes of some recordings of a state, to and fro, each a recording of its own.

    The source has cut out part of the rest between them. The current is unsigned: it drives the
    motion that the set point asks for.
    """
    strokes = []
    for file in files:
        table = np.genfromtxt(ACTUATOR / state / f"{file}.csv", delimiter=",", names=True)
        for cycle in np.unique(table["cycle"]):
            part = table[table["cycle"] == cycle]
            asked = np.sign(np.gradient(part["set_point_mm"]))
            for sign in (1, -1):
                rows = part[asked == sign]
                position = rows["position_mm"] * SCREW_RAD_PER_MM
                strokes.append(Logged(ACTUATOR_HZ, sign * rows["current_a"], position=position))
    return strokes
