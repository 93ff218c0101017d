"""Measured phase currents through the public commands."""

import json
from pathlib import Path

import pytest

from opamc_cli.__main__ import main
from opamc_cli.errors import ExitCode

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "itsc_phase_current"

pytestmark = [
    pytest.mark.usefixtures("undrawn"),
    pytest.mark.long,
    pytest.mark.measured,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no measured recordings at {DATA}"),
]


def opamc(*arguments):
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return end.value.code


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Five healthy runs, and five with 40 % of phase A's turns shorted."""
    out = tmp_path_factory.mktemp("itsc")
    for group, pattern in (("healthy", "*.csv"), ("fault", "SC_A4_*.csv")):
        files = sorted((DATA / group).glob(pattern))
        assert len(files) == 5
        mapped = ("--map", ROOT / "configs" / "maps" / "itsc.yaml", "--out", out / group)
        assert opamc("ingest", *files, *mapped, "--quiet") == ExitCode.DONE
    return out


def test_the_highest_level_of_short_circuit_is_found(recordings, tmp_path):
    code = opamc(
        *("diagnose", "--baseline", recordings / "healthy", "--target", recordings / "fault"),
        *("--out", tmp_path, "--quiet"),
    )
    assert code == ExitCode.UNHEALTHY
    axis = json.loads((tmp_path / "verdict.json").read_text())["axes"][0]
    assert axis["state"] in ("changed", "fault")
    assert axis["p_value"] < 0.01


@pytest.mark.parametrize("left_out", range(5))
def test_a_healthy_recording_left_out_stays_healthy(recordings, tmp_path, left_out):
    runs = sorted((recordings / "healthy").glob("*.parquet"))
    target = runs.pop(left_out)
    baseline = [argument for run in runs for argument in ("--baseline", run)]
    code = opamc("diagnose", *baseline, "--target", target, "--out", tmp_path, "--quiet")
    assert code == ExitCode.DONE
    axis = json.loads((tmp_path / "verdict.json").read_text())["axes"][0]
    assert axis["state"] == "healthy"
