"""What comes with the program is there for who has only installed it."""

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from opamc_cli.__main__ import main
from opamc_cli.config.shipped import shipped_folder
from opamc_cli.storage.runs.finding import find_runs

ROOT = Path(__file__).parents[2]


def test_an_example_is_complete_and_keeps_what_is_there(tmp_path, capsys):
    folder = tmp_path / "example"
    (folder / "configs").mkdir(parents=True)
    (folder / "configs" / "model.yaml").write_text("mine")
    main_ends(["example", str(folder), "--json"])
    result = json.loads(capsys.readouterr().out)
    assert len(find_runs([folder / "normal"])) == 8
    assert len(find_runs([folder / "fault"])) == 3
    assert (folder / "configs" / "maps" / "ur_rtde.yaml").exists()
    assert (folder / "configs" / "model.yaml").read_text() == "mine"
    assert str(folder / "normal") in result["next"]


def test_an_example_that_cannot_be_written(tmp_path, capsys):
    (tmp_path / "file").write_text("mine")
    main_ends(["example", str(tmp_path / "file")], code=2)
    assert "choose another folder" in capsys.readouterr().err


def main_ends(arguments, code=0):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert int(ended.value.code or 0) == code


@pytest.mark.long
def test_a_wheel_holds_what_is_shipped(tmp_path):
    wheel = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", str(tmp_path)]
    source = tmp_path / "source"
    # a build writes into the tree it builds from
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(source)], check=True)
    built = subprocess.run([*wheel, str(source)], capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    (file,) = tmp_path.glob("*.whl")
    names = {name for name in zipfile.ZipFile(file).namelist() if "/shipped/" in name}
    for kind in ("configs", "samples"):
        folder = shipped_folder(kind)
        inside = "data/samples" if kind == "samples" else "configs"
        for shipped in folder.rglob("*.*"):
            assert f"opamc_cli/shipped/{inside}/{shipped.relative_to(folder)}" in names
