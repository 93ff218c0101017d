"""Tables of the panel, in Markdown."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from panel.run import Row

MARGIN = 1.05
"""How far the loop may be behind the best of the others."""


def line(row: Row, names: Sequence[str]) -> str:
    """One row, every contestant in a column."""
    size = "" if row["size"] is None else f"{row['size']:g}"
    cells = [cell(row["results"].get(name, {})) for name in names]
    start = f"| {row['source']} | {row['name']} | {row['sensing']} | {size} | "
    return start + " | ".join(cells) + " |"


def head(names: Sequence[str]) -> str:
    """Head of the rows' table."""
    titles = ["source", "case", "logged", "size", *names]
    return "| " + " | ".join(titles) + " |\n" + "|---" * len(titles) + "|"


def cell(result: dict) -> str:
    """Error before and after, what was added, verdict, time."""
    if not result:
        return ""
    if "error" in result:
        return result["error"].replace("|", "/")
    added = [
        ("**" + step["name"] + "**" if step["name"] in result.get("wrong", ()) else step["name"])
        + "".join(f" ~{tie}" for tie in step["ties"])
        for step in result["added"]
    ]
    said = f" {result['verdict']}" if result["verdict"] else ""
    return (
        f"{result['before']:.4f} → {result['after']:.4f} {', '.join(added)}{said}, "
        f"{result['seconds']:.1f} s"
    )


def summary(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Figures of each source, what was logged and contestant."""
    lines = [
        "| source | stroke | logged | contestant | rows | failed | error after / before | named "
        "| wrong | added where nothing lacks | over 5 % behind: error, share | longest, s "
        "| peak, MB |",
        "|---" * 13 + "|",
    ]
    groups: dict[tuple[str, ...], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["source"], row["stroke"], row["sensing"]].append(row)
    for key, group in groups.items():
        for name in names:
            lines.append(f"| {' | '.join(key)} | {name} | " + _figures(group, name) + " |")
    return "\n".join(lines)


def by_size(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Share of hidden effects that are named, by source and size."""
    sizes = sorted({row["size"] for row in rows if row["size"] is not None})
    lines = [
        "| source | logged | contestant | "
        + " | ".join(f"{size:g} × noise" for size in sizes)
        + " |",
        "|---" * (3 + len(sizes)) + "|",
    ]
    sized = [row for row in rows if row["hidden"] and row["size"] is not None]
    keys = dict.fromkeys((row["source"], row["sensing"]) for row in sized)
    for source, sensing in keys:
        for name in names:
            cells = []
            for size in sizes:
                found = [
                    bool(row["results"].get(name, {}).get("named"))
                    for row in rows
                    if (row["source"], row["sensing"], row["size"]) == (source, sensing, size)
                ]
                cells.append(f"{sum(found)} of {len(found)}")
            lines.append(f"| {source} | {sensing} | {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def totals(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Sum sealed errors where nobody knows a right name, by source, over rows that all served."""
    lines = []
    for source in dict.fromkeys(row["source"] for row in rows if row["hidden"] is None):
        errors = [
            [row["results"].get(name, {}).get("after") for name in names]
            for row in rows
            if row["source"] == source
        ]
        served = [row for row in errors if None not in row]
        if served:
            sums = ", ".join(
                f"{name} {sum(column):.3f}"
                for name, column in zip(names, zip(*served, strict=True), strict=True)
            )
            summed = f"Sealed errors summed over {len(served)} of {len(errors)} rows"
            lines.append(f"{summed} of {source}, A: {sums}.")
    return "\n\n".join(lines)


def behind(row: Row, name: str, *, share: bool) -> bool:
    """Tell whether a sealed error, or what is left of it, is over 5 % above the best of the others.

    Everyone seals other samples and smooths another way, so neither measure alone is fair: errors
    of different samples differ, and who begins with the better motion has less to gain.
    """
    reached = {
        other: result["after"] / (max(result["before"], 1e-9) if share else 1.0)
        for other, result in row["results"].items()
        if "after" in result
    }
    own = reached.pop(name, np.inf)
    return bool(own > MARGIN * min(reached.values(), default=np.inf))


def _figures(group: Sequence[Row], name: str) -> str:
    results = [row["results"].get(name, {}) for row in group]
    done = [r for r in results if "after" in r]
    if not done:
        return " | ".join([str(len(group)), str(len(group)), *["–"] * 7])
    late = [sum(behind(row, name, share=share) for row in group) for share in (False, True)]
    ratios = [max(r["after"], 1e-9) / max(r["before"], 1e-9) for r in done]
    asked = [(row, r) for row, r in zip(group, results, strict=True) if row["hidden"]]
    empty = [
        r for row, r in zip(group, results, strict=True)
        if row["hidden"] == "" and not row["present"] and "after" in r
    ]  # fmt: skip
    wrong = sum(len(r.get("wrong", ())) for r in done)
    named = sum(bool(r.get("named")) for _, r in asked)
    cells = [
        str(len(group)),
        str(len(group) - len(done)),
        f"{np.exp(np.mean(np.log(ratios))):.2f}",
        f"{named} of {len(asked)}" if asked else "–",
        str(wrong) if group[0]["hidden"] is not None else "–",
        f"{sum(bool(r['added']) for r in empty)} of {len(empty)}" if empty else "–",
        f"{late[0]}, {late[1]}",
        f"{max(r['seconds'] for r in done):.0f}",
        f"{max(r['peak_mb'] for r in done):.0f}",
    ]
    return " | ".join(cells)
