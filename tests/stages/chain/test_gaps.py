"""A gap in a current that spans the end of a motion cuts it, as a recording's edge does."""

import numpy as np
import pyarrow.parquet as pq
import pytest
from carriers import Move, record

from opamc_cli.config import load_config
from opamc_cli.stages.chain import segment
from opamc_cli.stages.chain.segments.rows import Flags, lost_spans
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run

RATE_HZ = 2048.0
MOVES = [Move(157, 1), Move(150, -1), Move(140, 1), Move(150, -1)]
"""So alike that a cycle would fit from every second motion on."""


def recording(path, seed, cycles, gap=None):
    made = record(MOVES * cycles, noise=0.02, seed=seed)
    phases = made.phases.copy()
    if gap is not None:
        phases[:, made.intervals[gap][1] - 300 : made.intervals[gap + 1][0] + 300] = np.nan
    values = {f"axis1_{name}": x for name, x in zip("abc", phases, strict=True)}
    save_run(path, RunInfo(sampling_rate_hz=RATE_HZ), values)
    return made.intervals


@pytest.mark.parametrize(
    ("cycles", "gap", "whole"), [(2, 3, []), (3, 3, [8]), (4, 5, [0, 8, 12]), (3, 0, [4, 8])]
)
def test_what_a_gap_cuts_is_in_no_cycle_and_none_reaches_across(tmp_path, cycles, gap, whole):
    for seed in range(2):
        recording(tmp_path / f"baseline/{seed}.parquet", seed, 3)
    intervals = recording(tmp_path / "target/1.parquet", 9, cycles, gap)
    reference = run_chain([tmp_path / "baseline"], load_config(), tmp_path / "b").motions
    found = run_chain([tmp_path / "target"], load_config(), tmp_path / "t", reference=reference)
    middles = np.mean(intervals, axis=1)
    members = {}
    for row in pq.read_table(found.motions).to_pylist():
        which = int(np.argmin(np.abs(middles - (row["start"] + row["stop"]) / 2)))
        assert row["edge"] == (which in (gap, gap + 1))
        if row["cycle"] >= 0:
            members.setdefault(row["cycle"], []).append((row["motion"], which))
    assert list(members.values()) == [[(m, first + m) for m in range(4)] for first in whole]


def reciprocating():
    """Motions of one second, from samples 150, 550, 950 and so on: position and current."""
    stroke = 0.5 - 0.5 * np.cos(np.pi * np.arange(250) / 250)
    there = [np.zeros(150), stroke, np.ones(150), 1 - stroke]
    position = np.concatenate([*there * 4, np.zeros(150)])
    speed = np.gradient(position) * 250
    rng = np.random.default_rng(4)
    return position, np.tanh(speed / 0.02) + 0.5 * speed + 0.01 * rng.normal(size=speed.size)


def cut_motions(tmp_path, position, current):
    values = {"axis1_current": current, "axis1_position": position}
    save_run(tmp_path / "run.parquet", RunInfo(sampling_rate_hz=250.0), values)
    outcome = segment.run([tmp_path / "run.parquet"], load_config(), tmp_path / "out")
    edges = outcome.table["edge"].to_pylist()
    return [i for i, edge in enumerate(edges) if edge], outcome.missing["run", 1]


@pytest.mark.parametrize(
    ("channel", "first", "n", "cut"),
    [
        (0, 930, 60, [2]),  # of the position, spans a start
        (0, 1190, 180, [2, 3]),  # spans a rest
        (1, 1070, 60, [2]),  # of the current, amid a motion
        (1, 850, 60, []),  # at rest
    ],
)
def test_so_does_a_gap_in_what_tells_the_motion(tmp_path, channel, first, n, cut):
    channels = reciprocating()
    channels[channel][first : first + n] = np.nan
    assert cut_motions(tmp_path, *channels) == (cut, n)


@pytest.mark.parametrize(("n", "cut"), [(21, [2]), (20, [])])
def test_a_current_that_a_logger_keeps_is_lost_too(tmp_path, n, cut):
    position, current = reciprocating()
    current[1070 : 1070 + n] = current[1070]
    assert cut_motions(tmp_path, position, current) == (cut, n - 1 if cut else 0)


def test_no_logger_keeps_a_current_that_is_at_its_limit_at_nothing_or_in_coarse_steps(tmp_path):
    position, current = reciprocating()
    limited = np.clip(current, -1.2, 1.2)
    assert cut_motions(tmp_path, position, limited) == ([], 0)
    without = np.where(np.abs(current) < 1.0, 0.0, current)
    assert cut_motions(tmp_path, position, without) == ([], 0)
    assert cut_motions(tmp_path, position, np.round(current, 1)) == ([], 0)


def test_phases_that_a_logger_keeps_are_lost(tmp_path):
    made = record(MOVES, noise=0.02, seed=3)
    phases = made.phases.copy()
    at = sum(made.intervals[1]) // 2
    phases[:, at : at + 300] = phases[:, [at]]
    values = {f"axis1_{name}": x for name, x in zip("abc", phases, strict=True)}
    save_run(tmp_path / "run.parquet", RunInfo(sampling_rate_hz=RATE_HZ), values)
    outcome = segment.run([tmp_path / "run.parquet"], load_config(), tmp_path / "out")
    cut = [row for row in outcome.table.to_pylist() if row["edge"]]
    assert min(row["start"] for row in cut) < at < max(row["stop"] for row in cut)
    first, last = made.intervals[1]
    assert all(first - 60 < row["start"] < row["stop"] < last + 60 for row in cut)
    assert outcome.missing == {("run", 1): 299}


def test_stretches_are_told_across_blocks():
    so = np.random.default_rng(3).random(1000) < 0.4
    flags = Flags()
    for block in np.split(so, [1, 4, 300, 301, 777]):
        flags.push(block)
    told = np.zeros(so.size, dtype=bool)
    for first, last in flags.spans():
        told[first:last] = True
    np.testing.assert_array_equal(told, so)
    assert flags.share == np.mean(so)
    assert flags.spans(4) == [(a, b) for a, b in flags.spans() if b - a >= 4]


def test_what_is_bridged_is_not_lost_however_slow_the_log():
    for n, spans in ((3, []), (4, [(50, 54)])):
        unknown, held = Flags(), Flags()
        for flags, length in ((unknown, n), (held, 0)):
            flags.push((np.arange(200) >= 50) & (np.arange(200) < 50 + length))
        assert lost_spans(unknown, held, 10.0) == spans
