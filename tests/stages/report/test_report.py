import json
import re
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import output_folder
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from output_folder import Plan

from opamc_cli.errors import InputError
from opamc_cli.stages.report import assemble as report
from opamc_cli.stages.report.figures import shown

VOID = {"meta", "link", "br", "img", "hr", "input", "path", "use", "rect"}
FIGURES = {
    "jsd-scatter",
    "jsd-histogram",
    "ordinal-distribution",
    "envelopes",
    "feature-space",
    "latent-axis",
    "motion-signal",
    "similarity",
    "partial-residuals-3",
    "residual-3",
    "order-spectrum-3",
}


class _Page(HTMLParser):
    """Checks that tags are balanced and collects what the tests look at."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    def figures(self) -> set[str | None]:
        return {attrs.get("id") for tag, attrs in self.tags if tag == "figure"}

    def words(self) -> str:
        return " ".join(" ".join(self.text).split())


@pytest.fixture
def drawn_alone(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Draw those figures alone that a test asks for: a whole report takes four seconds."""

    def draw(*names: str) -> None:
        for section in ("EVIDENCE", "LOOP"):
            chosen = tuple(part for part in getattr(shown, section) if part[0] in names)
            monkeypatch.setattr(shown, section, chosen)

    return draw


def test_every_figure_is_drawn(made: Path, page: str) -> None:
    assert _Page(page).figures() == FIGURES
    assert json.loads((made.parent / "omitted.json").read_text()) == []


@pytest.mark.long
def test_the_same_inputs_give_the_same_page_under_any_matplotlibrc(folder: Path, page: str) -> None:
    import matplotlib as mpl

    with mpl.rc_context({"lines.linewidth": 9.0, "font.size": 30.0, "svg.fonttype": "path"}):
        assert report.run(folder).path.read_text(encoding="utf-8") == page


def test_nothing_is_loaded_from_elsewhere(page: str) -> None:
    for tag, attrs in _Page(page).tags:
        assert tag not in {"script", "link", "iframe", "img", "object"}
        assert not {name for name in attrs if name in {"src", "data", "action"}}
        assert not {name for name in attrs if name.startswith("on")}
        if "href" in attrs:
            assert (attrs["href"] or "").startswith("#")
    assert "http" not in page
    assert "@import" not in page
    assert len(page.encode()) < 2_000_000


def test_every_reference_inside_a_figure_has_its_target(page: str) -> None:
    parsed = _Page(page)
    ids = [attrs["id"] for _, attrs in parsed.tags if "id" in attrs]
    assert len(ids) == len(set(ids))
    used = {(attrs["href"] or "")[1:] for _, attrs in parsed.tags if "href" in attrs}
    used |= set(re.findall(r"url\(#([^)]+)\)", page))
    assert used <= set(ids)


def test_every_figure_says_what_it_shows(page: str) -> None:
    plots = [attrs for _, attrs in _Page(page).tags if attrs.get("class") == "plot"]
    assert len(plots) == len(FIGURES)
    assert all(attrs.get("role") == "img" and attrs.get("aria-label") for attrs in plots)


def test_the_verdict_comes_first_and_says_where_why_and_what_to_do(page: str) -> None:
    words = _Page(page).words()
    expected = [
        "Axis 3 at fault; the other 2 axes healthy",
        "Inspect first Look for flexspline tooth damage",
        "Likely cause Flexspline tooth damage",
        "explains 83% of the change; 17% remains unexplained",
        "How sure By chance: less than 1 in 10 000, all joints considered",
        "Since when 24 of 24 target segments",
        "the first in run fault-0 (begun 2026-03-10 06:00 UTC), cycle 0",
        "order 5: mean divergence 0.31",
        "Divergence of every segment",
        "What the model of axis 3 lacked",
        "Gain: what the effect takes off the squared error of data left out of the fit",
        "Provenance",
    ]
    places = [
        words.index(text, words.index("</style>") if "</style>" in words else 0)
        for text in expected
    ]
    assert places == sorted(places)


def test_provenance_holds_every_input(made: Path, page: str) -> None:
    from opamc_cli.storage.runs.hashes import file_sha256

    runs = made.parent.rglob("run*.parquet")
    for path in [*made.rglob("*.parquet"), *made.rglob("*.json"), *runs]:
        assert file_sha256(path) in page
    assert str(made) not in page


@pytest.mark.long
def test_names_from_files_stay_text(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    evil = '<script>alert("x")</script>$x_1$&機械' + "x" * 200
    output_folder.make(out, Plan(names=("normal", evil)))
    verdict = json.loads((out / "verdict.json").read_text())
    verdict["axes"][2]["reasons"] = ["<img src=x onerror=alert(1)>"]
    verdict["axes"][2]["reasons"] += ['"><svg onload=alert(1)>']
    (out / "verdict.json").write_text(json.dumps(verdict))
    text = report.run(out, title="<b>cell</b>").path.read_text(encoding="utf-8")
    tags = [tag for tag, _ in _Page(text).tags]
    assert not {"script", "img", "b"} & set(tags)
    assert tags.count("svg") == text.count("<svg viewBox")
    assert "&lt;script&gt;" in text


def test_what_is_absent_is_left_out_with_a_reason(folder: Path) -> None:
    for path in [
        "verdict.json",
        "loop.json",
        "baseline/motions.parquet",
        "target/patterns.parquet",
    ]:
        (folder / path).unlink()
    outcome = report.run(folder)
    text = outcome.path.read_text(encoding="utf-8")
    assert _Page(text).figures() == {"jsd-scatter", "jsd-histogram", "feature-space"}
    assert len(outcome.omitted) == 7
    for line in outcome.omitted:
        assert ": " in line
    assert "verdict.json is absent" in text


@pytest.mark.long
def test_runs_that_were_moved_are_found_again(
    folder: Path, drawn_alone: Callable[..., None]
) -> None:
    drawn_alone("envelope", "motion signal")
    (folder.parent / "baseline").rename(folder.parent / "old")
    reasons = " ".join(report.run(folder).omitted)
    assert "the samples of run normal-0 are not there" in reasons
    moved = folder.parent / "old"
    assert report.run(folder, baseline=[moved]).omitted == ()
    assert report.run(folder, baseline=[moved / "run0.parquet"]).omitted == ()


@pytest.mark.parametrize("name", ["scores.parquet", "features.parquet"])
def test_scores_and_features_are_needed(folder: Path, name: str) -> None:
    (folder / name).unlink()
    (folder / "report.html").unlink(missing_ok=True)
    with pytest.raises(InputError, match=f"{name}: no such file; run `opamc score` first"):
        report.run(folder)
    assert not (folder / "report.html").exists()


@pytest.mark.parametrize("name", ["verdict.json", "loop.json"])
def test_damaged_json_is_named(folder: Path, name: str) -> None:
    (folder / name).write_text('{"axes": [{"axis"')
    with pytest.raises(InputError, match=f"{name}: cannot be read as JSON"):
        report.run(folder)
    (folder / name).write_text('{"axes": 3}')
    with pytest.raises(InputError, match=f"{name}: holds no list 'axes'"):
        report.run(folder)


def test_a_table_without_a_needed_column_is_named(folder: Path) -> None:
    path = folder / "order_spectrum.parquet"
    table = pq.read_table(path)
    pq.write_table(table.drop_columns(["after_a"]), path)
    with pytest.raises(InputError, match="column after_a is missing"):
        report.run(folder)


@pytest.mark.long
def test_one_healthy_axis_alone_with_reported_current(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    plan = Plan(n_axes=1, n_runs=1, n_cycles=2, faulty=None, signal="reported")
    output_folder.make(out, plan)
    text = report.run(out).path.read_text(encoding="utf-8")
    assert {"motion-signal", "envelopes"} <= _Page(text).figures()
    assert "speed (rad/s)" in text
    assert "Axis 1 healthy" in _Page(text).words()
    assert 'class="card' not in text


@pytest.mark.long
def test_a_trained_discriminant_takes_the_place_of_the_health_index(
    folder: Path, drawn_alone: Callable[..., None]
) -> None:
    drawn_alone("latent axis")
    path = folder / "features.parquet"
    table = pq.read_table(path)
    place = table.column_names.index("lda")
    values = pa.array([float(axis) - 2.5 for axis in table["axis"].to_pylist()])
    pq.write_table(table.set_column(place, "lda", values), path)
    words = _Page(report.run(folder).path.read_text(encoding="utf-8")).words()
    assert "Latent axis The three features projected" in words
    assert "discriminant (unit: within-class standard deviations)" in words


@pytest.mark.long
def test_an_axis_without_scores_is_named_all_the_same(folder: Path) -> None:
    (folder / "loop.json").unlink()
    verdict = json.loads((folder / "verdict.json").read_text())
    missing = {"axis": 9, "state": "insufficient-data", "reasons": ["it never moves"]}
    verdict["axes"].append(missing)
    (folder / "verdict.json").write_text(json.dumps(verdict))
    words = _Page(report.run(folder).path.read_text(encoding="utf-8")).words()
    assert "axis 9 not judged" in words
    assert "it never moves" in words


@pytest.mark.long
def test_numbers_that_are_not_known_are_dashes(folder: Path) -> None:
    (folder / "loop.json").unlink()
    verdict = json.loads((folder / "verdict.json").read_text())
    for entry in verdict["axes"]:
        entry |= {"health_index": None, "p_value": None, "motions": []}
        entry["features"] = dict.fromkeys(("delta_mu", "delta_var", "ks"))
    (folder / "verdict.json").write_text(json.dumps(verdict))
    for name, columns in (("features", ("delta_mu", "delta_var", "ks")), ("scores", ("jsd",))):
        path = folder / f"{name}.parquet"
        table = pq.read_table(path)
        for column in columns:
            place = table.column_names.index(column)
            table = table.set_column(place, column, pa.nulls(table.num_rows, pa.float64()))
        pq.write_table(table, path)
    outcome = report.run(folder)
    page = _Page(outcome.path.read_text(encoding="utf-8"))
    assert "feature-space" not in page.figures()
    assert "ordinal-distribution" in page.figures()
    assert not {"nan", "None", "inf"} & set(page.words().split())


def test_a_loop_alone_makes_a_report(tmp_path: Path) -> None:
    output_folder.add_loop(tmp_path)
    outcome = report.run(tmp_path)
    page = _Page(outcome.path.read_text(encoding="utf-8"))
    assert page.figures() == {"partial-residuals-3", "residual-3", "order-spectrum-3"}
    assert "Model of axis 3: closed, 2 effects added" in page.words()
    assert "To tell ripple from elasticity: move at two more speeds" in page.words()
    assert outcome.omitted == ("diagnosis: scores.parquet is absent; `opamc diagnose` writes it",)


@pytest.mark.long
def test_figures_without_healthy_joints_show_one_that_is_not(folder: Path) -> None:
    verdict = json.loads((folder / "verdict.json").read_text())
    for entry in verdict["axes"]:  # a healthy joint is the worst of those that were judged
        entry["state"] = "healthy" if entry["axis"] == 3 else "insufficient-data"
    (folder / "verdict.json").write_text(json.dumps(verdict))
    made = report.run(folder, figures_of_healthy=False)
    assert "envelopes" in _Page(made.path.read_text()).figures()


@pytest.mark.long
def test_one_joint_has_no_figures_that_compare_joints(folder: Path) -> None:
    verdict = json.loads((folder / "verdict.json").read_text())
    for entry in verdict["axes"]:
        entry["state"] = "fault" if entry["axis"] == 3 else "healthy"
    (folder / "verdict.json").write_text(json.dumps(verdict))
    comparing = {"feature-space", "latent-axis"}
    assert comparing <= _Page(report.run(folder).path.read_text()).figures()
    alone = report.run(folder, figures_of_healthy=False)
    assert not comparing & _Page(alone.path.read_text()).figures()
    assert sum("this is one: the table has its" in line for line in alone.omitted) == 2
