"""Where a night's results go."""

from pathlib import Path

from opamc_cli.stages.nightly.start.record import _places
from opamc_cli.stages.nightly.workers.judge import _axis
from opamc_cli.stages.nightly.workers.night import ProgramResult
from opamc_cli.storage.history.rows import told_by


def places(*programs):
    found = _places(Path("r1/n"), [ProgramResult(program) for program in programs])
    return [one.relative_to("r1/n").as_posix() for one in found]


def test_no_program_writes_over_another_or_over_a_file_of_the_night():
    assert places("lift") == ["."]
    assert places("lift", "drill") == [".", "drill"]
    assert places("drill", "lift_a", "lift/a") == [".", "lift_a_", "lift_a"]
    assert places("lift_a", "lift/a", "") == [".", "lift_a", "_"]
    assert places("lift", "verdict.json", "../up") == [".", "verdict.json_", "_up"]


def test_of_an_unhealthy_joint_the_history_keeps_what_to_do_first():
    """It kept that the current has changed, and the library's name of the effect."""
    fault = {"axis": 1, "state": "fault", "reasons": ["It has changed."]}
    assert _axis({**fault, "brief": {"inspect": "Check the grease."}}, None).reason == (
        "Check the grease."
    )
    assert _axis({**fault, "state": "healthy", "brief": None}, None).reason == "It has changed."
    assert _axis({"axis": 1, "state": "healthy", "reasons": []}, None).reason == ""


def test_of_a_joint_that_another_may_shake_the_history_keeps_which_comes_first():
    fault = {"axis": 1, "state": "fault", "brief": {"inspect": "Check the grease."}}
    marked = _axis(fault, None, (), 4).reason
    assert marked == "behind axis 4: Check the grease."
    assert told_by(f"excused: in part: {marked}") == (True, True, 4, "Check the grease.")
    assert told_by(marked).as_reason() == marked
    assert _axis(fault, None, (), 1).reason == "Check the grease."
    healthy = {"axis": 2, "state": "healthy", "reasons": ["It differs."], "excused": True}
    assert _axis(healthy, None, (), 1).reason == "excused: It differs."
