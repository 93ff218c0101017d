"""The panel: measured joints and four kinds of simulated ones, the loop beside its plain rivals.

    python benchmarks/panel.py [--first-seed 50000] [--seeds 1] [--source measured,testbed]
        [--without-source NAME] [--contestants loop,plain,beam] [--sizes 0.6,1.5] [--effects none]
        [--strokes cyclic] [--sensing position] [--without RULE] [--jobs 1] [--limit 120]
        [--out benchmarks/out/panel.json] [--compare benchmarks/panel/departure.json]
    python benchmarks/panel.py --show benchmarks/out/panel.json

A row is a recording and what was hidden in it; every contestant closes it in a child of its own.
Each seals its own third or quarter of the motion, so both errors are given. Sources: measured,
testbed, smooth (the tests' simulator), algebraic, two-mass. Sizes, rates and strokes take turns
over effects and seeds; five seeds hold every effect at every size. One seed has some 140 rows.
`--compare` lays an earlier result of the same seeds beside this one as a further contestant.
"""

import argparse
import json
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

# One contestant has one core, or times could not be compared.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from panel import contestants, formulas, measured, run, table, testbed, two_mass_cases
from panel.case import SIZES, Case, Wanted

SOURCES: dict[str, Callable[[int, Wanted], Iterator[Case]]] = {
    "measured": measured.cases,
    "testbed": testbed.cases,
    "smooth": formulas.smooth_cases,
    "algebraic": formulas.algebraic_cases,
    "two-mass": two_mass_cases.cases,
}


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
    earlier = {
        (row["source"], row["name"], row["size"]): row["results"]
        for row in json.loads(file.read_text(encoding="utf-8"))["rows"]
    }
    for row in rows:
        for name, result in earlier.get((row["source"], row["name"], row["size"]), {}).items():
            if name == "loop":
                row["results"][f"{name} ({file.stem})"] = result
    return [f"loop ({file.stem})"]


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
    print(f"{len(rows)} rows, {time.time() - began:.0f} s")


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
