"""What users get wrong: one sentence, the right exit code, nothing half-written."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bad_runs
import pytest

from opamc_cli.app import main
from opamc_cli.commands import COMMANDS
from opamc_cli.errors import ExitCode

ROOT = Path(__file__).parents[2]
MAP = "sampling_rate_hz: 10\nheader: false\ncolumns: {axis1_a: {source: 0, unit: A}}\n"


@dataclass(frozen=True)
class Ended:
    code: int
    out: str
    err: str

    @property
    def sentences(self) -> list[str]:
        return [line for line in self.err.splitlines() if line.startswith("opamc: ")]


@pytest.fixture
def opamc(capsys) -> Callable[..., Ended]:
    def call(*arguments: object) -> Ended:
        capsys.readouterr()
        code = 0
        try:
            main([str(a) for a in arguments])
        except SystemExit as ended:
            code = int(ended.code or 0)
        captured = capsys.readouterr()
        return Ended(code, captured.out, captured.err)

    return call


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
    # a sentence, not a paragraph
    assert len(sentence) < 400


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
        ("patterns.gamma=[", "the value is not YAML"),
        ("patterns.gamma.x=1", "patterns.gamma"),
        ("=1", "write it as key=value"),
    ],
)
def test_config_overrides(opamc, override, part):
    check_refusal(opamc("config", "check", "--set", override), ExitCode.USAGE, part)


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
    }


@pytest.mark.parametrize(
    "command",
    ["ingest", "segment", "identify", "patterns", "score", "diagnose", "sweep", "simulate"],
)
@pytest.mark.parametrize("which", range(3))
def test_unwritable_outputs(opamc, tmp_path, command, which):
    if command not in COMMANDS:
        pytest.skip(f"no command {command}")
    out = unusable_outputs(tmp_path)[which]
    arguments = commands_with_output(tmp_path)[command]
    ended = opamc(command, *arguments, "--out", out)
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
        (bad_runs.folder, "is a folder"),
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
