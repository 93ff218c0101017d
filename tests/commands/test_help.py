"""What a stranger sees first: help, completion, progress, and errors that a program can read."""

import io
import json
import os
import re
import subprocess
import sys

import bad_runs
import pytest

from opamc_cli.__main__ import main
from opamc_cli.commands.command_line import COMMANDS
from opamc_cli.commands.terminal.progress import steps_shown

ALL = [[name] for name in COMMANDS] + [
    ["model", "fit"],
    ["model", "trace"],
    ["model", "close"],
    ["model", "arm"],
    ["config", "show"],
    ["config", "check"],
]
EXTRAS = ("h5py", "nptdms", "rosbags", "asammdf", "numba", "numpy", "ssqueezepy", "pyarrow")


def called(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return int(ended.value.code or 0), captured.out, captured.err


@pytest.mark.parametrize("command", ALL, ids=" ".join)
def test_help_speaks_of_files_and_numbers_not_of_types(capsys, command):
    code, out, _ = called(capsys, *command, "--help")
    assert code == 0
    assert not re.findall(r"<[a-z][^>]*>|list\[|int range|\.{4,}|\[\[|\{[A-Z]", out)


@pytest.mark.parametrize("arguments", [["--help"], ["--show-completion", "bash"]])
def test_help_and_completion_import_nothing_heavy(arguments):
    code = (
        "import sys\nfrom opamc_cli.__main__ import main\n"
        f"try: main({arguments})\nexcept SystemExit: pass\n"
        f"print([name for name in {EXTRAS} if name in sys.modules], file=sys.stderr)"
    )
    # whatever shell, or none, has started the tests
    named = os.environ | {"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    given = [sys.executable, "-c", code]
    ended = subprocess.run(given, capture_output=True, text=True, check=True, env=named)
    assert "opamc" in ended.stdout
    assert ended.stderr.strip() == "[]"


def test_errors_are_json_where_json_is_asked_for(capsys, tmp_path):
    code, out, err = called(capsys, "segment", tmp_path / "none.parquet", "--json")
    error = json.loads(out)["error"]
    assert error["exit_code"] == code == 3
    assert error["message"] in err
    code, out, _ = called(capsys, "segment", "--no-such-option", "--json")
    assert json.loads(out)["error"]["exit_code"] == code == 2
    assert "--no-such-option" in json.loads(out)["error"]["message"]
    assert called(capsys, "segment", tmp_path / "none.parquet")[1] == ""


def test_patterns_in_quotes_are_taken_where_runs_are(capsys, tmp_path):
    for seed in range(3):
        bad_runs.good(tmp_path / f"run-{seed}.parquet", seed=seed)
    out = tmp_path / "out"
    code, told, _ = called(capsys, "segment", tmp_path / "run-[12].parquet", "--out", out, "--json")
    assert code == 0
    assert {axis["run"] for axis in json.loads(told)["axes"]} == {"run-1", "run-2"}
    code, _, err = called(capsys, "segment", tmp_path / "x*.parquet", "--out", out)
    assert code == 3
    assert "nothing matches this pattern" in err


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize("quiet", [False, True])
@pytest.mark.parametrize("stream", [Terminal, io.StringIO])
def test_progress_is_for_terminals(monkeypatch, stream, quiet):
    monkeypatch.setattr(sys, "stderr", stream())
    monkeypatch.setenv("TERM", "xterm")
    with steps_shown(quiet) as steps:
        watch = steps("segment")
        for done in range(4):
            watch(done, 3)
    shown = sys.stderr.getvalue()
    assert ("segment" in shown and "left" in shown) == (stream is Terminal and not quiet)
    if quiet or stream is io.StringIO:
        assert shown == ""
