"""A recording that is given twice hides a fault: it is left out in words, or refused."""

import json
import shutil
from dataclasses import replace

import pyarrow.parquet as pq
import pytest

from opamc_cli.errors import ExitCode
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run
from tests.marks import long

pytestmark = pytest.mark.usefixtures("undrawn")


def copied(source, to):
    shutil.copyfile(source, to)


def linked(source, to):
    to.symlink_to(source)


def written_again(source, to):
    table = pq.read_table(source)
    metadata = {b"opamc": table.schema.metadata[b"opamc"].replace(b"R1", b"R2")}
    pq.write_table(table.replace_schema_metadata(metadata), to, compression="zstd")


@pytest.mark.parametrize(
    "how", [long(copied), long(linked), written_again], ids=lambda how: how.__name__
)
def test_tonights_run_is_no_baseline_of_itself(opamc, baseline, tonight, tmp_path, how):
    folder = shutil.copytree(baseline, tmp_path / "baseline")
    how(tonight, folder / "again.parquet")
    ended = opamc(
        *("diagnose", "--baseline", folder, "--target", tonight, "--out", tmp_path / "out"),
        *("--set", "joint.explain=false"),
    )
    assert ended.code == ExitCode.DONE
    assert "again.parquet is the same recording as the target's" in ended.err
    verdict = json.loads((tmp_path / "out" / "verdict.json").read_text())
    assert verdict["baseline"]["sessions"] == 3
    assert any("again.parquet" in note for note in verdict["notes"])


@pytest.mark.long
def test_a_run_twice_in_the_baseline_counts_once(opamc, baseline, tonight, tmp_path):
    folder = shutil.copytree(baseline, tmp_path / "baseline")
    copied(folder / "night-0.parquet", folder / "night-7.parquet")
    ended = opamc(
        *("diagnose", "--baseline", folder, "--target", tonight, "--out", tmp_path / "out"),
        *("--set", "joint.explain=false"),
    )
    assert "night-7.parquet is the same recording as the baseline's" in ended.err
    verdict = json.loads((tmp_path / "out" / "verdict.json").read_text())
    assert verdict["baseline"]["runs"] == ["night-0", "night-1", "night-2"]


def test_a_copy_beside_a_target_s_run_is_a_note(opamc, baseline, tonight, tmp_path):
    """Exit code 4 said that something was not judged, and nothing was lost."""
    folder = tmp_path / "target"
    folder.mkdir()
    copied(tonight, folder / "night.parquet")
    copied(tonight, folder / "night (copy).parquet")
    ended = opamc(
        *("diagnose", "--baseline", baseline, "--target", folder, "--out", tmp_path / "out"),
        *("--set", "joint.explain=false"),
    )
    assert ended.code == ExitCode.DONE
    assert "is the same recording as the target's" in ended.err
    assert "; nothing is missing by it" in ended.err
    assert len(json.loads((tmp_path / "out" / "verdict.json").read_text())["target"]["runs"]) == 1


def begun(source, to, started_at):
    """Write the same samples with another time, as a logger that is stuck does."""
    with Run(source) as run:
        save_run(to, replace(run.info, started_at=started_at), run.read(run.columns))


def test_samples_of_the_baseline_with_another_time_are_no_night(opamc, baseline, tonight, tmp_path):
    folder, at = tmp_path / "target", ("--out", tmp_path / "out", "--set", "joint.explain=false")
    folder.mkdir()
    begun(baseline / "night-1.parquet", folder / "stuck.parquet", "2026-03-20T22:00:00Z")
    ended = opamc("diagnose", "--baseline", baseline, "--target", folder, *at, "--quiet")
    assert ended.code == ExitCode.BAD_INPUT
    (sentence,) = ended.sentences
    assert "stuck.parquet: left out, its samples are those of the baseline's" in sentence
    copied(tonight, folder / "tonight.parquet")
    copied(tonight, folder / "twice.parquet")
    begun(tonight, folder / "tonight-again.parquet", "2026-03-20T22:00:00Z")
    ended = opamc("diagnose", "--baseline", baseline, "--target", folder, *at, "--quiet")
    assert ended.code == ExitCode.PARTIAL
    first, second = ended.sentences
    assert "tonight-again.parquet: left out, its samples are those of" in first
    assert second == sentence
    verdict = json.loads((tmp_path / "out" / "verdict.json").read_text())
    assert "twice.parquet is the same recording as the target's" in "".join(verdict["notes"])
    assert verdict["baseline"]["runs"] == ["night-0", "night-1", "night-2"]
    assert verdict["target"]["runs"] == ["tonight"]


def test_a_run_against_itself_is_refused(opamc, tonight, tmp_path):
    ended = opamc("diagnose", "--baseline", tonight, "--target", tonight, "--out", tmp_path / "out")
    assert ended.code == ExitCode.BAD_INPUT
    assert "a baseline needs other recordings" in ended.sentences[0]


def test_a_run_of_the_folder_of_the_baseline_is_judged_by_the_others(opamc, baseline, tmp_path):
    """The very same path on both sides was left out of both: a bug, or a night that nobody saw."""
    ended = opamc(
        *("diagnose", "--baseline", baseline, "--target", baseline / "night-2.parquet"),
        *("--out", tmp_path / "out", "--set", "joint.explain=false"),
    )
    assert ended.code == ExitCode.DONE, ended
    verdict = json.loads((tmp_path / "out" / "verdict.json").read_text())
    assert verdict["baseline"]["runs"] == ["night-0", "night-1"]
    assert verdict["target"]["runs"] == ["night-2"]
