"""What a fault's first night asks of the baseline is found with it, and changes no byte."""

import json
import shutil
from pathlib import Path

import cell_logs
import pytest

from opamc_cli.errors import ExitCode, InputError
from opamc_cli.stages.model import kept_tracks
from opamc_cli.stages.nightly.start import run as start
from opamc_cli.stages.nightly.workers import ahead
from opamc_cli.stages.nightly.workers.workers import called
from opamc_cli.stages.report.figures import motion_signal
from opamc_cli.stages.verdict import cause
from tests.marks import long

HEALTHY, FAULTY = cell_logs.night(3), cell_logs.night(4)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    """One robot: three nights of baseline, a healthy one, and one whose axis 2 is at fault."""
    folder = tmp_path_factory.mktemp("ahead")
    cell = cell_logs.record_cell(folder, 1, 5, {0: [0.0, 0.0, 0.0, 0.0, 1.0]})
    cell.write_text(cell.read_text().replace("nights: 2", "nights: 3"))
    return folder


@pytest.fixture
def cell(recorded, tmp_path, monkeypatch) -> Path:
    """Nights of it are judged in this process."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1772000000")
    monkeypatch.setattr(
        start, "run_all", lambda name, works, *_, **__: [(w, called(name)(w)) for w in works]
    )
    shutil.copytree(recorded, tmp_path / "cell")
    return tmp_path / "cell" / "cell.yaml"


def written(cell: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(cell.parent)): path.read_bytes()
        for path in (cell.parent / "nightly" / "r1").glob("*/*")
    }


@pytest.mark.long
def test_a_fault_finds_what_it_asks_for_and_no_byte_is_another(cell, opamc, monkeypatch):
    opamc("nightly", cell, "--night", HEALTHY, "--quiet")
    with monkeypatch.context() as patch:
        patch.setattr(kept_tracks, "follow", lambda *_: pytest.fail("followed again"))
        patch.setattr(motion_signal, "finish", lambda *_: pytest.fail("drawn again"))
        patch.setattr(ahead, "_follow", lambda *_: pytest.fail("looked ahead again"))
        opamc("nightly", cell, "--night", FAULTY, "--quiet")
    found = written(cell)
    assert len(found) == 4
    assert json.loads(found[f"nightly/r1/{FAULTY}/verdict.json"])["axes"][1]["cause"]["effect"]
    assert b"Motion signal of axis 2" in found[f"nightly/r1/{FAULTY}/report.html"]
    shutil.rmtree(cell.parent / "nightly")
    monkeypatch.setattr("opamc_cli.stages.nightly.workers.judge.look_ahead", lambda *_: None)
    opamc("nightly", cell, "--quiet")
    assert written(cell) == found


@pytest.mark.parametrize("error", [ValueError("odd"), long(InputError("odd")), long(MemoryError())])
def test_what_cannot_be_found_ahead_costs_no_night(cell, opamc, monkeypatch, error):
    def fail(*_: object) -> None:
        asked.append(error)
        raise error

    asked: list[Exception] = []
    monkeypatch.setattr(cause, "follow_baseline", fail)
    monkeypatch.setattr(ahead, "draw_baseline", fail)
    assert opamc("nightly", cell, "--night", HEALTHY, "--quiet").code == ExitCode.DONE
    assert len(asked) == 3  # of two joints and their drawings
    assert len(written(cell)) == 2
    shutil.rmtree(cell.parent / "nightly" / "r1")
    opamc("nightly", cell, "--night", HEALTHY, "--quiet")
    assert len(asked) == 3  # nor again and again


@pytest.mark.long
def test_long_motions_are_left_to_who_asks_for_them(cell, opamc, monkeypatch):
    monkeypatch.setattr(ahead, "MOST_SAMPLES", 100)
    monkeypatch.setattr(cause, "follow_baseline", lambda *_: pytest.fail("followed"))
    assert opamc("nightly", cell, "--night", HEALTHY, "--quiet").code == ExitCode.DONE


@pytest.mark.long
def test_who_wants_no_causes_is_spared(cell, opamc, monkeypatch):
    monkeypatch.setattr(ahead, "_follow", lambda *_: pytest.fail("looked ahead"))
    cell.write_text(cell.read_text() + "set: {joint.explain: false}\n")
    assert opamc("nightly", cell, "--night", HEALTHY, "--quiet").code == ExitCode.DONE
