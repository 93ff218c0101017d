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


def errors(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Table of rows' errors before and after, and how many effects were added."""
    lines = [f"| source | case | {' | '.join(names)} |", "|---" * (2 + len(names)) + "|"]
    for row in rows:
        cells = []
        for name in names:
            result = row["results"].get(name, {})
            if "after" in result:
                text = f"{result['before']:.4f} → {result['after']:.4f} ({len(result['added'])})"
            else:
                text = result.get("error", "").replace("|", "/")
            cells.append(text)
        lines.append(f"| {row['source']} | {row['name']} | {' | '.join(cells)} |")
    return "\n".join(lines)


def summary(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Figures of each source and what was logged, the contestants' side by side."""
    lines = [
        "| source | stroke | logged | rows | failed | error after / before | named | wrong "
        "| added where nothing lacks | over 5 % behind: error | share | longest, s | peak, MB |",
        "|---" * 13 + "|",
    ]
    groups: dict[tuple[str, ...], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["source"], row["stroke"], row["sensing"]].append(row)
    for key, group in groups.items():
        columns = zip(*(_figures(group, name) for name in names), strict=True)
        cells = [_beside(column) for column in columns]
        lines.append(f"| {' | '.join(key)} | {len(group)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _beside(cells: Sequence[str]) -> str:
    """Join the contestants' figures; what all share (`3 of 5, 4 of 5`) is said once."""
    parts = [each.split(" of ") for each in cells if each != "–"]
    if not parts:
        return "–"
    if len({tuple(part[1:]) for part in parts}) > 1:
        return ", ".join(cells)
    counts = ", ".join(each.split(" of ")[0] for each in cells)
    return " of ".join([counts, *parts[0][1:]])


def by_size(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Share of hidden effects that are named, by source and size."""
    sizes = sorted({row["size"] for row in rows if row["size"] is not None})
    lines = [
        "| source | logged | " + " | ".join(f"{size:g} × noise" for size in sizes) + " |",
        "|---" * (2 + len(sizes)) + "|",
    ]
    sized = [row for row in rows if row["hidden"] and row["size"] is not None]
    keys = dict.fromkeys((row["source"], row["sensing"]) for row in sized)
    for source, sensing in keys:
        cells = []
        for size in sizes:
            of_size = [
                row["results"]
                for row in rows
                if (row["source"], row["sensing"], row["size"]) == (source, sensing, size)
            ]
            found = [
                sum(bool(each.get(name, {}).get("named")) for each in of_size) for name in names
            ]
            cells.append(_beside([f"{count} of {len(of_size)}" for count in found]))
        lines.append(f"| {source} | {sensing} | {' | '.join(cells)} |")
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


def _figures(group: Sequence[Row], name: str) -> list[str]:
    results = [row["results"].get(name, {}) for row in group]
    done = [r for r in results if "after" in r]
    if not done:
        return [str(len(group)), *["–"] * 8]
    late = [sum(behind(row, name, share=share) for row in group) for share in (False, True)]
    ratios = [max(r["after"], 1e-9) / max(r["before"], 1e-9) for r in done]
    asked = [(row, r) for row, r in zip(group, results, strict=True) if row["hidden"]]
    empty = [
        r for row, r in zip(group, results, strict=True)
        if row["hidden"] == "" and not row["present"] and "after" in r
    ]  # fmt: skip
    wrong = sum(len(r.get("wrong", ())) for r in done)
    named = sum(bool(r.get("named")) for _, r in asked)
    return [
        str(len(group) - len(done)),
        f"{np.exp(np.mean(np.log(ratios))):.2f}",
        f"{named} of {len(asked)}" if asked else "–",
        str(wrong) if group[0]["hidden"] is not None else "–",
        f"{sum(bool(r['added']) for r in empty)} of {len(empty)}" if empty else "–",
        str(late[0]),
        str(late[1]),
        f"{max(r['seconds'] for r in done):.0f}",
        f"{max(r['peak_mb'] for r in done):.0f}",
    ]
