"""The steps of a walk, how often each is taken, and how its arguments are drawn."""

import copy
import os
import random
import shutil
from collections.abc import Callable
from typing import Any

from cell_logs import night

from walk.by_table import CRASHES, FAILS
from walk.cell import ROBOTS, TO_COME, World
from walk.checks import start

Op = tuple[Any, ...]
"""Name of a step and its arguments."""


class Draw(random.Random):
    """Draws the arguments of steps; joints keep their state for a while."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self._state = {(robot, axis): "H" for robot in ROBOTS for axis in (1, 2)}

    def who(self) -> str:
        """Return a robot."""
        return self.choice(ROBOTS[:3])

    def codes(self) -> dict[str, str]:
        """Return what recordings of each robot say now."""
        for key in self._state:
            if self.random() < 0.2:
                self._state[key] = self.choice("HHFFGCUX")
        return {
            robot: "".join(
                self._state[robot, axis] if self.random() > 0.06 else self.choice("HFGCUX")
                for axis in (1, 2)
            )
            for robot in ROBOTS
        }

    def code(self) -> str:
        """Return what a recording of some robot says now."""
        return self.codes()[self.who()]


STEPS: dict[str, tuple[Callable[..., None], int, bool, Callable[[Draw], Op]]] = {}
"""What is done, how often, whether files are lost or changed, and the arguments, by name."""


def step(often: int, draw: Callable[[Draw], Op], *, loses: bool = False) -> Callable[..., Any]:
    def listed(function: Callable[..., None]) -> Callable[..., None]:
        STEPS[function.__name__] = function, often, loses, draw
        return function

    return listed


def some_robots(draw: Draw) -> Op:
    codes = draw.codes()
    return ({robot: codes[robot] for robot in ROBOTS[:3] if draw.random() > 0.12},)


@step(30, some_robots)
def add(world: World, codes: dict[str, str]) -> None:
    world.last += 1
    for robot, code in codes.items():
        world.record(robot, night(world.last), code)


@step(3, lambda draw: (draw.who(), draw.randrange(20), draw.code()))
def late(world: World, robot: str, index: int, code: str) -> None:
    of = night(index % (world.last + 1))
    if not (world.logs / robot / of).exists():
        world.record(robot, of, code)


@step(2, lambda draw: (draw.who(), draw.choice([-1, -1, -2]), draw.code()))
def second(world: World, robot: str, index: int, code: str) -> None:
    for folder in world.pick(robot, index):
        world.record(robot, folder.name, code, "b")


@step(4, lambda draw: (draw.who(), draw.choice([[1], [2], [1, 2], [], [1, 3]])))
def axes(world: World, robot: str, axes: list[int]) -> None:
    world.axes.pop(robot, None)
    world.axes |= {robot: axes} if axes else {}


RULES = [(2, 3, 0.9), (1, 1, 0.9), (3, 3, 0.9), (3, 3, 5.0), (2, 3, 5.0), (3, 5, 9.0)]


@step(4, lambda draw: draw.choice(RULES))
def alarm(world: World, nights: int, of: int, gross: float) -> None:
    world.alarm |= {"nights": nights, "of": of, "gross": gross}


@step(2, lambda draw: (draw.choice([1, 2, 7]),))
def remind(world: World, nights: int) -> None:
    world.alarm["remind_after"] = nights


NAMED = ["auto", *(["r" + one for one in which] for which in ("123", "12", "23", "13", "1234"))]


@step(5, lambda draw: (draw.choice(NAMED),))
def robots(world: World, named: str | list[str]) -> None:
    world.robots = named


@step(3, lambda draw: (draw.choice([0.05, 0.3, None]),))
def option(world: World, fault_effect: float | None) -> None:
    world.options = {} if fault_effect is None else {"score.fault_effect": fault_effect}


@step(4, lambda draw: (draw.who(), *draw.choice([(1,), (2,), ()])))
def acknowledge(world: World, robot: str, *axis: int) -> None:
    of = ("--axis", *axis) if axis else ()
    world.call("nightly", "acknowledge", robot, *of, "--why", "known", "--cell", world.cell)


@step(2, lambda _: ())
def lose_pages(world: World) -> None:
    for name in ("index.html", "metrics.prom"):
        (world.out / name).unlink(missing_ok=True)


@step(4, lambda draw: (draw.randrange(1, 25),))
def kill(world: World, ticks: int) -> None:
    start(world, "--quiet", kill=ticks)


@step(2, lambda draw: (draw.who(), -draw.randint(1, 4)))
def touch(world: World, robot: str, index: int) -> None:
    for folder in world.pick(robot, index):
        world.written += 1
        for path in folder.iterdir():
            os.utime(path, (1e9 + world.written, 1e9 + world.written))


@step(1, lambda draw: (draw.choice([1, 2, 30]),))
def keep(world: World, reports: int) -> None:
    world.keep = reports


RECENT = [-1, -1, -2, -3, 0, 1]


@step(1, lambda draw: (draw.who(), draw.choice(RECENT)))
def lose_results(world: World, robot: str, index: int) -> None:
    for folder in world.pick(robot, index):
        shutil.rmtree(world.out / robot / folder.name, ignore_errors=True)


@step(4, lambda draw: (draw.who(), draw.choice(RECENT)), loses=True)
def lose(world: World, robot: str, index: int) -> None:
    for folder in world.pick(robot, index):
        world.discard(*folder.iterdir())


@step(2, lambda draw: (draw.who(),), loses=True)
def lose_robot(world: World, robot: str) -> None:
    world.discard(*(world.logs / robot).rglob("*.parquet"))


@step(2, lambda draw: (draw.who(), draw.choice([-1, -2, -3])), loses=True)
def lose_second(world: World, robot: str, index: int) -> None:
    for folder in world.pick(robot, index):
        if len(list(folder.iterdir())) > 1:
            world.discard(*folder.glob("b.parquet"))


@step(4, lambda draw: (draw.randrange(10),), loses=True)
def restore(world: World, index: int) -> None:
    for path, content in (world.trash[index % len(world.trash)] if world.trash else {}).items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


@step(4, lambda draw: (draw.who(), draw.choice([-1, -2, 0, -3]), draw.code()), loses=True)
def replace(world: World, robot: str, index: int, code: str) -> None:
    for folder in world.pick(robot, index):
        world.record(robot, folder.name, code)


@step(2, lambda draw: (draw.who(), -1, draw.choice([CRASHES, FAILS])), loses=True)
def crash(world: World, robot: str, index: int, code: str) -> None:
    replace(world, robot, index, code)


@step(3, lambda draw: (draw.who(), draw.choice(RECENT)), loses=True)
def cut(world: World, robot: str, index: int) -> None:
    for folder in world.pick(robot, index):
        path = min(folder.iterdir())
        content = path.read_bytes()
        world.trash.append({path: content})
        path.write_bytes(content[: len(content) // 2])


@step(2, lambda draw: (draw.who(), draw.choice([-1, -2])), loses=True)
def repeat(world: World, robot: str, index: int) -> None:
    for folder in world.pick(robot, index):
        world.last += 1
        shutil.copytree(folder, world.logs / robot / night(world.last), dirs_exist_ok=True)


@step(1, lambda draw: (draw.who(), draw.who()), loses=True)
def mix(world: World, robot: str, other: str) -> None:
    for folder in world.pick(robot, -1) if robot != other else []:
        to = world.logs / other / folder.name
        to.mkdir(parents=True, exist_ok=True)
        for path in folder.iterdir():
            shutil.copy(path, to / f"z{path.name}")


BASELINES = ["{nights: 2}", "{nights: 3}", f"{{from: {night(0)}, to: {night(1)}}}"]


@step(3, lambda draw: (draw.choice(BASELINES),), loses=True)
def baseline(world: World, text: str) -> None:
    world.baseline = text


@step(6, lambda draw: (draw.who(), -draw.randint(1, 4), draw.random() < 0.4), loses=True)
def rebaseline(world: World, robot: str, index: int, undo: bool) -> None:
    for folder in world.pick(robot, index):
        of = ("--from", folder.name, "--why", "new gear", *(["--undo"] if undo else []))
        if world.call("nightly", "rebaseline", robot, *of, "--cell", world.cell).code == 0:
            world.heard.rebased.add(robot)


@step(2, lambda _: (), loses=True)
def copy_history(world: World) -> None:
    if (world.out / "history.sqlite").is_file():
        shutil.copy(world.out / "history.sqlite", world.folder / "old.sqlite")
        world.copied = copy.deepcopy(world.heard)


@step(2, lambda _: (), loses=True)
def put_history_back(world: World) -> None:
    if world.copied:
        for ending in ("-wal", "-shm"):
            (world.out / f"history.sqlite{ending}").unlink(missing_ok=True)
        shutil.copy(world.folder / "old.sqlite", world.out / "history.sqlite")
        world.heard = copy.deepcopy(world.copied)


@step(2, lambda draw: (draw.who(), draw.choice(ROBOTS)), loses=True)
def rename(world: World, robot: str, other: str) -> None:
    if (world.logs / robot).exists() and not (world.logs / other).exists():
        (world.logs / robot).rename(world.logs / other)


@step(2, lambda draw: (draw.who(), draw.choice(RECENT)), loses=True)
def load(world: World, robot: str, index: int) -> None:
    for folder in world.pick(robot, index):
        world.record(robot, folder.name, "HH", payload_kg=5.0)


@step(4, lambda draw: (draw.who(), draw.choice([-1, -2, -3])), loses=True)
def end_program(world: World, robot: str, index: int) -> None:
    for folder in world.nights(robot)[:index]:  # all nights but the last few have another one, too
        if not (folder / "b.parquet").exists():
            world.record(robot, folder.name, "HH", "b", program="lift")


@step(1, lambda draw: (draw.who(),), loses=True)
def lose_clock(world: World, robot: str) -> None:
    for folder in world.pick(robot, -1):
        if not (world.logs / robot / TO_COME).exists():
            folder.rename(world.logs / robot / TO_COME)


def generate(seed: int) -> list[Op]:
    """Return a walk's steps."""
    draw = Draw(seed)
    names = [name for name, (_, _, loses, _) in STEPS.items() if seed % 2 or not loses]
    often = [STEPS[name][1] for name in names]
    healthy = dict.fromkeys(ROBOTS[:3], "HH")
    ops: list[Op] = [("add", healthy), ("add", healthy)]
    for _ in range(draw.randint(10, 20)):
        (name,) = draw.choices(names, often)
        for _ in range(draw.choice([1, 1, 1, 2, 3]) if name == "add" else 1):
            ops.append((name, *STEPS[name][3](draw)))
        if draw.random() < 0.75:
            asked = draw.choices(
                [("--robot", draw.who()), ("--night", -1), ("--since", -2), ()], [10, 4, 4, 82]
            )
            ops.append(("start", *asked[0], *(["--quiet"] if draw.random() < 0.7 else [])))
    return [*ops, ("start", "--quiet")]
