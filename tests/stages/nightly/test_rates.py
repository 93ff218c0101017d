"""A logger that writes the rate it measured has one clock, not a condition for each night."""

import shutil
from dataclasses import replace
from itertools import permutations

import nightly_kills
import pytest
from cell_logs import night

from opamc_cli.errors import ExitCode
from opamc_cli.stages.nightly.inputs.one_rate import at_named_rates, named_rates
from opamc_cli.stages.nightly.inputs.recordings import Recording
from opamc_cli.storage.logs import Facts, LogFile
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run


@pytest.fixture
def logs(cell, here):
    """The logs of one robot of a cell whose nights are all healthy."""
    for name in ("r2", "r3"):
        shutil.rmtree(cell.parent / "logs" / name)
    with nightly_kills.with_stand_in():
        yield cell.parent / "logs"


def set_rate(path, rate_hz):
    """Have a recording say another rate."""
    with Run(path) as run:
        info, columns = replace(run.info, sampling_rate_hz=rate_hz), run.read(run.columns)
    save_run(path, info, columns)


def recorded(index, rate_hz):
    log = LogFile(f"logs/r1/{night(index)}/cycle.parquet", "r1", night(index), 1, 1)
    return Recording(log, night(index), str(index), Facts("cycle", sampling_rate_hz=rate_hz))


def conditions(pinned, recordings):
    return [one.condition for one in at_named_rates(recordings, named_rates(pinned, recordings))]


def test_measured_rates_are_one_condition_with_a_baseline(cell, logs, opamc):
    for index in range(5):
        set_rate(logs / "r1" / night(index) / "cycle.parquet", 2048 + 0.03 * index)
    ended = opamc("nightly", cell)
    assert ended.code == ExitCode.DONE
    assert "1 robot healthy" in ended.out
    assert "baseline" not in ended.out
    assert "0 nights to be done" in opamc("nightly", cell, "--dry-run").out


@pytest.mark.long
def test_a_rate_that_is_another_has_no_baseline(cell, logs, opamc):
    set_rate(logs / "r1" / night(4) / "cycle.parquet", 2048 * 1.0012)
    said = opamc("nightly", cell, "--quiet").out
    assert "nights at 2050.46 Hz, 100 %, 0 kg are not judged, they have no baseline yet" in said


def test_no_boundary_parts_a_clock_and_no_later_night_renames_it():
    rates = [199.99, 200.0, 200.06, 199.95, 200.15, 200.3]
    nights = [recorded(index, rate) for index, rate in enumerate(rates)]
    known = conditions((), nights)
    assert known == [*["199.99 Hz"] * 5, "200.3 Hz"]
    for count in range(1, len(nights)):
        assert conditions((), nights[:count]) == known[:count]
    for some in permutations(nights[:4]):
        assert conditions((), some) == known[:4]
    # nights that are filled in before those of a baseline that was complete take its name
    assert conditions(("199.99 Hz",), [*nights[1:], recorded(0, 199.9)]) == [*known[1:], known[0]]


def test_what_names_no_rate_is_left_alone():
    broken = replace(recorded(0, None), facts=Facts(error="half a file"))
    assert at_named_rates([broken], named_rates(("70 %",), [broken])) == [broken]
