"""Measured currents of two machines through the public commands."""

import json
from pathlib import Path

import numpy as np
import pytest

from opamc_cli.__main__ import main
from opamc_cli.errors import ExitCode
from opamc_cli.signal.motion.reported import velocity_from_position
from opamc_cli.signal.motion.signs import lacks_sign
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run

ROOT = Path(__file__).parents[2]
DATA = ROOT.parent / "shared" / "data" / "itsc_phase_current"
SCREW = ROOT.parent / "shared" / "data" / "linear_actuator"

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


@pytest.fixture(scope="module")
def screw(tmp_path_factory):
    """A ball screw, healthy, without grease, and spalled: position, unsigned current at 25 Hz."""
    if not SCREW.is_dir():
        pytest.skip(f"no measured recordings at {SCREW}")
    out = tmp_path_factory.mktemp("screw")
    for state in ("normal", "lackLubrication1", "spalling7"):
        for file in sorted((SCREW / state).glob("*.csv")):
            table = np.genfromtxt(file, delimiter=",", names=True)
            columns = {
                "axis1_current": table["current_a"].astype(np.float32),
                "axis1_position": 0.02 * table["position_mm"],
            }
            info = RunInfo(sampling_rate_hz=25.0, program="strokes")
            save_run(out / state / f"{file.stem}.parquet", info, columns)
    return out


def test_no_screws_current_is_taken_for_a_signed_one():
    """A stepper's hardly shows its inertia, and what it shows is noise."""
    if not SCREW.is_dir():
        pytest.skip(f"no measured recordings at {SCREW}")
    for file in sorted(SCREW.glob("*/*.csv")):
        table = np.genfromtxt(file, delimiter=",", names=True)
        velocity = velocity_from_position(0.02 * table["position_mm"], 25.0)
        assert lacks_sign(table["current_a"], velocity), file.parent.name


def sides(baseline, target):
    runs = [("--baseline", run) for run in baseline] + [("--target", run) for run in target]
    return [argument for pair in runs for argument in pair]


@pytest.mark.parametrize("target", [slice(0, 5), slice(5, 10), slice(0, 10, 2)])
def test_a_screw_without_grease_is_at_fault_and_its_friction_is_why(screw, tmp_path, target):
    """Which the 25 Hz of its log hardly show: an acceleration in its noise would take the name."""
    normal, dry = (sorted((screw / s).glob("*")) for s in ("normal", "lackLubrication1"))
    code = opamc("diagnose", *sides(normal[:5], dry[target]), "--out", tmp_path, "--quiet")
    assert code == ExitCode.UNHEALTHY
    axis = json.loads((tmp_path / "verdict.json").read_text())["axes"][0]
    assert axis["state"] == "fault"
    assert axis["cause"]["effect"] in ("viscous", "coulomb", "sublinear_friction")


@pytest.mark.parametrize("target", [slice(0, 5), slice(5, 10)])
def test_no_warmth_excuses_a_spalled_screw(screw, tmp_path, target):
    """Its current falls with the speed: what is fitted as viscous friction is below nought."""
    normal, spalled = (sorted((screw / s).glob("*")) for s in ("normal", "spalling7"))
    code = opamc("diagnose", *sides(normal[::2], spalled[target]), "--out", tmp_path, "--quiet")
    assert code == ExitCode.UNHEALTHY
    axis = json.loads((tmp_path / "verdict.json").read_text())["axes"][0]
    assert axis["state"] == "fault"
    assert not axis["cause"]["harmless"]


def test_a_healthy_screw_stays_healthy(screw, tmp_path):
    normal = sorted((screw / "normal").glob("*"))
    code = opamc("diagnose", *sides(normal[:5], normal[5:]), "--out", tmp_path, "--quiet")
    assert code == ExitCode.DONE
