"""What is kept of a baseline's files: the same bytes, computed once, and never believed damaged."""

from pathlib import Path

import pytest

from opamc_cli.config import load_config
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.processes.kept import KeptResults
from opamc_cli.stages.verdict.agreement import duplicates
from opamc_cli.storage.runs.run import Run

SAMPLES = Path(__file__).parents[3] / "data" / "samples" / "normal"
RUNS = [SAMPLES / f"session-{i:03d}.parquet" for i in range(3)]


def tables(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.parquet"))}


@pytest.fixture(scope="module")
def kept_and_plain(tmp_path_factory):
    folder = tmp_path_factory.mktemp("kept")
    config = load_config(None)
    run_chain(RUNS, config, folder / "plain")
    kept = KeptResults(folder / "results")
    run_chain(RUNS[:2], config, folder / "first", kept=kept)
    return folder, config, kept


def files_of(kept: KeptResults) -> set[Path]:
    return {path for path in kept.folder.rglob("*") if path.is_file()}


def test_an_added_run_costs_that_run_and_the_tables_are_the_same(kept_and_plain):
    folder, config, kept = kept_and_plain
    before = files_of(kept)
    run_chain(RUNS, config, folder / "again", kept=kept)
    added = files_of(kept) - before
    # two runs of three axes, three stages and the places; what follows on the segments as a whole
    assert len(before) == 2 * 3 * 4 + 1
    assert len(added) == 3 * 4 + 1
    assert tables(folder / "again") == tables(folder / "plain")


def test_nothing_is_computed_twice(kept_and_plain, monkeypatch):
    folder, config, kept = kept_and_plain
    once = run_chain(RUNS[:2], config, folder / "once", kept=kept)
    plain = run_chain(RUNS[:2], config, folder / "neither")

    def fail(*_: object) -> None:
        pytest.fail("computed again")

    monkeypatch.setattr(KeptResults, "keep", fail)
    twice = run_chain(RUNS[:2], config, folder / "twice", kept=kept)
    assert tables(folder / "twice") == tables(folder / "once") == tables(folder / "neither")
    assert twice.notes == once.notes == plain.notes
    assert twice.runs_done == once.runs_done == plain.runs_done


def test_who_is_left_out_makes_another_baseline(kept_and_plain, tmp_path):
    _, config, kept = kept_and_plain
    lacking = [("session-001", 2)]
    for folder, where in (("kept", kept), ("plain", None)):
        run_chain(RUNS[:2], config, tmp_path / folder, check=lambda _: lacking, kept=where)
    assert tables(tmp_path / "kept") == tables(tmp_path / "plain")
    whole = run_chain(RUNS[:2], config, tmp_path / "whole", kept=kept)
    assert whole.motions.read_bytes() != (tmp_path / "kept" / "motions.parquet").read_bytes()


def test_other_options_are_other_results(kept_and_plain, tmp_path):
    _, _, kept = kept_and_plain
    before = files_of(kept)
    other = load_config(None, ["patterns.orders=[3]"])
    run_chain(RUNS[:1], other, tmp_path, kept=kept)
    assert files_of(kept) - before
    score_alone = load_config(None, ["patterns.orders=[3]", "score.minimum_effect=0.2"])
    before = files_of(kept)
    run_chain(RUNS[:1], score_alone, tmp_path, kept=kept)
    assert files_of(kept) == before


def test_a_damaged_result_is_computed_again(kept_and_plain):
    folder, config, kept = kept_and_plain
    for path in files_of(kept):
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 1
        path.write_bytes(content)
    run_chain(RUNS, config, folder / "mended", kept=kept)
    assert tables(folder / "mended") == tables(folder / "plain")


def test_a_job_that_cannot_be_told_from_others_is_refused(tmp_path):
    with pytest.raises(TypeError, match="cannot be told"):
        KeptResults(tmp_path).find(len, object())


def test_a_baselines_runs_are_read_once_to_be_told_apart(tmp_path, monkeypatch):
    copy = tmp_path / "copy.parquet"
    copy.write_bytes(RUNS[0].read_bytes())
    sides = [*RUNS[:2], copy], [RUNS[2]]
    kept = KeptResults(tmp_path / "results")
    first = duplicates.repeated(*sides, kept)
    assert first == duplicates.repeated(*sides)
    assert (len(first.baseline), len(first.target)) == (1, 0)
    opened: list[Path] = []

    def opening(path: Path) -> Run:
        opened.append(path)
        return Run(path)

    monkeypatch.setattr(duplicates, "Run", opening)
    assert duplicates.repeated(*sides, kept) == first
    assert opened == [RUNS[2]]
