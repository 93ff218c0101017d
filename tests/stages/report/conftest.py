"""A report with everything in it, drawn once for all who look at it."""

import json
import shutil
from pathlib import Path

import output_folder
import pytest

from opamc_cli.stages.report import assemble as report

NOTE = "payload_kg differs: normal-0 has 0.0, fault-0 2.0"


def _draw(folder: Path) -> None:
    out = folder / "out"
    out.mkdir()
    output_folder.make(out)
    output_folder.add_loop(out)
    verdict = json.loads((out / "verdict.json").read_text())
    (out / "verdict.json").write_text(json.dumps(verdict | {"notes": [NOTE]}))
    omitted = report.run(out).omitted
    (folder / "omitted.json").write_text(json.dumps(omitted))


@pytest.fixture(scope="session")
def made(made_once) -> Path:
    """The output folder; its runs lie beside it, as does `omitted.json`."""
    return made_once("cell", _draw) / "out"


@pytest.fixture(scope="session")
def page(made: Path) -> str:
    return (made / "report.html").read_text(encoding="utf-8")


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A copy that may be changed."""
    shutil.copytree(made.parent, tmp_path / "cell")
    return tmp_path / "cell" / "out"
