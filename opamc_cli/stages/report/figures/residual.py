"""The model's residual before and after the loop: over time, angle and speed."""

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from opamc_cli.stages.report.figures.figure import Figure, canvas, finish, style
from opamc_cli.stages.report.figures.palette import colour
from opamc_cli.stages.report.results.columns import Columns, select
from opamc_cli.stages.report.results.inputs import NothingToDrawError, ReportInputs

N_STRETCHES = 400
N_BINS = 60
MIN_PER_BIN = 5

SERIES = (("before", "residual_before_a", "target"), ("after", "residual_after_a", "baseline"))


def figure(inputs: ReportInputs, axis: int) -> Figure:
    """Draw one axis's residual."""
    if inputs.residuals is None:
        msg = "residuals.parquet is absent"
        raise NothingToDrawError(msg)
    rows = select(inputs.residuals, inputs.residuals["axis"] == axis)
    if not rows["axis"].size:
        msg = f"residuals.parquet has no row of axis {axis}"
        raise NothingToDrawError(msg)
    with style():
        drawing = canvas(4.4)
        layout = drawing.add_gridspec(2, 2)
        over_time = drawing.add_subplot(layout[0, :])
        _over_time(over_time, rows, inputs.unit)
        for place, (column, label) in enumerate(
            (("position_rad", "joint angle (rad)"), ("velocity_rad_s", "joint speed (rad/s)"))
        ):
            panel = drawing.add_subplot(layout[1, place])
            _over_quantity(panel, rows, column, label, inputs.unit)
        handles, labels = over_time.get_legend_handles_labels()
        drawing.legend(handles, labels, loc="outside upper right", ncols=2)
        rms = {name: _rms(rows[column]) for name, column, _ in SERIES}
        over_time.set_title(
            f"Axis {axis} · RMS {rms['before']:.3g} {inputs.unit} before, "
            f"{rms['after']:.3g} {inputs.unit} after"
        )
        return finish(
            drawing,
            f"residual-{axis}",
            f"Residual of axis {axis} before and after",
            f"Measured less modelled {inputs.quantity.partition(' ')[0]} of the sealed "
            "recordings, with the declared effects (before) and with those that the loop added "
            "(after). Above: the range of every stretch of time, one recording after the other. "
            "Below: its RMS where the joint was and how fast it moved.",
            f"Residual of axis {axis}: RMS {rms['before']:.3g} {inputs.unit} before and "
            f"{rms['after']:.3g} {inputs.unit} after the loop, over time, joint angle and joint "
            "speed.",
        )


def _over_time(panel: Axes, rows: Columns, unit: str) -> None:
    size = -(-rows["time_s"].size // N_STRETCHES)
    for name, column, role in SERIES:
        low, high = _ranges(rows[column], size)
        middle = np.arange(low.size) * size
        time = _elapsed(rows["time_s"])[middle]
        panel.fill_between(
            time, low, high, color=colour(role), alpha=0.75, linewidth=0.3, label=name, step="mid"
        )
    panel.set_xlabel("recorded time, one recording after the other (s)")
    panel.set_ylabel(f"residual ({unit})")
    panel.margins(x=0.0)


def _elapsed(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Time with gaps and jumps back between recordings closed."""
    step = np.diff(time, prepend=time[:1])
    usual = float(np.median(step[1:])) if step.size > 1 else 0.0
    step[(step < 0) | (step > 10 * usual)] = usual
    return np.asarray(np.cumsum(step))


def _ranges(
    values: NDArray[np.float64], size: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    starts = np.arange(0, values.size, size)
    clean = np.nan_to_num(values)
    return np.minimum.reduceat(clean, starts), np.maximum.reduceat(clean, starts)


def _over_quantity(panel: Axes, rows: Columns, column: str, label: str, unit: str) -> None:
    x = rows[column].astype(np.float64)
    known = np.isfinite(x)
    panel.set_xlabel(label)
    panel.set_ylabel(f"RMS ({unit})")
    if np.unique(x[known]).size < 2:
        panel.text(0.5, 0.5, "not recorded", ha="center", transform=panel.transAxes)
        return
    low, high = np.quantile(x[known], [0.001, 0.999])
    edges = np.linspace(low, high, N_BINS + 1)
    # the last edge belongs to the last bin: a constant speed lies on it
    place = np.where(x == high, N_BINS - 1, np.digitize(x, edges) - 1)
    for _, residual, role in SERIES:
        values = rows[residual]
        usable = known & np.isfinite(values) & (place >= 0) & (place < N_BINS)
        count = np.bincount(place[usable], minlength=N_BINS)
        power = np.bincount(place[usable], values[usable] ** 2, minlength=N_BINS)
        rms = np.full(N_BINS, np.nan)
        enough = count >= MIN_PER_BIN
        rms[enough] = np.sqrt(power[enough] / count[enough])
        panel.plot(
            0.5 * (edges[1:] + edges[:-1]), rms, color=colour(role), marker=".", markersize=4
        )
    panel.set_ylim(bottom=0.0)


def _rms(values: NDArray[np.float64]) -> float:
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else float("nan")
