"""The panel: measured and simulated joints, the loop beside its plain rivals.

    python benchmarks/panel.py [--first-seed 50000] [--seeds 1] [--source measured,testbed]
        [--without-source NAME] [--contestants loop,plain,beam] [--sizes 0.6,1.5] [--effects none]
        [--strokes cyclic] [--sensing position] [--without RULE] [--jobs 1] [--limit 120]
        [--out benchmarks/out/panel.json] [--compare benchmarks/panel/departure.json]
    python benchmarks/panel.py --show benchmarks/out/panel.json [--keep FILE] [--write]

A row is a recording and what was hidden in it; every contestant closes it in a child of its own.
Each seals other parts of the motion, so both errors are given. Sources: measured, actuator,
testbed, smooth (the tests' simulator), algebraic, two-mass, arm (another joint moves beside), cobot
(coupled links and elastic gears, every effect in one size), servo (an industrial drive, logged
slowly), grafted (measured joints with an effect added to their current), and messy, of whose joints
nobody knows what they lack. Sizes, rates and strokes take turns over effects and seeds; five seeds
hold every effect at every size. One seed has some 240 rows.
`--compare` lays an earlier result of the same seeds beside this one as a further contestant.
"""

import argparse
import json
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

# One contestant has one core, or times could not be compared.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from panel import (
    arm,
    cobot,
    contestants,
    formulas,
    grafted,
    measured,
    messy,
    run,
    servo,
    table,
    testbed,
    two_mass_cases,
)
from panel.case import SIZES, Case, Wanted

SOURCES: dict[str, Callable[[int, Wanted], Iterator[Case]]] = {
    "measured": measured.cases,
    "actuator": measured.actuator_cases,
    "testbed": testbed.cases,
    "smooth": formulas.smooth_cases,
    "algebraic": formulas.algebraic_cases,
    "two-mass": two_mass_cases.cases,
    "messy": messy.cases,
    "arm": arm.cases,
    "cobot": cobot.cases,
    "servo": servo.cases,
    "grafted": grafted.cases,
}
MEASURED = ("measured", "actuator")


BEGIN, END = "<!-- panel: begin -->", "<!-- panel: end -->"


def listed(text: str) -> tuple[str, ...]:
    """Split at commas."""
    return tuple(part for part in text.split(",") if part)


def all_cases(arguments: argparse.Namespace) -> Iterator[Case]:
    """Cases of the chosen sources and seeds; measured ones once."""
    wanted = Wanted(
        tuple(float(size) for size in listed(arguments.sizes)),
        listed(arguments.effects),
        listed(arguments.strokes),
        listed(arguments.sensing),
    )
    sources = listed(arguments.source) or tuple(SOURCES)
    for name in sources:
        if name in listed(arguments.without_source):
            continue
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
            if name != "measured" or seed == arguments.first_seed:
                yield from wanted.chosen(SOURCES[name](seed, wanted))


def compared(rows: list[run.Row], file: Path) -> list[str]:
    """Lay earlier results beside these rows, where source and name agree; return their names."""

    def key(row: run.Row) -> tuple[Any, ...]:
        return tuple(row[part] for part in ("source", "stroke", "sensing", "name", "size"))

    kept = json.loads(file.read_text(encoding="utf-8"))["rows"]
    earlier = {key(row): row["results"] for row in kept}
    for row in rows:
        for name, result in earlier.get(key(row), {}).items():
            if name == "loop":
                row["results"][f"{name} ({file.stem})"] = result
    return [f"loop ({file.stem})"]


def keep(file: Path, rows: list[run.Row], names: list[str]) -> None:
    """Write a row per line, without parameters, numbers to four digits."""

    def short(value: Any) -> Any:
        if isinstance(value, float):
            return float(f"{value:.4g}")
        if isinstance(value, dict):
            return {key: short(part) for key, part in value.items() if key != "parameters"}
        return [short(part) for part in value] if isinstance(value, list) else value

    lines = ",\n".join(json.dumps(short(row), ensure_ascii=False) for row in rows)
    start = json.dumps({"contestants": names})[:-1]
    file.write_text(f'{start}, "rows": [\n{lines}\n]}}\n', encoding="utf-8")


def document(rows: list[run.Row], names: list[str]) -> None:
    """Put measured joints row by row, and the rest in sums, into docs/validation/loop.md."""
    path = Path(__file__).parents[1] / "docs" / "validation" / "loop.md"
    before, rest = path.read_text(encoding="utf-8").split(BEGIN)
    measured_rows = [row for row in rows if row["source"] in MEASURED]
    section = [table.errors(measured_rows, names), "", table.totals(rows, names), "",
               table.summary(rows, names), "", table.by_size(rows, names)]  # fmt: skip
    path.write_text(
        before + "\n".join([BEGIN, "", *section, "", END]) + rest.split(END)[1], encoding="utf-8"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--first-seed", type=int, default=50000)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--source", default="", help=f"of {', '.join(SOURCES)}")
    parser.add_argument("--without-source", default="")
    parser.add_argument("--contestants", default=",".join(contestants.ALL))
    parser.add_argument("--sizes", default=",".join(f"{size:g}" for size in SIZES))
    parser.add_argument("--effects", default="", help="names; none stands for nothing hidden")
    parser.add_argument("--strokes", default="")
    parser.add_argument("--sensing", default="")
    parser.add_argument("--without", default="", help="rules of the loop to do without")
    parser.add_argument("--limit", type=float, default=120.0, help="seconds per contestant and row")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "out" / "panel.json")
    parser.add_argument("--compare", type=Path, help="an earlier JSON of the same seeds")
    parser.add_argument("--show", type=Path, help="print the tables of a JSON, run nothing")
    parser.add_argument("--keep", type=Path, help="write the rows shortened, to stay as a JSON")
    parser.add_argument("--write", action="store_true", help="update docs/validation/loop.md")
    parser.add_argument("--list", action="store_true", help="print the cases, run nothing")
    arguments = parser.parse_args()
    names = list(listed(arguments.contestants))
    rows: list[run.Row] = []
    began = time.time()
    if arguments.show:
        kept = json.loads(arguments.show.read_text(encoding="utf-8"))
        rows, names = kept["rows"], kept["contestants"]
    elif arguments.list:
        for case in all_cases(arguments):
            print(f"{case.source} | {case.name} | {case.sensing} | {case.size} | {case.declared}")
        return
    else:
        print(table.head(names))
        options = {"limit_s": arguments.limit, "jobs": arguments.jobs}
        for row in run.rows(all_cases(arguments), names, listed(arguments.without), **options):
            rows.append(row)
            print(table.line(row, names), flush=True)
            write(arguments, rows, names)
    if arguments.compare:
        names += compared(rows, arguments.compare)
    if arguments.show or arguments.compare:
        print(table.head(names), *(table.line(row, names) for row in rows), sep="\n")
    print(f"\n{table.summary(rows, names)}\n\n{table.by_size(rows, names)}\n")
    print(table.totals(rows, names))
    print(f"{len(rows)} rows, {time.time() - began:.0f} s")
    if arguments.keep:
        keep(arguments.keep, rows, names)
    if arguments.write:
        document(rows, names)


def write(arguments: argparse.Namespace, rows: list[run.Row], names: list[str]) -> None:
    """Keep what there is so far."""
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    kept = {
        "first_seed": arguments.first_seed,
        "seeds": arguments.seeds,
        "without": arguments.without,
        "contestants": names,
        "rows": rows,
    }
    temporary = arguments.out.with_suffix(".part")
    temporary.write_text(json.dumps(kept, default=float), encoding="utf-8")
    temporary.replace(arguments.out)


if __name__ == "__main__":
    main()
