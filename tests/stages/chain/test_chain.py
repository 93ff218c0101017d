"""The stages from file to file, on the samples that come with the project."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from opamc_cli.config import load_config
from opamc_cli.errors import InputError
from opamc_cli.signal.ordinal.patterns import time_delay
from opamc_cli.stages.chain import identify, patterns, segment
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.recordings.envelope import current_offset, read_envelope
from opamc_cli.stages.recordings.identified import aligned_span, turning_motions
from opamc_cli.stages.tuning import sweep
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.tables import record_at

SAMPLES = Path(__file__).parents[3] / "data" / "samples"
NORMAL, FAULT = SAMPLES / "normal", SAMPLES / "fault"
ONE = NORMAL / "session-000.parquet"


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    out = tmp_path_factory.mktemp("chain")
    return out, run_chain([NORMAL], load_config(), out)


def true_segments(folder):
    truth = json.loads((folder / "truth.json").read_text())
    return {
        Path(run["run"]).stem: [s for s in run["segments"] if s["axis"] in (1, 2, 3)]
        for run in truth["runs"]
    }


def n_cycles(folder):
    return 1 + max(s["cycle"] for run in true_segments(folder).values() for s in run)


def test_every_motion_of_the_truth_is_found_and_numbered(chain):
    _, outcome = chain
    found = pq.read_table(outcome.motions).to_pylist()
    error = []
    for run, segments in true_segments(NORMAL).items():
        for axis in (1, 2, 3):
            true = [s for s in segments if s["axis"] == axis]
            mine = [row for row in found if row["run"] == run and row["axis"] == axis]
            assert len(mine) == len(true)
            assert [row["cycle"] for row in mine] == [s["cycle"] for s in true]
            assert [row["motion"] for row in mine] == [s["motion"] for s in true]
            error += [
                abs(row["start"] - s["start"]) / 2048 for row, s in zip(mine, true, strict=True)
            ]
            error += [
                abs(row["stop"] - s["stop"]) / 2048 for row, s in zip(mine, true, strict=True)
            ]
    assert np.median(error) <= 0.020


def test_segments_are_cut_like_their_reference(chain):
    _, outcome = chain
    for row in pq.read_table(outcome.motions).to_pylist():
        start, stop = aligned_span(row)
        assert stop - start == row["reference_samples"]
        assert start == row["start"] + row["lag"]
        if row["reference"]:
            assert (row["lag"], start, stop) == (0, row["start"], row["stop"])


def test_counts_are_those_of_the_envelope_itself(chain):
    _, outcome = chain
    motions = pq.read_table(outcome.motions).to_pylist()
    rows = [r for r in pq.read_table(outcome.patterns).to_pylist() if r["run"] == ONE.stem][:8]
    with Run(ONE) as run:
        for row in rows:
            same = [m for m in motions if (m["run"], m["axis"]) == (row["run"], row["axis"])]
            offset = current_offset(run, row["axis"], turning_motions(same))
            assert 0 < abs(offset) < 0.5
            values = read_envelope(run, row["axis"], row["start"], row["stop"], offset=offset)
            assert row["tau"] == time_delay(2048, row["f_max_hz"], row["order"], 2.0)
            n = row["stop"] - row["start"] - (row["order"] - 1) * row["tau"]
            assert row["n_patterns"] == n == sum(row["counts"])
            ascending = np.all(
                [
                    values[k * row["tau"] :][:n] <= values[(k + 1) * row["tau"] :][:n]
                    for k in range(row["order"] - 1)
                ],
                axis=0,
            )
            assert row["counts"][0] == ascending.sum()


@pytest.mark.long
def test_each_stage_alone_gives_the_same_bytes(tmp_path):
    config, runs = load_config(), [ONE, NORMAL / "session-001.parquet"]
    outcome = run_chain(runs, config, tmp_path)
    before = {p.name: p.read_bytes() for p in tmp_path.glob("*.parquet")}
    segment.run(runs, config, tmp_path)
    identify.run(outcome.segments, config, tmp_path)
    patterns.run(outcome.motions, config, tmp_path, jobs=2)
    assert {p.name: p.read_bytes() for p in tmp_path.glob("*.parquet")} == before


@pytest.mark.parametrize(
    ("stage", "setting", "other"),
    [
        ("segment", "segment.min_motion_s=0.11", "patterns.gamma=1"),
        ("identify", "identify.min_similarity=0.8", "segment.min_motion_s=0.11"),
        ("patterns", "patterns.gamma=1", "score.base=10"),
    ],
)
def test_a_changed_key_changes_the_hash_of_its_stage_alone(chain, tmp_path, stage, setting, other):
    _, outcome = chain
    source = {"segment": [ONE], "identify": outcome.segments, "patterns": outcome.motions}[stage]
    run = {"segment": segment.run, "identify": identify.run, "patterns": patterns.run}[stage]
    hashes = [
        record_at(run(source, load_config(None, overrides), tmp_path).path)["config_hash"]
        for overrides in ([], [setting], [other])
    ]
    assert hashes[0] != hashes[1]
    assert hashes[0] == hashes[2]


def test_provenance_names_the_inputs(chain):
    _, outcome = chain
    record = record_at(outcome.motions)
    assert record["stage"] == "identify"
    assert [entry["path"] for entry in record["inputs"]] == ["segments.parquet"]


def test_a_run_that_has_changed_is_refused(tmp_path):
    copy = tmp_path / "run.parquet"
    copy.write_bytes(ONE.read_bytes())
    outcome = segment.run([copy], load_config(), tmp_path)
    copy.write_bytes((NORMAL / "session-001.parquet").read_bytes())
    with pytest.raises(InputError, match="has changed since its segments were found"):
        identify.run(outcome.path, load_config(), tmp_path)
    copy.unlink()
    with pytest.raises(InputError, match="no longer there"):
        identify.run(outcome.path, load_config(), tmp_path)


def test_moved_runs_are_found_by_name(tmp_path):
    first, second = tmp_path / "a", tmp_path / "b"
    first.mkdir()
    second.mkdir()
    (first / "run.parquet").write_bytes(ONE.read_bytes())
    outcome = segment.run([first], load_config(), tmp_path)
    (first / "run.parquet").rename(second / "run.parquet")
    identified = identify.run(outcome.path, load_config(), tmp_path, moved_to=[second])
    assert set(identified.cycles().values()) == {(n_cycles(NORMAL), 0)}


def test_the_reference_may_come_from_another_table(chain, tmp_path):
    _, outcome = chain
    segmented = segment.run([FAULT], load_config(), tmp_path)
    found = identify.run(segmented.path, load_config(), tmp_path, reference=outcome.motions)
    rows = found.table.to_pylist()
    assert not any(row["reference"] for row in rows)
    assert {row["cycle"] for row in rows} == set(range(n_cycles(FAULT)))
    references = {
        (row["axis"], row["motion"]): row["reference_f_max_hz"]
        for row in pq.read_table(outcome.motions).to_pylist()
        if row["reference"]
    }
    assert all(row["reference_f_max_hz"] == references[row["axis"], row["motion"]] for row in rows)


def test_sweep_separates_the_damaged_axis_alone(chain, tmp_path):
    _, outcome = chain
    target = run_chain([FAULT], load_config(), tmp_path / "t", reference=outcome.motions)
    swept = sweep.run(
        outcome.motions,
        load_config(),
        tmp_path,
        taus=range(1, 9),
        orders=(4, 5),
        target=target.motions,
    )
    best = {(b["axis"], b["order"]): b for b in swept.best()}
    for order in (4, 5):
        assert best[3, order]["ks"] > 0.95
        gap = {a: best[a, order]["jsd_target"] - best[a, order]["jsd_baseline"] for a in (1, 2, 3)}
        assert gap[3] > 5 * max(abs(gap[1]), abs(gap[2]))


@pytest.mark.parametrize("f_max_hz", [0.0, np.nan])
def test_a_segment_that_turns_at_no_frequency_is_no_motion(tmp_path, chain, f_max_hz):
    _, outcome = chain
    table = pq.read_table(outcome.segments)
    values = table["f_max_hz"].to_numpy().copy()
    values[0] = f_max_hz
    at = table.schema.get_field_index("f_max_hz")
    odd = table.set_column(at, table.schema.field(at), pa.array(values))
    path = outcome.segments.parent / "odd.parquet"
    pq.write_table(odd, path)
    found = identify.run(path, load_config(), tmp_path).table.to_pylist()
    assert found[0]["motion"] == -1
    assert max(row["cycle"] for row in found) == max(
        row["cycle"] for row in pq.read_table(outcome.motions).to_pylist()
    )
