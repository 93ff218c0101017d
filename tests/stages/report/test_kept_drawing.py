"""A drawing of the baseline alone, kept: the same page, and drawn once for many a night."""

from dataclasses import replace

import pytest

from opamc_cli.config.models import SegmentConfig
from opamc_cli.stages.processes.kept import KeptResults
from opamc_cli.stages.report import assemble as report
from opamc_cli.stages.report.figures import motion_signal
from opamc_cli.stages.report.results.inputs import read_inputs


@pytest.mark.long
def test_the_page_is_the_same_and_the_baseline_is_drawn_once(folder, page, tmp_path, monkeypatch):
    kept = KeptResults(tmp_path / "kept")
    for _ in range(2):
        report.run(folder, kept=kept)
        assert (folder / "report.html").read_text(encoding="utf-8") == page
        monkeypatch.setattr(motion_signal, "finish", lambda *_: pytest.fail("drawn again"))


def test_whatever_is_drawn_from_another_cycle_is_another_drawing(made, tmp_path):
    kept = KeptResults(tmp_path)
    inputs = read_inputs(made, {"baseline": [], "target": []})
    source = inputs.roles["baseline"].sources[0]
    cycle = motion_signal._Cycle(
        source, 1, ((0, 9), (20, 30)), (0, 1), False, False, "current (A)", SegmentConfig(), "3.10"
    )
    others = {
        "run": replace(source, sha256="0" * 64),
        "axis": 2,
        "spans": ((0, 9), (20, 31)),
        "numbers": (0, 2),
        "windows": True,
        "reported": True,
        "quantity": "torque (Nm)",
        "config": SegmentConfig(voices_per_octave=9),
        "drawn_by": "3.11",
    }
    assert set(others) == set(motion_signal._Cycle.__dataclass_fields__)
    jobs = [cycle, *(replace(cycle, **{k: v}) for k, v in others.items())]
    assert len({kept._path(motion_signal._drawn, job) for job in jobs}) == len(jobs)
