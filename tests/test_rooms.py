"""The house: what may know of what, and how much stands in a room."""

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import combinations
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "opamc_cli"

LAYERS = (
    {"errors"},
    {"signal", "decision", "joint", "arm", "testbed"},
    {"config"},
    {"storage"},
    {"stages"},
    {"commands"},
    {"api", "__init__", "__main__", "entry"},
)
"""From the ground up; a thing knows its own layer and those below."""

MOST_THINGS = 9
DOORS = {"api.py", "entry.py", "errors.py", "py.typed"}
"""Beside `__init__` and `__main__`: where others come in, and what they catch."""
ENTRIES = {("__init__",), ("entry",)}
"""What is imported for the version, or for what it does."""
SHELVES = {"joint/effects", "stages/report/figures"}
"""Rooms that hold one file for each of many things of a kind."""


def module_of(path: Path) -> tuple[str, ...]:
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return parts[:-1] if parts[-1] == "__init__" and len(parts) > 1 else parts


@cache
def modules() -> dict[tuple[str, ...], Path]:
    return {module_of(path): path for path in PACKAGE.rglob("*.py")}


def imported(path: Path) -> set[tuple[str, ...]]:
    """Return the package's modules that a file imports, inside functions too."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [tuple(alias.name.split(".")) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            module = tuple(node.module.split("."))
            names = [(*module, alias.name) for alias in node.names]
        else:
            continue
        for name in names:
            if name[0] == "opamc_cli":
                inside = name[1:]
                found.add(inside if inside in modules() else inside[:-1] or ("__init__",))
    return found


@cache
def arrows() -> dict[tuple[str, ...], set[tuple[str, ...]]]:
    return {
        module: {name for name in imported(path) if name != module}
        for module, path in modules().items()
    }


def level(module: tuple[str, ...]) -> int:
    return next(number for number, layer in enumerate(LAYERS) if module[0] in layer)


def test_no_arrow_points_up():
    upward = [
        (".".join(one), ".".join(other))
        for one, others in arrows().items()
        for other in others
        # the version is everybody's
        if level(other) > level(one) and other != ("__init__",)
    ]
    assert upward == []


def test_no_module_knows_itself_by_way_of_others():
    check_no_circle({one: others - ENTRIES for one, others in arrows().items()})


@pytest.mark.parametrize("depth", [2, 3])
def test_no_two_rooms_know_each_other(depth):
    graph: dict[tuple[str, ...], set[tuple[str, ...]]] = {}
    for one, others in arrows().items():
        room = one[:depth]
        known = {other[:depth] for other in others}
        graph.setdefault(room, set()).update(known - {room} - ENTRIES)
    check_no_circle(graph)


def check_no_circle(graph):
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" <- ".join(".".join(module) for module in error.args[1]))


def test_a_room_shows_nine_things_at_most():
    crowded = {}
    for folder in {path.parent for path in modules().values()}:
        things = {
            path.name
            for path in folder.iterdir()
            if not path.name.startswith("__") and path.name not in DOORS
        }
        inside = folder.relative_to(PACKAGE).as_posix()
        if len(things) > MOST_THINGS and inside not in SHELVES:
            crowded[inside] = sorted(things)
    assert crowded == {}


def test_studies_do_not_live_on_tests():
    for path in (ROOT / "benchmarks").rglob("*.py"):
        assert '"tests"' not in path.read_text(encoding="utf-8"), path.name


def test_science_opens_no_files():
    banned = {("storage",), ("config",), ("stages",), ("commands",)}
    for one, others in arrows().items():
        if one[0] in LAYERS[1]:
            assert not {other[:1] for other in others} & banned, ".".join(one)


@pytest.mark.parametrize("room", ["signal", "decision", "joint", "arm"])
def test_every_module_has_a_test_of_its_name(room):
    """In the same folder; with its own folder's name ahead, where another has the same name.

    Of a shelf only what every thing on it rests on is asked for: the things are tested together.
    """
    lacking = []
    for path in sorted((PACKAGE / room).rglob("*.py")):
        folder = path.parent.relative_to(PACKAGE)
        names = (f"test_{path.stem}.py", f"test_{folder.name}_{path.stem}.py")
        on_a_shelf = folder.as_posix() in SHELVES and path.stem not in ("base", "library", "user")
        tested = any((ROOT / "tests" / folder / name).exists() for name in names)
        if path.stem != "__init__" and not on_a_shelf and not tested:
            lacking.append(path.relative_to(PACKAGE).as_posix())
    assert lacking == []


def test_test_modules_have_names_of_their_own():
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert [a for a, b in combinations(sorted(names), 2) if a == b] == []
