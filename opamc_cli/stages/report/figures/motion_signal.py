"""S(t) over one cycle of the baseline with its segments (thesis Figure 3-3)."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from opamc_cli.config.models import SegmentConfig
from opamc_cli.signal.motion.motion_signal import motion_frames
from opamc_cli.signal.motion.noise import noise_level
from opamc_cli.signal.transform.analytic import analytic_signal, clarke, temporal_fine_structure
from opamc_cli.stages.chain.segments.carrier import frame_step, motion_band
from opamc_cli.stages.processes.kept import remembered
from opamc_cli.stages.report.figures.figure import (
    MAX_TRACE_POINTS,
    Figure,
    canvas,
    finish,
    short,
    style,
)
from opamc_cli.stages.report.figures.palette import colour
from opamc_cli.stages.report.focus import Focus
from opamc_cli.stages.report.results.columns import Columns, extremes, n_rows, select
from opamc_cli.stages.report.results.inputs import NothingToDrawError, ReportInputs
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.sources import RunSource

MARGIN_S = 1.0
"""Shown before and after the cycle."""

MAX_WINDOWS = 6
"""Of a recording that never stands still."""


@dataclass(frozen=True)
class _Cycle:
    """All that the drawing depends on: the baseline alone, so that one serves many a night."""

    run: RunSource
    axis: int
    spans: Sequence[tuple[int, int]]
    """Samples of each segment, half-open."""
    numbers: Sequence[int]
    """With `spans`: of which motion each is."""
    windows: bool
    """Of a recording that never stands still."""
    reported: bool
    quantity: str
    config: SegmentConfig
    drawn_by: str
    """Version of matplotlib."""


def figure(inputs: ReportInputs, focus: Focus) -> Figure:
    """Draw the current and what the segments were found by, segments shaded."""
    baseline = inputs.roles["baseline"]
    motions = baseline.motions
    if motions is None:
        msg = "baseline/motions.parquet and segments.parquet are absent"
        raise NothingToDrawError(msg)
    rows = _one_cycle(select(motions, motions["axis"] == focus.axis))
    if not n_rows(rows):
        msg = f"the baseline has no segment on axis {focus.axis}"
        raise NothingToDrawError(msg)
    cycle = _Cycle(
        run=baseline.source_of(str(rows["run"][0])),
        axis=focus.axis,
        spans=tuple(zip(rows["start"].tolist(), rows["stop"].tolist(), strict=True)),
        numbers=tuple(map(int, rows.get("motion", range(n_rows(rows))))),
        windows=bool(rows["kind"][0] == "window"),
        reported=bool(rows["signal"][0] == "reported"),
        quantity=inputs.quantity,
        config=_segment_config(inputs),
        drawn_by=mpl.__version__,
    )
    return Figure(**remembered(_drawn, inputs.kept)(cycle))


def _drawn(cycle: _Cycle) -> dict[str, Any]:
    """Draw a cycle; the fields of a figure."""
    with cycle.run.open() as run, style():
        margin = round(MARGIN_S * run.sampling_rate_hz)
        start = max(0, min(first for first, _ in cycle.spans) - margin)
        stop = min(run.n_samples, max(last for _, last in cycle.spans) + margin)
        drawing = canvas(3.9)
        panels = drawing.subplots(2, 1, sharex=True)
        draw = _draw_reported if cycle.reported else _draw_phases
        caption = draw(panels, cycle, run, start, stop)
        for panel in panels:
            _shade(panel, cycle, run.sampling_rate_hz)
            panel.margins(x=0.0)
        _number(panels[0], cycle, run.sampling_rate_hz)
        panels[1].set_xlabel(f"time in run {short(run.name)} (s)")
        return asdict(
            finish(
                drawing,
                "motion-signal",
                f"Motion signal of axis {cycle.axis}",
                f"{caption} Shaded: {_what_is_shaded(cycle)}, with the number of their motion.",
                f"Current and motion signal of axis {cycle.axis} over one cycle of run {run.name} "
                f"with {len(cycle.spans)} segments.",
            )
        )


def _what_is_shaded(cycle: _Cycle) -> str:
    if cycle.windows:
        return "the windows into which a recording is cut that never stands still"
    return "the segments of one cycle"


def _one_cycle(rows: Columns) -> Columns:
    """Return the reference cycle, else the first cycle, else the first segments."""
    if not n_rows(rows):
        return rows
    if rows["kind"][0] == "window":
        rows = select(rows, rows["run"] == rows["run"][0])
        return {name: values[:MAX_WINDOWS] for name, values in rows.items()}
    if "reference" in rows and rows["reference"].any():
        rows = select(rows, rows["reference"].astype(bool))
    elif "cycle" in rows and (rows["cycle"] >= 0).any():
        first = int(np.flatnonzero(rows["cycle"] >= 0)[0])
        same = (rows["run"] == rows["run"][first]) & (rows["cycle"] == rows["cycle"][first])
        rows = select(rows, same)
    return select(rows, rows["run"] == rows["run"][0])


def _draw_phases(panels: Any, cycle: _Cycle, run: Run, start: int, stop: int) -> str:
    config = cycle.config
    phases = run.channels(cycle.axis).phases
    names = phases if len(phases) == 3 else phases[:1]
    read = run.read(names, start, stop)
    current = read[names[0]]
    vector = clarke(*(read[n] for n in names)) if len(names) == 3 else analytic_signal(current)
    vector = np.nan_to_num(vector)
    rate = run.sampling_rate_hz
    step = frame_step(rate)
    loudest_a = float(np.quantile(np.abs(vector), 0.95))
    tfs = temporal_fine_structure(vector, min(config.noise_floor * noise_level(vector), loudest_a))
    frames = motion_frames(tfs, motion_band(rate, config), rate, step, config.engine)
    _trace(panels[0], current, start / rate, 1.0 / rate, "muted")
    panels[0].set_ylabel(cycle.quantity)
    _trace(panels[1], frames.strength, start / rate, step / rate, "baseline")
    for threshold in (config.threshold_on, config.threshold_off):
        panels[1].axhline(threshold, color=colour("muted"), linewidth=0.7, dashes=(4, 3))
    panels[1].set_ylim(0.0, 1.08)
    panels[1].set_ylabel("S(t)")
    return (
        f"Above: current {names[0]}. Below: S(t), the largest modulus of the wavelet transform of "
        "its fine structure, near 1 while the joint turns. Dashed: what a motion has to reach "
        f"({config.threshold_on:g}) and may not fall below ({config.threshold_off:g})."
    )


def _segment_config(inputs: ReportInputs) -> SegmentConfig:
    recorded = inputs.roles["baseline"].config.get("segment", {})
    # a table of an older opamc may hold options that are gone
    known = {name: value for name, value in recorded.items() if name in SegmentConfig.model_fields}
    return SegmentConfig(**known)


def _draw_reported(panels: Any, cycle: _Cycle, run: Run, start: int, stop: int) -> str:
    channels = run.channels(cycle.axis)
    rate = run.sampling_rate_hz
    motion = channels.velocity or channels.position
    if channels.current is None or motion is None:
        msg = (
            f"run {run.name} has neither phase currents nor position or velocity of axis "
            f"{cycle.axis}"
        )
        raise NothingToDrawError(msg)
    read = run.read([channels.current, motion], start, stop)
    _trace(panels[0], read[channels.current], start / rate, 1.0 / rate, "muted")
    panels[0].set_ylabel(cycle.quantity)
    _trace(panels[1], read[motion], start / rate, 1.0 / rate, "baseline")
    panels[1].set_ylabel("speed (rad/s)" if channels.velocity else "angle (rad)")
    return "Above: reported current. Below: the joint's motion, by which the segments were found."


def _trace(
    panel: Axes, values: NDArray[np.floating], first_s: float, step_s: float, role: str
) -> None:
    x, y = extremes(first_s + step_s * np.arange(values.size), values, MAX_TRACE_POINTS)
    panel.plot(x, y, color=colour(role), linewidth=0.8)


def _shade(panel: Axes, cycle: _Cycle, rate: float) -> None:
    for start, stop in cycle.spans:
        panel.axvspan(start / rate, stop / rate, color=colour("baseline"), alpha=0.13, linewidth=0)


def _number(panel: Axes, cycle: _Cycle, rate: float) -> None:
    low, high = panel.get_ylim()
    panel.set_ylim(low, high + 0.15 * (high - low))
    for (start, stop), number in zip(cycle.spans, cycle.numbers, strict=True):
        middle = 0.5 * (start + stop) / rate
        panel.text(middle, high + 0.02 * (high - low), str(number), ha="center", fontweight="bold")
