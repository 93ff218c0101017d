"""Where a night's results go."""

from pathlib import Path

from opamc_cli.stages.nightly.start.record import _places
from opamc_cli.stages.nightly.workers.night import ProgramResult


def places(*programs):
    found = _places(Path("r1/n"), [ProgramResult(program) for program in programs])
    return [one.relative_to("r1/n").as_posix() for one in found]


def test_no_program_writes_over_another_or_over_a_file_of_the_night():
    assert places("lift") == ["."]
    assert places("lift", "drill") == [".", "drill"]
    assert places("drill", "lift_a", "lift/a") == [".", "lift_a_", "lift_a"]
    assert places("lift_a", "lift/a", "") == [".", "lift_a", "_"]
    assert places("lift", "verdict.json", "../up") == [".", "verdict.json_", "_up"]
