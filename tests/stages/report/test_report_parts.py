import itertools
import math
import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opamc_cli.stages.report.figures import partial_residuals
from opamc_cli.stages.report.figures.figure import canvas, style, to_svg
from opamc_cli.stages.report.figures.palette import PALETTE, colour
from opamc_cli.stages.report.onset import Onset, find_onset
from opamc_cli.stages.report.results.columns import extremes, to_columns
from opamc_cli.stages.report.results.inputs import ReportInputs, RoleTables, merged_config
from opamc_cli.stages.report.views import _since
from opamc_cli.stages.report.wording import verdict as verdict_words
from opamc_cli.stages.report.wording.numbers import cause_phrase, moment, number


@given(st.lists(st.floats(-1e3, 1e3) | st.just(math.nan), max_size=300), st.integers(4, 60))
def test_a_thinned_trace_keeps_its_extremes(values: list[float], most: int) -> None:
    y = np.array(values)
    x = np.arange(y.size, dtype=float)
    kept_x, kept_y = extremes(x, y, most)
    assert kept_x.size <= most or kept_x.size == y.size <= most
    assert (np.diff(kept_x) > 0).all()
    np.testing.assert_array_equal(kept_y, y[kept_x.astype(int)])
    if np.isfinite(y).any():
        assert np.nanmin(kept_y) == np.nanmin(y)
        assert np.nanmax(kept_y) == np.nanmax(y)


def slowly_thinned(x, y, max_points):
    """Thin a trace stretch by stretch."""
    if x.size <= max_points:
        return x, y
    size = -(-x.size // (max_points // 2))
    keep = []
    for start in range(0, x.size, size):
        part = y[start : start + size]
        found = {0}
        if np.isfinite(part).any():
            found = {int(np.nanargmin(part)), int(np.nanargmax(part))}
        keep += sorted(start + place for place in found)
    return x[keep], y[keep]


@given(
    st.lists(st.sampled_from([-1.0, 0.0, 0.0, 2.0, math.nan, math.inf, -math.inf]), max_size=90),
    st.integers(2, 40),
    st.sampled_from(["f4", "f8"]),
)
def test_a_trace_is_thinned_as_stretch_by_stretch(values: list[float], most: int, kind) -> None:
    y = np.array(values, dtype=kind)
    x = np.arange(y.size, dtype=float)
    for one, other in zip(extremes(x, y, most), slowly_thinned(x, y, most), strict=True):
        np.testing.assert_array_equal(one, other, strict=True)


def test_null_numbers_become_nan() -> None:
    table = pa.table({"n": pa.array([1, None]), "x": pa.array([None, None])})
    columns = to_columns(table)
    np.testing.assert_array_equal(columns["n"], [1.0, np.nan])
    np.testing.assert_array_equal(columns["x"], [np.nan, np.nan])


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (-0.00012345, "−0.000123"),
        (1.2e-7, "1.2e−7"),
        (123456.0, "1.23e5"),
        (None, "–"),
        (math.nan, "–"),
        (True, "–"),
    ],
)
def test_numbers_in_few_digits(value: object, text: str) -> None:
    assert number(value) == text


def test_the_headline_tells_which_joint_to_look_at_first() -> None:
    axes = [(1, "fault", 10.0, 0.1), (2, "fault", 20.0, 0.2), (3, "changed", 90.0, 0.01)]
    found = [
        {"axis": a, "state": s, "health_index": i, "distance": {"changed_a": c}}
        for a, s, i, c in axes
    ]
    said = verdict_words.headline({"axes": found})
    assert said == "Axes 1 and 2 at fault (axis 2: look there first); axis 3 changed"
    said = verdict_words.headline({"axes": found[1:]})
    assert said == "Axis 2 at fault (look there first); axis 3 changed"
    assert verdict_words.headline({"axes": found[2:]}) == "Axis 3 changed"


def test_since_when_is_answered_where_no_segment_tells_it():
    assert _since(Onset(0, 24, None, None, None)).startswith("Not known: ")


def test_the_headline_tells_the_worst_first() -> None:
    states = {1: "healthy", 2: "changed", 3: "fault", 4: "healthy", 5: "fault"}
    verdict = {"axes": [{"axis": axis, "state": state} for axis, state in states.items()]}
    said = "Axes 3 and 5 at fault (axis 5: look there first); axis 2 changed; the other 2 axes "
    assert verdict_words.headline(verdict) == said + "healthy"
    assert verdict_words.headline({"axes": []}) == "No axis was judged"


def test_a_cause_names_effect_order_meaning_and_share() -> None:
    cause = {
        "effect": "ripple",
        "parameters": {"speed": 1.0, "order": 2.02, "load": 0.0},
        "interpretation": "flexspline tooth damage",
        "share": 0.834,
    }
    assert cause_phrase(cause) == (
        "ripple (order 2.02, varies with speed): flexspline tooth damage; "
        "explains 83 % of the change"
    )
    assert cause_phrase(None) == "–"


def test_moments_are_utc_and_nonsense_is_left_alone() -> None:
    assert moment("2026-03-01T08:30:00+02:00") == "2026-03-01 06:30 UTC"
    assert moment("yesterday") == "yesterday"


def test_config_of_two_stages_is_merged_by_section() -> None:
    records = [
        {"config": {"identify": {"a": 1}, "patterns": {"envelope": "auto"}}},
        {"config": {"patterns": {"gamma": 2.0}}},
        {},
    ]
    assert merged_config(records) == {
        "identify": {"a": 1},
        "patterns": {"envelope": "auto", "gamma": 2.0},
    }


def _scores(rows: list[tuple[str, str, int, int, float]]) -> ReportInputs:
    names = ("role", "run", "cycle", "motion", "jsd")
    columns = {name: np.array([row[i] for row in rows]) for i, name in enumerate(names)}
    columns |= {"axis": np.ones(len(rows), int), "order": np.full(len(rows), 5)}
    empty = RoleTables(motions=None, patterns=None, sources=(), config={})
    return ReportInputs(columns, {}, None, {"baseline": empty, "target": empty}, None, None, None)


def test_onset_compares_each_motion_with_its_own_baseline() -> None:
    baseline = [("baseline", "n", 0, 0, 0.1), ("baseline", "n", 0, 1, 0.5)]
    target = [
        ("target", "b", 0, 0, 0.05),
        ("target", "b", 0, 1, 0.4),
        ("target", "b", 1, 0, 0.2),
        ("target", "b", 2, 1, 0.6),
        ("target", "b", 3, 2, 9.9),  # a motion that the baseline lacks tells nothing
    ]
    onset = find_onset(_scores(baseline + target), 1, 5)
    assert (onset.n_above, onset.n_target) == (2, 5)
    assert (onset.first_run, onset.first_cycle) == ("b", 1)
    quiet = find_onset(_scores(baseline + target[:2]), 1, 5)
    assert (quiet.n_above, quiet.first_run) == (0, None)


def test_figures_take_their_colours_from_the_page() -> None:
    with style():
        drawing = canvas(2.0)
        panel = drawing.add_subplot()
        panel.plot([0, 1], [0, 1], color=colour("target"), label="3.14159 $x$ <b>")
        panel.legend()
        svg = to_svg(drawing, "name")
    assert "var(--target)" in svg
    assert not any(light in svg for light, _ in PALETTE.values())
    assert "3.14159 $x$ &lt;b&gt;" in svg  # text keeps its digits, coordinates do not
    assert "http" not in svg


@pytest.mark.parametrize(("rows", "columns", "scale"), [(1, 1, 1.0), (2, 3, 1e-3), (3, 2, -1e7)])
def test_reckoned_margins_hold_what_matplotlib_measures(rows, columns, scale) -> None:
    with style():
        drawing = canvas(0.6 + 1.7 * rows)
        panels = list(drawing.subplots(rows, columns, squeeze=False).flat)
        for number, panel in enumerate(panels):
            panel.plot(scale * np.linspace(0, 1, 9), scale * np.arange(9.0), label="baseline")
            panel.set_title(f"Axis {number}")
            panel.set_xlabel("JSD")
            panel.set_ylabel("share")
        legend = drawing.legend(*panels[0].get_legend_handles_labels(), loc="outside upper right")
        drawing.draw_without_rendering()
        boxes = [legend.get_window_extent(), *(panel.get_tightbbox() for panel in panels)]
    for box in boxes:
        assert 0 <= box.x0 < box.x1 <= drawing.bbox.width
        assert 0 <= box.y0 < box.y1 <= drawing.bbox.height
    for one, other in itertools.combinations(boxes, 2):
        assert not one.overlaps(other)


@pytest.mark.long
@pytest.mark.parametrize(("backend", "listed"), [("agg", False), ("svg", True)])
def test_matplotlibs_own_documentation_is_left_out_by_the_command_alone(
    backend: str, listed: bool
) -> None:
    program = (
        "from opamc_cli.stages.report.figures.loading import undocumented\n"
        "with undocumented():\n"
        "    from opamc_cli.stages.report.figures import shown\n"
        "from matplotlib import artist, lines\n"
        "drawn = lines.Line2D([0], [0])\n"
        "drawn.set(lw=3)\n"
        "listed = 'zorder: float' in str(lines.Line2D.set.__doc__)\n"
        "class Later(lines.Line2D): pass\n"  # made afterwards, as by a notebook: documented
        "print(listed, drawn.get_linewidth(), 'zorder: float' in artist.kwdoc(Later))"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "MPLBACKEND": backend},
    )
    assert ended.stdout.split() == [str(listed), "3.0", "True"]


def test_colours_differ_and_are_read_on_their_page() -> None:
    for page, index in (("light", 0), ("dark", 1)):
        paper = _luminance(PALETTE["paper"][index])
        for role in ("ink", "muted", "baseline", "target", "healthy", "changed", "fault"):
            mine = _luminance(PALETTE[role][index])
            contrast = (max(mine, paper) + 0.05) / (min(mine, paper) + 0.05)
            assert contrast >= 4.5, (page, role, contrast)
    # one colour stands for one role, or the page could not tell which one to put in
    assert len({light for light, _ in PALETTE.values()}) == len(PALETTE)


def _luminance(hexadecimal: str) -> float:
    """Relative luminance of WCAG 2.1."""
    parts = [int(hexadecimal[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


@pytest.mark.parametrize("count", [1, 2, 3, 5, 6])
def test_each_added_effect_has_a_panel_and_nothing_else_has(count):
    curve = {"covariate": "speed", "unit": "rad/s"}
    curve |= {key: [0.0, 1.0, 2.0] for key in ("x", "residual_a", "named_a")}
    steps = [{"effect": "stribeck", "parameters": {}, "curve": curve}] * count
    inputs = SimpleNamespace(unit="A", loop_axis=lambda axis: {"steps": steps})
    drawn = partial_residuals.figure(inputs, 1)
    assert drawn.svg.count(">speed (rad/s)<") == count
    assert drawn.svg.count("<clipPath") == count


def test_a_likely_cause_is_told_in_words_without_what_nobody_needs():
    """It was "..., by sublinear_friction; 0% remains unexplained; ... from thermal_viscous"."""
    cause = {"effect": "sublinear_friction", "interpretation": "friction: check grease"}
    told = verdict_words.likely_cause({"cause": cause | {"explained": 1.0, "ties": ["coulomb"]}})
    assert told == [
        "Friction",
        "explains 100% of the change",
        "the recordings cannot tell it from dry friction of bearings and seals",
    ]
