"""Deciding again from tables, and the documents that programs read."""

import json
import shutil
from dataclasses import replace
from importlib import resources
from pathlib import Path

import jsonschema
import pytest

from opamc_cli.__main__ import main
from opamc_cli.stages.verdict.findings import Findings, read_findings, write_findings
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run

SAMPLES = Path(__file__).parents[3] / "data" / "samples"


def ended(*arguments):
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return int(end.value.code or 0)


def schema(name):
    text = (
        resources.files("opamc_cli.storage.schemas")
        .joinpath(f"{name}.schema.json")
        .read_text("utf-8")
    )
    return json.loads(text)


def verdict_in(folder):
    return json.loads((folder / "verdict.json").read_text())


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    """Return the folder of a diagnosis of three healthy and two faulty sessions, cause included."""
    out = tmp_path_factory.mktemp("diagnosed")
    runs = {role: sorted((SAMPLES / role).glob("*.parquet")) for role in ("normal", "fault")}
    sides = [*(["--baseline", run] for run in runs["normal"][:3])]
    sides += [["--target", run] for run in runs["fault"][:2]]
    flat = [part for side in sides for part in side]
    options = ("--out", out, "--quiet", "--set", "joint.gear_ratio=100")
    with pytest.MonkeyPatch.context() as patch:
        for section in ("EVIDENCE", "LOOP"):  # figures, at which no test of a verdict looks
            patch.setattr(f"opamc_cli.stages.report.figures.shown.{section}", ())
        assert ended("diagnose", *flat, *options) == 1
    return out


def test_what_was_found_out_from_the_recordings_is_kept_for_the_same_tables(tmp_path):
    tables = [tmp_path / role / "patterns.parquet" for role in ("baseline", "target")]
    for table in tables:
        table.parent.mkdir()
        table.write_text("counts")
    found = Findings({1: {"share": 0.5}}, {2: ["Why."], 3: ["Why."]}, frozenset({2}))
    write_findings(tmp_path, found)
    assert read_findings(tmp_path, tables) == found
    tables[1].write_text("other counts")
    assert read_findings(tmp_path, tables) == Findings()


@pytest.mark.long
def test_the_same_options_decide_the_same(diagnosed, tmp_path):
    before = verdict_in(diagnosed)
    tables = [diagnosed / role / "patterns.parquet" for role in ("baseline", "target")]
    assert ended("decide", "--baseline", tables[0], "--target", tables[1], "--out", tmp_path) == 1
    after = verdict_in(tmp_path)
    for old, new in zip(before["axes"], after["axes"], strict=True):
        for key in ("axis", "health_index", "p_value", "p_adjusted", "features", "motions"):
            assert old[key] == new[key]
    assert any("no cause was sought" in note for note in after["notes"])
    assert not any("no cause was sought" in note for note in before["notes"])


@pytest.mark.long
def test_other_limits_decide_otherwise_and_keep_the_cause(diagnosed):
    before = verdict_in(diagnosed)
    cause = before["axes"][2]["cause"]
    assert cause is not None
    # a change that is too small to matter but as far off as this is not called healthy
    assert ended("decide", "--out", diagnosed, "--set", "score.minimum_effect=1") == 5
    states = [axis["state"] for axis in verdict_in(diagnosed)["axes"]]
    assert states == ["healthy", "healthy", "insufficient-data"]
    assert ended("decide", "--out", diagnosed) == 1
    assert verdict_in(diagnosed)["axes"][2]["cause"] == cause
    assert ended("report", "--out", diagnosed, "--quiet") == 0


def test_decide_without_a_diagnosis(tmp_path, capsys):
    assert ended("decide", "--out", tmp_path) == 3
    assert "baseline/patterns.parquet: no such file" in capsys.readouterr().err


def test_a_witness_whose_table_was_lost_is_not_passed_over(diagnosed, tmp_path, capsys):
    copy = shutil.copytree(diagnosed, tmp_path / "copy")
    (copy / "baseline" / "spectra.parquet").unlink()
    assert ended("decide", "--out", copy) == 3
    assert "baseline/spectra.parquet: no such file" in capsys.readouterr().err


def test_a_verdict_keeps_to_its_schema(diagnosed):
    jsonschema.Draft202012Validator.check_schema(schema("verdict"))
    jsonschema.validate(verdict_in(diagnosed), schema("verdict"))


def test_schemas_refuse_what_is_no_verdict(diagnosed):
    verdict = verdict_in(diagnosed)
    for key in ("schema_version", "robot", "created_at", "tables", "notes", "baseline"):
        without = {name: value for name, value in verdict.items() if name != key}
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(without, schema("verdict"))
    verdict["axes"][0]["state"] = "fine"
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(verdict, schema("verdict"))


def test_schemas_are_printed(capsys):
    assert ended("config", "schema", "verdict") == 0
    assert json.loads(capsys.readouterr().out) == schema("verdict")
    assert ended("config", "schema", "tables") == 2


@pytest.mark.long
@pytest.mark.usefixtures("undrawn")
def test_one_damaged_session_of_three_is_not_diluted(tmp_path):
    healthy = sorted((SAMPLES / "normal").glob("*.parquet"))
    damaged = SAMPLES / "fault" / "session-008.parquet"
    sides = [*(["--baseline", run] for run in healthy[:6])]
    sides += [["--target", run] for run in (*healthy[6:], damaged)]
    flat = [part for side in sides for part in side]
    assert ended("diagnose", *flat, "--out", tmp_path, "--quiet") == 1
    verdict = verdict_in(tmp_path)
    jsonschema.validate(verdict, schema("verdict"))
    states = [axis["state"] for axis in verdict["axes"]]
    assert states == ["healthy", "healthy", "fault"]
    only = "Of 3 target sessions only night 2021-01-08 shows it by itself."
    assert verdict["axes"][2]["reasons"][0] == only
    assert verdict["axes"][2]["session"] == "night 2021-01-08"
    assert verdict["axes"][2]["cause"]["effect"] == "ripple"
    assert "session" not in verdict["axes"][0]


@pytest.mark.long
@pytest.mark.usefixtures("undrawn")
def test_files_of_one_night_that_differ_are_named(tmp_path):
    """Together they hid which ones it was, and that half of the night was healthy."""
    healthy = sorted((SAMPLES / "normal").glob("*.parquet"))
    damaged = sorted((SAMPLES / "fault").glob("*.parquet"))
    for name, path in zip("abcd", (healthy[6], damaged[0], healthy[7], damaged[1]), strict=True):
        with Run(path) as run:
            info = replace(run.info, session="tonight")
            save_run(tmp_path / f"{name}.parquet", info, run.read(run.columns))
    flat = [part for run in healthy[:6] for part in ("--baseline", run)]
    flat += [part for name in "abcd" for part in ("--target", tmp_path / f"{name}.parquet")]
    options = ("--set", "joint.explain=false", "--out", tmp_path / "out", "--quiet")
    assert ended("diagnose", *flat, *options) == 1
    verdict = verdict_in(tmp_path / "out")
    assert verdict["target"]["sessions"] == 1
    found = verdict["axes"][2]
    assert found["state"] == "fault"
    assert found["reasons"][0].startswith("Of 4 target files only b and d differ (")
    assert found["brief"]["evidence"][0] == found["reasons"][0]
    for entry in verdict["axes"][:2]:
        assert not any("target files" in sentence for sentence in entry["reasons"])


@pytest.mark.long
@pytest.mark.usefixtures("undrawn")
def test_two_joints_of_like_size_exchanged_are_no_fault(tmp_path):
    healthy = sorted((SAMPLES / "normal").glob("*.parquet"))
    with Run(healthy[7]) as run:
        columns = run.read(run.columns)
        other = {"axis1": "axis2", "axis2": "axis1", "axis3": "axis3"}
        turned = {other[name[:5]] + name[5:]: values for name, values in columns.items()}
        save_run(tmp_path / "exchanged.parquet", run.info, turned)
    flat = [part for run in healthy[:6] for part in ("--baseline", run)]
    target = ("--target", tmp_path / "exchanged.parquet", "--out", tmp_path / "out", "--quiet")
    assert ended("diagnose", *flat, *target) == 5
    entries = verdict_in(tmp_path / "out")["axes"]
    states = [entry["state"] for entry in entries]
    assert states == ["insufficient-data", "insufficient-data", "healthy"]
    for entry in entries[:2]:
        assert entry["reasons"][0].endswith("are the two exchanged?")
        assert entry["brief"] is None
