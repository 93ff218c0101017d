"""What users get wrong: one sentence, the right exit code, nothing half-written."""

import dataclasses
import json
import os
import re
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import bad_runs
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from opamc_cli.commands.command_line import COMMANDS
from opamc_cli.errors import ExitCode
from opamc_cli.storage.files.lock import output_lock
from opamc_cli.storage.runs.writing import save_run
from tests.conftest import Ended

ROOT = Path(__file__).parents[2]
MAP = "sampling_rate_hz: 10\nheader: false\ncolumns: {axis1_a: {source: 0, unit: A}}\n"

pytestmark = pytest.mark.usefixtures("undrawn")


def check_refusal(ended: Ended, code: ExitCode, *parts: str) -> None:
    """Check that one sentence says why, with all `parts`, and that nothing else was said."""
    assert ended.code == code, ended
    assert len(ended.sentences) == 1, ended
    (sentence,) = ended.sentences
    for part in parts:
        assert part in sentence
    assert "a bug" not in sentence
    assert "Traceback" not in ended.err
    assert ended.out == ""
    # a sentence, not a paragraph; how deep a folder lies is not the sentence's fault
    assert len(re.sub(r"/\S*/", "", sentence)) < 400


def check_nothing_half_written(folder: Path) -> None:
    left = [p for p in folder.rglob("*") if p.is_file() and p.name.endswith(".part")]
    assert not left


# -- configuration ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("segmnt: {gamma: 3}", ["unknown key 'segmnt'", "did you mean 'segment'"]),
        ("segment: {gama: 3}", ["unknown key 'segment.gama'", "did you mean 'gamma'"]),
        ("segment: {gamma: -3}", ["segment.gamma is -3", "greater than 0"]),
        ("segment: {gamma: fast}", ["segment.gamma is 'fast'"]),
        ("patterns: {orders: [4, 9]}", ["patterns.orders", "9"]),
        ("patterns: 5", ["patterns is 5"]),
        ("- 1", ["holds a list"]),
        ("a: [", ["is not valid YAML"]),
        ("segment: {gamma: 3}\nsegment: {gamma: 4}", ["given twice (line 2)"]),
        ("score: {base: .nan}", ["score.base is nan"]),
        ("score: {base: 1}", ["score.base is 1", "greater than 1"]),
        ("segment: {threshold_on: 0.2}", ["threshold_off is 0.3, threshold_on 0.2"]),
        ("!!python/object/apply:os.system ['true']", ["is not valid YAML"]),
    ],
)
def test_config_files(opamc, tmp_path, text, parts):
    file = tmp_path / "c.yaml"
    file.write_text(text)
    check_refusal(opamc("config", "check", "--config", file), ExitCode.USAGE, str(file), *parts)


@pytest.mark.parametrize(
    ("override", "part"),
    [
        ("patterns.gamma", "write it as key=value"),
        ("patterns.gama=1", "did you mean 'gamma'"),
        ("patterns.gamma={:", "write patterns.gamma={:}"),
        ("patterns.gamma=]", "the value is not YAML"),
        ("decimal=,", """write --set 'decimal=","'"""),
        ("patterns.orders=[4,5", "a bracket is open; write patterns.orders=[4,5]"),
        ("patterns.orders=9", "it takes a list, such as patterns.orders=[4,5]"),
        ("patterns.orders=4-5", "it takes a list, such as patterns.orders=[4,5]"),
        ("patterns.gamma.x=1", "patterns.gamma"),
        ("=1", "write it as key=value"),
    ],
)
def test_config_overrides(opamc, override, part):
    check_refusal(opamc("config", "check", "--set", override), ExitCode.USAGE, part)


SHIPPED = {
    "default.yaml": "configuration",
    "samples.yaml": "testbed",
    "model.yaml": "model",
    "maps/ur_rtde.yaml": "map",
}


@pytest.mark.parametrize("name", SHIPPED)
def test_documents_are_told_by_their_keys(opamc, name):
    file = ROOT / "configs" / name
    ended = opamc("config", "check", file, "--json")
    assert ended.code == ExitCode.DONE, ended
    assert json.loads(ended.out)["kind"] == SHIPPED[name]
    uses = {
        "configuration": ["config", "check", "--config"],
        "testbed": ["simulate", "--config"],
        "model": ["model", "fit", "none.parquet", "--model"],
        "map": ["ingest", "none.csv", "--map"],
    }
    for kind, arguments in uses.items():
        if kind != SHIPPED[name]:
            reader = {"configuration": "--config", "testbed": "simulate", "map": "ingest"}
            part = reader.get(SHIPPED[name], "opamc model")
            check_refusal(opamc(*arguments, file), ExitCode.USAGE, str(file), part)


@pytest.mark.parametrize("make", [bad_runs.missing, bad_runs.folder])
def test_config_paths(opamc, tmp_path, make):
    file = make(tmp_path / "c.yaml")
    check_refusal(
        opamc("config", "check", "--config", file), ExitCode.USAGE, str(file), "cannot be read"
    )


def test_config_that_is_not_text(opamc, tmp_path):
    file = tmp_path / "c.yaml"
    file.write_bytes(b"\xff\xfe\x00")
    check_refusal(opamc("config", "check", "--config", file), ExitCode.USAGE, "UTF-8")


# -- output folder ---------------------------------------------------------------------------


def unusable_outputs(tmp_path: Path) -> list[Path]:
    file = tmp_path / "a-file"
    file.write_text("mine")
    return [file, file / "below", Path("/proc/opamc-out")]


def commands_with_output(tmp_path: Path) -> dict[str, list[object]]:
    """Return arguments with which every command would work, were its output folder usable."""
    log = tmp_path / "log.csv"
    log.write_text("1\n2\n3\n")
    channels = tmp_path / "map.yaml"
    channels.write_text(MAP)
    run = bad_runs.good(tmp_path / "good.parquet")
    return {
        "ingest": [log, "--map", channels],
        "segment": [run],
        "identify": [tmp_path / "segments.parquet"],
        "patterns": [tmp_path / "motions.parquet"],
        "score": ["--baseline", tmp_path / "p.parquet", "--target", tmp_path / "p.parquet"],
        "diagnose": ["--baseline", run, "--target", run],
        "sweep": ["--baseline", run],
        "simulate": ["--config", ROOT / "configs" / "testbed.yaml"],
        "model fit": [run, "--model", ROOT / "configs" / "model.yaml"],
        "model close": [run, "--model", ROOT / "configs" / "model.yaml"],
    }


@pytest.mark.parametrize(
    "command",
    [
        *("ingest", "segment", "identify", "patterns", "score", "diagnose", "sweep", "simulate"),
        *("model fit", "model close"),
    ],
)
@pytest.mark.parametrize("which", range(3))
def test_unwritable_outputs(opamc, tmp_path, command, which):
    out = unusable_outputs(tmp_path)[which]
    arguments = commands_with_output(tmp_path)[command]
    ended = opamc(*command.split(), *arguments, "--out", out)
    check_refusal(ended, ExitCode.USAGE, str(out), "--out")
    assert (tmp_path / "a-file").read_text() == "mine"


# -- ingest ----------------------------------------------------------------------------------


@pytest.fixture
def channels(tmp_path) -> Path:
    path = tmp_path / "map.yaml"
    path.write_text(MAP)
    return path


@pytest.mark.parametrize(
    ("make", "part"),
    [
        (bad_runs.missing, "no such file"),
        (bad_runs.folder, "the folder holds no recording"),
        (bad_runs.empty_file, "is empty"),
        (bad_runs.text, "holds 'time' in line 1"),
        (bad_runs.good, "log.csv"),
    ],
)
def test_ingest_of_what_is_no_table(opamc, tmp_path, channels, make, part):
    file = make(tmp_path / "log.csv")
    ended = opamc("ingest", file, "--map", channels, "--out", tmp_path / "out")
    assert ended.code == ExitCode.BAD_INPUT, ended
    assert len(ended.sentences) == 1
    assert str(file) in ended.sentences[0]
    assert part in ended.sentences[0]
    assert not list((tmp_path / "out").glob("*.par*"))


def test_ingest_where_one_file_fails(opamc, tmp_path, channels):
    (tmp_path / "good.csv").write_text("1\n2\n")
    (tmp_path / "bad.csv").write_text("x\n")
    files = [tmp_path / "bad.csv", tmp_path / "good.csv"]
    ended = opamc("ingest", *files, "--map", channels, "--out", tmp_path / "out")
    assert ended.code == ExitCode.PARTIAL
    assert len(ended.sentences) == 1
    assert [p.name for p in (tmp_path / "out").glob("*.par*")] == ["good.parquet"]


def test_ingest_without_a_map(opamc, tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("1\n")
    missing = tmp_path / "none.yaml"
    check_refusal(opamc("ingest", file, "--map", missing), ExitCode.USAGE, str(missing))


# -- stage tables ----------------------------------------------------------------------------

READERS = {
    "identify": lambda file, out: ["identify", file, "--out", out],
    "patterns": lambda file, out: ["patterns", file, "--out", out],
    "score": lambda file, out: ["score", "--baseline", file, "--target", file, "--out", out],
}
NEEDS = {"identify": "segment", "patterns": "identify", "score": "patterns"}


@pytest.mark.parametrize("command", READERS)
@pytest.mark.parametrize(
    ("make", "part"),
    [
        (bad_runs.missing, "no such file; run `opamc {needs}` first"),
        (bad_runs.folder, "is a folder"),
        (bad_runs.text, "cannot be read as Parquet"),
        (bad_runs.empty_file, "cannot be read as Parquet"),
        (bad_runs.truncated, "cannot be read as Parquet"),
        (bad_runs.good, "is a run, not a stage table"),
        (bad_runs.no_metadata, "not a stage table of opamc"),
    ],
)
def test_what_is_no_stage_table(opamc, tmp_path, command, make, part):
    file = make(tmp_path / "table.parquet")
    ended = opamc(*READERS[command](file, tmp_path / "out"))
    check_refusal(ended, ExitCode.BAD_INPUT, str(file), part.format(needs=NEEDS[command]))
    assert not list((tmp_path / "out").glob("*.par*"))


# -- the testbed -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--config", "none.yaml"], "none.yaml: cannot be read"),
        (["--config", "{testbed}", "--set", "recordng.sessions=1"], "did you mean 'recording'"),
        (["--config", "{testbed}", "--fault", "third"], "write AXIS or AXIS:SEVERITY"),
        (["--config", "{testbed}", "--fault", "9"], "9"),
        (["--config", "{testbed}", "--sessions", "99999999999"], "sessions is 99999999999"),
        (["--config", "{testbed}", "--first-session", "9999999"], "first_session is 9999999"),
    ],
)
def test_testbeds(opamc, tmp_path, arguments, part):
    testbed = str(ROOT / "configs" / "testbed.yaml")
    filled = [a.replace("{testbed}", testbed) for a in arguments]
    ended = opamc("simulate", *filled, "--out", tmp_path / "out")
    check_refusal(ended, ExitCode.USAGE, part)


# -- the report ------------------------------------------------------------------------------


def test_report_of_nothing(opamc, tmp_path):
    check_refusal(opamc("report", "--out", tmp_path / "none"), ExitCode.BAD_INPUT, "no such folder")
    check_refusal(opamc("report", "--out", tmp_path), ExitCode.BAD_INPUT, str(tmp_path))
    assert not list(tmp_path.glob("*.html"))


# -- runs ------------------------------------------------------------------------------------

UNUSABLE = [
    (bad_runs.missing, ["no such file"]),
    (bad_runs.folder, ["holds no run"]),
    (bad_runs.text, ["cannot be opened as Parquet", "opamc ingest"]),
    (bad_runs.empty_file, ["cannot be opened as Parquet"]),
    (bad_runs.truncated, ["cannot be opened as Parquet"]),
    (bad_runs.damaged, ["axis1_a", "the file is damaged"]),
    (bad_runs.other_columns, ["no current column among [current]", "axis1_a"]),
    (bad_runs.text_column, ["column axis1_a has type string"]),
    (bad_runs.no_metadata, ["is not a run", "sampling_rate_hz"]),
    (bad_runs.no_rate, ["no sampling_rate_hz"]),
    (bad_runs.zero_rate, ["sampling_rate_hz is 0", "greater than or equal to 0.001"]),
    (bad_runs.no_rows, ["no samples"]),
    (bad_runs.wrong_time, ["column time_s", "0.002 s", "0.001 s"]),
    (bad_runs.stage_table, ["is a stage table"]),
    (bad_runs.all_nan, ["column axis1_b", "no number"]),
    (bad_runs.constant, ["column axis1_c", "constant at 1.5 A"]),
    (bad_runs.too_slow, ["sampling_rate_hz is 1,", "100 Hz"]),
    (bad_runs.aliased, ["axis 1", "170", "Hz or faster"]),
    (bad_runs.standing, ["no motion was found"]),
    (bad_runs.short, ["no motion was found"]),
    (bad_runs.current_alone, ["axis1_current", "axis1_position"]),
    (bad_runs.milliamperes, ["column axis1_a is beyond 1000 A", "mA taken for A"]),
]


@pytest.mark.parametrize(("make", "parts"), UNUSABLE)
def test_segment_of_unusable_runs(opamc, tmp_path, make, parts):
    file = make(tmp_path / "bad.parquet")
    ended = opamc("segment", file, "--out", tmp_path / "out")
    check_refusal(ended, ExitCode.BAD_INPUT, str(file), *parts)
    assert not list((tmp_path / "out").glob("*.par*"))


@pytest.mark.parametrize(("make", "parts"), UNUSABLE[::4])
@pytest.mark.parametrize("side", ["baseline", "target"])
def test_diagnose_of_unusable_runs(opamc, tmp_path, make, parts, side):
    usable = bad_runs.good(tmp_path / "good.parquet", seed=1)
    file = make(tmp_path / "bad.parquet")
    sides = {"baseline": usable, "target": usable, side: file}
    out = tmp_path / "out"
    out.mkdir()
    for old in ("verdict.json", "report.html"):
        (out / old).write_text("yesterday's")
    ended = opamc(
        "diagnose", "--baseline", sides["baseline"], "--target", sides["target"], "--out", out
    )
    check_refusal(ended, ExitCode.BAD_INPUT, str(file), *(parts if "rate" not in parts[0] else []))
    check_nothing_half_written(tmp_path)
    # the last result stays, and is said to be the last
    assert f"{out / 'verdict.json'} is still that of the last result" in ended.err
    for old in ("verdict.json", "report.html"):
        assert (out / old).read_text() == "yesterday's"


@pytest.mark.parametrize(
    ("make", "part", "code"),
    [
        (bad_runs.infinite, "column axis1_a has 1 sample", ExitCode.DONE),
        (bad_runs.some_nan, "column axis1_a has 2758 samples", ExitCode.PARTIAL),
        (bad_runs.clipped, "column axis1_a looks clipped", ExitCode.DONE),
    ],
)
def test_doubtful_channels_are_named(opamc, tmp_path, make, part, code):
    file = make(tmp_path / "doubtful.parquet")
    ended = opamc("segment", file, "--out", tmp_path / "out")
    assert ended.code == code, ended
    assert ended.err.startswith(f"{file}: {part}")
    assert len(ended.err.splitlines()) == (1 if code == ExitCode.DONE else 3)


def test_a_doubt_of_many_recordings_is_one_line(opamc, tmp_path):
    """Of a night's 24 files the same sentence came 24 times, also with --quiet."""
    (tmp_path / "map.yaml").write_text(
        "sampling_rate_hz: 100\nheader: false\ncolumns: {axis1_current: {source: 0, unit: A}}"
    )
    swing = 300 * np.sin(np.arange(1000) / 50)
    for name in "abc":
        np.savetxt(tmp_path / f"{name}.csv", swing)
    ended = opamc(
        "ingest", tmp_path, "--map", tmp_path / "map.yaml", "--out", tmp_path / "runs", "--quiet"
    )
    assert ended.code == ExitCode.DONE
    (line,) = ended.err.splitlines()
    assert "beyond 200 A" in line
    assert line.startswith("opamc: 3 files: ")


def test_one_window_is_told_as_one(opamc, tmp_path):
    current = 1 + 0.1 * np.random.default_rng(1).normal(size=700)
    turning = {"axis1_current": current, "axis1_position": 0.3 * np.arange(700) / 200}
    info = dataclasses.replace(bad_runs.INFO, sampling_rate_hz=200.0)
    save_run(tmp_path / "on.parquet", info, turning)
    several = bad_runs.good(tmp_path / "several.parquet")
    ended = opamc("segment", tmp_path / "on.parquet", several, "--out", tmp_path / "out")
    assert "on axis 1: 1 window, 3.4 s" in ended.out
    assert "several axis 1: 12 motions, " in ended.out


def test_segment_where_one_run_fails(opamc, tmp_path):
    good, bad = bad_runs.good(tmp_path / "good.parquet"), bad_runs.text(tmp_path / "bad.parquet")
    ended = opamc("segment", good, bad, "--out", tmp_path / "out", "--json")
    assert ended.code == ExitCode.PARTIAL
    assert len(ended.sentences) == 1
    assert str(bad) in ended.sentences[0]
    assert {axis["run"] for axis in json.loads(ended.out)["axes"]} == {"good"}


def test_a_damaged_run_in_a_folder_is_named(opamc, tmp_path):
    (tmp_path / "runs").mkdir()
    bad_runs.good(tmp_path / "runs" / "a.parquet")
    damaged = bad_runs.damaged(tmp_path / "runs" / "b.parquet")
    ended = opamc("segment", tmp_path / "runs", "--out", tmp_path / "out")
    assert ended.code == ExitCode.PARTIAL
    assert str(damaged) in ended.sentences[0]


# -- two sides -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pair(tmp_path_factory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("pair")
    return bad_runs.good(folder / "one.parquet"), bad_runs.good(folder / "other.parquet", seed=1)


@pytest.mark.parametrize(
    ("make", "parts"),
    [
        (bad_runs.other_rate, ["sampling_rate_hz is 500", "1000"]),
        (bad_runs.other_program, ["program is 'place'", "'pick'", "by a quoted pattern"]),
    ],
)
def test_what_cannot_be_compared(opamc, tmp_path, pair, make, parts):
    file = make(tmp_path / "bad.parquet")
    ended = opamc("diagnose", "--baseline", pair[0], "--target", file, "--out", tmp_path / "out")
    check_refusal(ended, ExitCode.BAD_INPUT, *parts)
    assert not (tmp_path / "out" / "verdict.json").exists()


def test_a_target_with_other_axes(opamc, tmp_path, pair):
    file = bad_runs.other_axis(tmp_path / "other.parquet")
    ended = opamc("diagnose", "--baseline", pair[0], "--target", file, "--out", tmp_path / "out")
    check_refusal(ended, ExitCode.NOT_ENOUGH_DATA, "it has no current of axis 1")


def test_one_cycle_is_no_baseline(opamc, tmp_path, pair):
    file = bad_runs.one_cycle(tmp_path / "short.parquet")
    ended = opamc(
        "diagnose", "--baseline", file, "--target", pair[0], "--out", tmp_path / "out", "--json"
    )
    assert ended.code == ExitCode.NOT_ENOUGH_DATA
    (axis,) = json.loads(ended.out)["axes"]
    assert axis["state"] == "insufficient-data"
    assert any("cycle" in reason for reason in axis["reasons"])


@pytest.mark.long
def test_a_diagnosis_of_what_is_left(opamc, tmp_path, pair):
    bad = bad_runs.constant(tmp_path / "bad.parquet")
    ended = opamc(
        *("diagnose", "--baseline", pair[0], "--target", pair[1], "--target", bad),
        *("--out", tmp_path / "out", "--json"),
    )
    assert ended.code == ExitCode.PARTIAL, ended
    of_baseline, of_bad = ended.sentences
    assert "with one baseline session" in of_baseline
    assert str(bad) in of_bad
    assert (tmp_path / "out" / "report.html").exists()


def test_a_pattern_that_the_shell_has_spread_is_told_to_be_quoted(opamc):
    ended = opamc("diagnose", "--baseline", "a.parquet", "b.parquet", "--target", "c.parquet")
    assert ended.code == ExitCode.USAGE
    assert "put a pattern in quotes, as in --baseline 'runs/*.parquet'" in ended.err
    assert "in quotes" not in opamc("config", "show", "more").err


def test_a_baseline_in_which_nothing_repeats(opamc, tmp_path, pair):
    part = bad_runs.part(tmp_path / "part.parquet", 2000, 3000)
    ended = opamc("diagnose", "--baseline", part, "--target", pair[0], "--out", tmp_path / "out")
    check_refusal(ended, ExitCode.NOT_ENOUGH_DATA, "no motion repeats", "two cycles")


@pytest.mark.long
def test_patterns_longer_than_the_motions_are_shortened_and_it_is_said(opamc, tmp_path):
    run = bad_runs.moving_joint(tmp_path / "joint.parquet")
    other = bad_runs.moving_joint(tmp_path / "other.parquet", seed=1)
    arguments = ["diagnose", "--baseline", run, "--target", other, "--out", tmp_path / "out"]
    ended = opamc(*arguments, "--set", "joint.gear_ratio=1")
    assert ended.code == ExitCode.DONE
    assert "delay was limited to" in ended.err


@pytest.mark.long
def test_an_unknown_gear_ratio_leaves_the_delay_to_the_baseline_and_is_said(opamc, tmp_path):
    run = bad_runs.moving_joint(tmp_path / "joint.parquet")
    other = bad_runs.moving_joint(tmp_path / "other.parquet", seed=1)
    ended = opamc("diagnose", "--baseline", run, "--target", other, "--out", tmp_path / "out")
    assert ended.code == ExitCode.DONE
    assert "no carrier and no joint.gear_ratio tell the patterns' delay" in ended.err


def test_an_envelope_that_the_run_does_not_have(opamc, tmp_path, pair):
    arguments = ["diagnose", "--baseline", pair[0], "--target", pair[1], "--out", tmp_path / "out"]
    ended = opamc(*arguments, "--set", "patterns.envelope=reported")
    check_refusal(ended, ExitCode.BAD_INPUT, str(pair[0]), "axis1_current")


def test_missing_positions_are_bridged(opamc, tmp_path):
    def change(columns: dict[str, np.ndarray]) -> None:
        del columns["axis1_velocity"]
        columns["axis1_position"][::50] = np.nan

    whole = bad_runs.moving_joint(tmp_path / "whole.parquet")
    holed = bad_runs.moving_joint(tmp_path / "holed.parquet", change)
    ended = opamc("segment", whole, holed, "--out", tmp_path / "out", "--json")
    assert ended.code == ExitCode.DONE
    counts = [axis["segments"] for axis in json.loads(ended.out)["axes"]]
    assert len(counts) == 2
    assert counts[0] == counts[1]


def _chained(opamc, folder, run, *options, segment=(), reference=()):
    assert opamc("segment", run, "--out", folder, *segment).code == 0
    assert opamc("identify", "--out", folder, *reference).code == 0
    assert opamc("patterns", "--out", folder, *options).code == 0
    return folder / "patterns.parquet"


def test_tables_of_unequal_options(opamc, tmp_path, pair):
    baseline = _chained(opamc, tmp_path / "b", pair[0])
    reference = ["--reference", tmp_path / "b" / "motions.parquet"]
    for name, given, parts in (
        ("f", {"options": ["--set", "patterns.frames=8"]}, ["patterns.frames 8 where", "has 16"]),
        ("s", {"segment": ["--set", "segment.min_motion_s=0.3"]}, ["segment.min_motion_s 0.3"]),
    ):
        options = given.pop("options", [])
        target = _chained(opamc, tmp_path / name, pair[1], *options, reference=reference, **given)
        ended = opamc("score", "--baseline", baseline, "--target", target, "--out", tmp_path / "o")
        check_refusal(ended, ExitCode.BAD_INPUT, *parts)


def test_a_target_that_was_not_identified_by_the_baselines_reference(opamc, tmp_path, pair):
    baseline, target = (
        _chained(opamc, tmp_path / side, run, "--set", "patterns.tau=3")
        for side, run in zip("bt", pair, strict=True)
    )
    sides = ["--baseline", baseline, "--target", target]
    for command, code in (("score", ExitCode.DONE), ("decide", ExitCode.NOT_ENOUGH_DATA)):
        for quiet in ([], ["--quiet"]):
            ended = opamc(command, *sides, "--out", tmp_path / "out", *quiet)
            assert ended.code == code
            assert ended.err.count(f"{target}: its motions were told by another cycle") == 1
            assert "--reference" in ended.err


def test_a_table_of_one_stage_is_not_another(opamc, tmp_path, pair):
    out = tmp_path / "out"
    assert opamc("segment", pair[0], "--out", out).code == 0
    table = out / "segments.parquet"
    ended = opamc("patterns", table, "--out", out)
    check_refusal(ended, ExitCode.BAD_INPUT, str(table), "'segment'", "'identify' is needed")
    ended = opamc("segment", table, "--out", out)
    check_refusal(ended, ExitCode.BAD_INPUT, str(table), "is a stage table")
    ended = opamc("identify", pair[0], "--out", out)
    check_refusal(ended, ExitCode.BAD_INPUT, str(pair[0]), "is a run")


def test_runs_that_changed_or_went_after_their_segments_were_found(opamc, tmp_path):
    run = bad_runs.good(tmp_path / "r.parquet")
    out = tmp_path / "out"
    assert opamc("segment", run, "--out", out).code == 0
    assert opamc("identify", "--out", out).code == 0
    bad_runs.good(run, seed=5)
    ended = opamc("patterns", "--out", out)
    check_refusal(ended, ExitCode.BAD_INPUT, str(run), "has changed", "opamc segment")
    run.unlink()
    ended = opamc("patterns", "--out", out)
    check_refusal(ended, ExitCode.BAD_INPUT, str(run), "--runs")
    ended = opamc("patterns", "--out", out, "--runs", tmp_path / "nowhere")
    check_refusal(ended, ExitCode.BAD_INPUT, "nowhere", "no such folder")


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--tau", "5:2"], "--tau 5:2: must rise"),
        (["--tau", "0:2"], "--tau 0:2: must rise within 1.."),
        (["--tau", "all"], "--tau all: write it as FIRST:LAST"),
        (["--tau", "8-1"], "such as --tau 1:8"),
        (["--order", "2:4"], "--order 2:4: must rise within 3..7"),
        (["--order", "5:9"], "--order 5:9: must rise within 3..7"),
    ],
)
def test_sweeps(opamc, tmp_path, pair, arguments, part):
    ended = opamc("sweep", "--baseline", pair[0], *arguments, "--out", tmp_path / "out")
    check_refusal(ended, ExitCode.USAGE, part)


# -- a joint's model -------------------------------------------------------------------------


@pytest.fixture
def model(tmp_path) -> Path:
    path = tmp_path / "model.yaml"
    path.write_text("effects: [gravity, coulomb, viscous]\n")
    return path


def in_column(name: str, value: float) -> Callable[[dict[str, np.ndarray]], None]:
    def change(columns: dict[str, np.ndarray]) -> None:
        columns[name][:] = value

    return change


@pytest.mark.parametrize(
    ("change", "code", "parts"),
    [
        (in_column("axis1_current", np.nan), ExitCode.BAD_INPUT, ["axis1_current", "no number"]),
        (in_column("axis1_current", np.inf), ExitCode.BAD_INPUT, ["axis1_current", "no number"]),
        (in_column("axis1_current", 1.5), ExitCode.BAD_INPUT, ["axis1_current", "at 1.5 A"]),
        (in_column("axis1_position", np.nan), ExitCode.BAD_INPUT, ["axis1_position"]),
        (
            lambda c: (c.pop("axis1_velocity"), c.pop("axis1_position")),
            ExitCode.BAD_INPUT,
            ["axis1_position", "log one of them"],
        ),
        (
            lambda c: (c.pop("axis1_velocity"), in_column("axis1_position", 0.1)(c)),
            ExitCode.NOT_ENOUGH_DATA,
            ["axis 1 does not move"],
        ),
        (
            lambda c: c["axis1_current"].__imul__(np.float32(5000)),
            ExitCode.BAD_INPUT,
            ["axis1_current is beyond 1000 A"],
        ),
    ],
)
@pytest.mark.parametrize("command", ["fit", "trace", "close"])
def test_models_of_unusable_runs(opamc, tmp_path, model, command, change, code, parts):
    file = bad_runs.moving_joint(tmp_path / "bad.parquet", change)
    ended = opamc("model", command, file, "--model", model, "--out", tmp_path / "out")
    check_refusal(ended, code, str(file), *parts)
    assert not [p for p in (tmp_path / "out").rglob("*") if p.suffix in (".json", ".parquet")]


def test_models_of_too_little(opamc, tmp_path, model):
    file = bad_runs.moving_joint(tmp_path / "bad.parquet", n=50)
    ended = opamc("model", "fit", file, "--model", model, "--out", tmp_path / "out")
    check_refusal(ended, ExitCode.NOT_ENOUGH_DATA, str(file), "50 samples")
    file = bad_runs.moving_joint(tmp_path / "bad.parquet", n=200)
    ended = opamc("model", "close", file, "--model", model, "--out", tmp_path / "out")
    check_refusal(ended, ExitCode.NOT_ENOUGH_DATA, str(file))


def test_a_model_of_the_runs_that_are_left(opamc, tmp_path, model):
    good, bad = bad_runs.moving_joint(tmp_path / "r.parquet"), bad_runs.text(tmp_path / "b.parquet")
    ended = opamc("model", "fit", good, bad, "--model", model, "--out", tmp_path / "out")
    assert ended.code == ExitCode.PARTIAL, ended
    assert len(ended.sentences) == 1
    assert str(bad) in ended.sentences[0]
    assert (tmp_path / "out" / "fit.parquet").exists()


def test_models_of_an_axis_that_is_not_there(opamc, tmp_path, model):
    file = bad_runs.moving_joint(tmp_path / "r.parquet")
    ended = opamc("model", "fit", file, "--model", model, "--axis", 9, "--out", tmp_path / "out")
    check_refusal(ended, ExitCode.BAD_INPUT, str(file), "axis 9", "the run has axes 1")


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("effects: [gravty]", "did you mean gravity"),
        ("effects: [foo]", "Unknown effect 'foo' in the model; known are inertia, gravity"),
        ("effects: 5", "effects is 5"),
        ("joint: {gear_ration: 100}", "did you mean 'gear_ratio'"),
        ("joint: {gear_ratio: -1}", "joint.gear_ratio is -1"),
        ("effects: [{effect: ripple, parameters: {ordr: 2}}]", "did you mean 'order'"),
        ("effects: [{effect: ripple, parameters: {speed: 1}}]", "declared without 'order'"),
        ("effects: [{effect: stribeck, parameters: {exponent: 1}}]", "without 'stribeck_speed'"),
        ("effects: [thermal_viscous]", "no temperature channel"),
        ("library: [none.py]", "none.py"),
        ("library: [model.yaml]", "model.yaml"),
        ("without: [nothing]", "'nothing'"),
        ("- 1", "holds a list"),
    ],
)
def test_unusable_models(opamc, tmp_path, text, part):
    file = bad_runs.moving_joint(tmp_path / "r.parquet")
    model = tmp_path / "model.yaml"
    model.write_text(text)
    ended = opamc("model", "fit", file, "--model", model, "--out", tmp_path / "out")
    assert ended.code == ExitCode.USAGE, ended
    assert len(ended.sentences) == 1
    assert part in ended.sentences[0]


def test_a_value_of_thousands_of_characters_is_quoted_in_part(opamc, tmp_path):
    file = bad_runs.moving_joint(tmp_path / "r.parquet")
    (tmp_path / "model.yaml").write_text(f"effects: [coulomb, {'x' * 5000}]\n")
    ended = opamc("model", "fit", file, "--model", tmp_path / "model.yaml", "--out", tmp_path)
    assert ended.code == ExitCode.USAGE
    assert "Unknown effect 'xxx" in ended.err
    assert len(ended.err) < 1200


def test_a_ripple_is_declared_by_its_order(opamc, tmp_path):
    file = bad_runs.moving_joint(tmp_path / "r.parquet")
    model = tmp_path / "model.yaml"
    model.write_text("effects: [coulomb, {effect: ripple, parameters: {order: 2.0}}]")
    ended = opamc("model", "fit", file, "--model", model, "--out", tmp_path / "out", "--json")
    assert ended.code == ExitCode.DONE
    _, ripple = json.loads(ended.out)["axes"][0]["terms"]
    assert len(ripple["coefficients"]) == 2


# -- the lock --------------------------------------------------------------------------------


@pytest.mark.parametrize("command", sorted(set(COMMANDS) - {"example", "history"}))
def test_a_folder_that_another_run_writes_to(opamc, tmp_path, command):
    out = tmp_path / "out"
    arguments = commands_with_output(tmp_path).get(command, [])
    with output_lock(out):
        ended = opamc(command, *arguments, "--out", out)
    check_refusal(ended, ExitCode.LOCKED, str(out), "another opamc run")


# -- usage -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [["no-such-command"], ["segment"], ["segment", "--no-such-option"], ["config"], ["diagnose"]],
)
def test_usage(opamc, arguments):
    ended = opamc(*arguments)
    assert ended.code == ExitCode.USAGE
    assert "Traceback" not in ended.err


def test_a_reader_that_has_seen_enough_changes_no_exit_code(tmp_path, pair):
    command = [sys.executable, "-m", "opamc_cli", "segment", str(pair[0]), "--json"]
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write) as broken:
        ended = subprocess.run(
            [*command, "--out", str(tmp_path / "out")],
            stdout=broken,
            stderr=subprocess.PIPE,
            check=False,
        )
    # 1 would say that a joint has changed
    assert (ended.returncode, ended.stderr) == (0, b"")


@pytest.mark.long
def test_a_terminal_that_knows_no_greek_changes_no_exit_code(tmp_path):
    runs = [bad_runs.good(tmp_path / f"µ{k}.parquet", seed=k) for k in range(2)]
    arguments = ["segment", *map(str, runs), "--out", str(tmp_path / "out")]
    ended = subprocess.run(
        [sys.executable, "-m", "opamc_cli", *arguments],
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        capture_output=True,
        check=False,
    )
    assert ended.returncode == 0, ended
    assert b"?0 axis 1: 12 motions" in ended.stdout


def test_a_full_disk_leaves_nothing_half_written(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("".join(f"{k * 0.001}\n" for k in range(100_000)))
    (tmp_path / "map.yaml").write_text(MAP)

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))

    arguments = ["ingest", log, "--map", tmp_path / "map.yaml", "--out", tmp_path / "out"]
    ended = subprocess.run(
        [sys.executable, "-m", "opamc_cli", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=limit,
    )
    check_refusal(
        Ended(ended.returncode, ended.stdout, ended.stderr),
        ExitCode.USAGE,
        str(tmp_path / "out" / "log.parquet"),
        "cannot be written",
        "check space",
    )
    assert not list((tmp_path / "out").glob("*log*"))


def test_recordings_that_are_no_runs_are_said_even_if_quiet(opamc, tmp_path):
    bad_runs.good(tmp_path / "runs" / "a.parquet")
    (tmp_path / "runs" / "monday.csv").write_text("time,current\n0,1\n")
    (tmp_path / "runs" / "README.txt").write_text("of monday\n")
    ended = opamc("segment", tmp_path / "runs", "--out", tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.DONE
    (sentence,) = ended.sentences
    assert "1 recording is passed over" in sentence
    assert "monday.csv" in sentence


def test_sweep_of_delays_longer_than_any_motion(opamc, tmp_path):
    run = bad_runs.good(tmp_path / "a.parquet")
    ended = opamc("sweep", "--baseline", run, "--tau", "2000:2001", "--out", tmp_path / "out")
    check_refusal(ended, ExitCode.NOT_ENOUGH_DATA, "no motion is long enough", "delay 2000")
    assert not (tmp_path / "out" / "sweep.parquet").exists()


def test_tables_of_the_same_recordings_are_no_comparison(opamc, tmp_path):
    run = bad_runs.good(tmp_path / "a.parquet")
    for command in (("segment", run), ("identify",), ("patterns",)):
        assert opamc(*command, "--out", tmp_path / "out", "--quiet").code == ExitCode.DONE
    table = tmp_path / "out" / "patterns.parquet"
    ended = opamc("score", "--baseline", table, "--target", table, "--out", tmp_path / "scored")
    check_refusal(ended, ExitCode.BAD_INPUT, "same recording")


def test_a_recording_that_lacks_most_numbers_is_not_healthy_without_a_word(opamc, tmp_path):
    runs = [bad_runs.good(tmp_path / f"{k}.parquet", seed=k) for k in range(3)]
    table = pq.read_table(runs[2])
    columns = {}
    for name in table.column_names:
        columns[name] = table[name].to_numpy().copy()
        columns[name][len(table) // 2 :] = np.nan
    pq.write_table(pa.table(columns).replace_schema_metadata(table.schema.metadata), runs[2])
    sides = ("--baseline", runs[0], "--baseline", runs[1], "--target", runs[2])
    ended = opamc("diagnose", *sides, "--out", tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.PARTIAL
    assert [one for one in ended.sentences if "50% of the current of axis 1 is no numbers" in one]


def test_by_another_robots_baseline_or_its_tables_nobody_is_healthy(opamc, tmp_path):
    own = [bad_runs.good(tmp_path / f"{k}.parquet", seed=k) for k in range(2)]
    other = bad_runs.good(tmp_path / "other.parquet", seed=2, robot="R2")
    sides = ("--baseline", own[0], "--baseline", own[1], "--target", other)
    for command in (("diagnose", *sides), ("decide",)):
        ended = opamc(*command, "--out", tmp_path / "out", "--quiet")
        assert ended.code == ExitCode.NOT_ENOUGH_DATA
        told = "is of robot 'R2', the baseline of 'R1'"
        assert [text for text in ended.sentences if told in text]
