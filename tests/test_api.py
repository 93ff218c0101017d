"""The stages from Python: what docs/method.md shows, and what a caller gets wrong."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import opamc_cli
from opamc_cli.errors import InputError, LockedError, UsageError
from opamc_cli.storage.files.lock import output_lock
from opamc_cli.storage.schemas.tables import MOTIONS, PATTERNS, SEGMENTS

ROOT = Path(__file__).parents[1]
GUIDE = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
ONE = ROOT / "data" / "samples" / "normal" / "session-000.parquet"


def test_every_function_is_in_the_guide():
    assert set(re.findall(r"^\| `(\w+)\(", GUIDE, re.MULTILINE)) == set(opamc_cli.__all__)


def test_asking_for_nothing_loads_nothing():
    code = "import sys, opamc_cli; assert not {'numpy', 'pyarrow', 'typer'} & sys.modules.keys()"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = opamc_cli.nonsense


@pytest.mark.long
def test_the_guides_example_runs(tmp_path, monkeypatch):
    pytest.importorskip("pandas", reason="the guide shows data frames")
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(tmp_path)
    on_arrays, example = re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL)
    names: dict[str, object] = {}
    exec(compile(on_arrays, "docs/method.md", "exec"), names)
    assert [len(cycles) for cycles in names["normal"]] == [2, 3, 3, 3, 3, 3, 3, 3]
    assert all(one.delta_mu > 0.03 and one.ks > 0.7 for one in names["separation"])
    exec(compile(example, "docs/method.md", "exec"), names)
    assert names["verdict"]["state"].to_dict() == {1: "healthy", 2: "healthy", 3: "fault"}
    assert names["verdict"].loc[3, "cause"] == "ripple"
    assert names["features"].groupby("axis")["delta_mu"].max().idxmax() == 3
    (step,) = names["loop"].axes[0]["steps"]  # a line of each electrical turn, of 0.06 A in 0.21
    assert (step["effect"], step["ties"]) == ("sensor_offset", ["ripple"])
    assert (tmp_path / "opamc-out" / "report.html").is_file()


def test_stages_follow_each_other_in_a_folder(tmp_path):
    settings = {"patterns.gamma": 1}
    assert opamc_cli.segment(str(ONE), out=tmp_path).table.schema.names == SEGMENTS.names
    assert opamc_cli.identify(out=tmp_path).table.schema.names == MOTIONS.names
    counted = opamc_cli.patterns(out=tmp_path, settings=settings)
    assert counted.table.schema.names == PATTERNS.names
    assert set(counted.table["gamma"].to_pylist()) == {1.0}
    assert opamc_cli.read_table(counted.path).table.equals(counted.table)


def test_a_run_knows_its_columns(tmp_path):
    run = opamc_cli.read_run(ONE, ["axis1_a", "axis3_b"])
    assert run.table.column_names == ["axis1_a", "axis3_b"]
    assert run.info.sampling_rate_hz == 2048
    with pytest.raises(InputError, match="axis9_a"):
        opamc_cli.read_run(ONE, ["axis9_a"])


def test_what_a_command_refuses_is_raised(tmp_path):
    with pytest.raises(UsageError, match="did you mean 'gamma'"):
        opamc_cli.patterns(out=tmp_path, settings={"patterns.gama": 1})
    with pytest.raises(InputError, match="is a run"):
        opamc_cli.read_table(ONE)
    with output_lock(tmp_path), pytest.raises(LockedError):
        opamc_cli.segment(ONE, out=tmp_path)


def test_what_a_notebook_has_at_hand_is_taken(tmp_path):
    settings = {"segment.min_motion_s": np.float32(0.25), "segment.windows": np.int64(3)}
    cut = opamc_cli.segment(ONE, out=tmp_path, settings=settings)
    assert cut.table.num_rows > 0
    assert opamc_cli.read_run(ONE, "axis3_a").table.column_names == ["axis3_a"]
    with pytest.raises(InputError, match="no run was named"):
        opamc_cli.segment([], out=tmp_path)
