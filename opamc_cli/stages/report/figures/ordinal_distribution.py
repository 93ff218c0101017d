"""Ordinal pattern distributions of baseline and target side by side (thesis Figure 4-7)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from opamc_cli.signal.ordinal.patterns import pattern_of_code
from opamc_cli.stages.report.figures.figure import Figure, canvas, finish, style
from opamc_cli.stages.report.figures.palette import colour
from opamc_cli.stages.report.focus import Focus, axis_scores, by_severity
from opamc_cli.stages.report.results.columns import select
from opamc_cli.stages.report.results.inputs import ROLES, NothingToDrawError, ReportInputs

MAX_AXES = 8
N_NAMED = 3
"""Patterns that the caption spells out."""


def figure(inputs: ReportInputs, focus: Focus) -> Figure:
    """Draw both distributions of each axis's most changed motion."""
    for role in ROLES:
        if inputs.roles[role].patterns is None:
            msg = f"{role}/patterns.parquet is absent"
            raise NothingToDrawError(msg)
    drawn = []
    scored = [axis for axis in by_severity(inputs) if axis in inputs.axes]
    for axis in sorted(scored[:MAX_AXES]):
        baseline, target = (_share(inputs, role, axis, focus) for role in ROLES)
        if baseline is not None and target is not None:
            drawn.append((axis, baseline, target))
    if not drawn:
        msg = "no motion has patterns in both baseline and target"
        raise NothingToDrawError(msg)
    with style():
        drawing = canvas(0.45 + 1.05 * len(drawn))
        panels = drawing.subplots(
            len(drawn),
            2,
            sharex="col" if _same_order(drawn) else "none",
            sharey="row",
            squeeze=False,
        )
        for row, (axis, baseline, target) in zip(panels, drawn, strict=True):
            for panel, role, share in zip(row, ROLES, (baseline, target), strict=True):
                edges = np.arange(share.size + 1) - 0.5
                panel.stairs(share, edges, fill=True, color=colour(role))
                panel.axhline(1.0 / share.size, color=colour("muted"), linewidth=0.7, dashes=(3, 3))
                panel.set_xlim(edges[0], edges[-1])
                panel.grid(visible=False, axis="x")
                jsd = axis_scores(inputs, axis, focus.order[axis], role, focus.motion[axis])["jsd"]
                mean = f" · mean JSD {jsd.mean():.3f}" if jsd.size else ""
                panel.set_title(f"Axis {axis}, motion {focus.motion[axis]}, {role}{mean}")
            row[0].set_ylabel("share")
        for panel in panels[-1]:
            panel.set_xlabel("ordinal pattern (code)")
        worst = next((d for d in drawn if d[0] == focus.axis), drawn[0])
        return finish(
            drawing,
            "ordinal-distribution",
            "Ordinal patterns of the envelope",
            "Share of each pattern in the motion that changed most, pooled over its segments; the "
            f"dashed line is what noise without memory would give. {_largest_changes(*worst)}",
            f"Bar charts of ordinal pattern shares, baseline left and target right, for "
            f"{len(drawn)} axes. {_largest_changes(*worst)}",
        )


def _same_order(drawn: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]]) -> bool:
    return len({share.size for _, share, _ in drawn}) == 1


def _share(inputs: ReportInputs, role: str, axis: int, focus: Focus) -> NDArray[np.float64] | None:
    table = inputs.roles[role].patterns or {}
    rows = select(
        table,
        (table["axis"] == axis)
        & (table["motion"] == focus.motion[axis])
        & (table["order"] == focus.order[axis]),
    )
    counts: Sequence[NDArray[np.int64]] = [c for c in rows["counts"] if c is not None]
    if not counts:
        return None
    pooled = np.sum(np.stack(counts), axis=0).astype(np.float64)
    total = float(pooled.sum())
    return pooled / total if total > 0 else None


def _largest_changes(axis: int, baseline: NDArray[np.float64], target: NDArray[np.float64]) -> str:
    order = next(n for n in range(2, 9) if np.prod(range(1, n + 1)) == baseline.size)
    change = target - baseline
    codes = np.argsort(-np.abs(change), kind="stable")[:N_NAMED]
    named = [
        f"{pattern_of_code(int(code), order)} {100 * baseline[code]:.1f} % → "
        f"{100 * target[code]:.1f} %".replace(" ", "\u00a0")
        for code in codes
    ]
    return f"Largest changes on axis {axis}: {', '.join(named)}."
