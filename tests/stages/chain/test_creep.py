"""A joint that creeps at a stop in one recording and not in the next."""

import numpy as np
import pyarrow.parquet as pq
import pytest

from opamc_cli.config import load_config
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run

RATE_HZ = 250.0
CYCLES = 4
STOPS = (0.0, 0.9, 0.5, 2.0)
"""Places to which the joint moves in turn, rad."""


def save(path, seed, creeps=(), way=0.02, first_rest=150, stop=None):
    """Four motions round and round; after the second of some cycles the joint creeps on.

    It comes back with the next motion, as where another joint has pulled at it.
    """
    rng = np.random.default_rng(seed)
    pieces, at = [np.full(first_rest, STOPS[0])], STOPS[0]
    for cycle in range(CYCLES):
        for number, to in enumerate((*STOPS[1:], STOPS[0])):
            n = round(100 + 250 * abs(to - at))
            pieces += [at + (to - at) * (0.5 - 0.5 * np.cos(np.pi * np.arange(n) / n))]
            at, rest = to, 100
            if number == 1 and cycle in creeps:
                creep = at + way * (0.5 - 0.5 * np.cos(np.pi * np.arange(52) / 52))
                pieces, at, rest = [*pieces, np.full(20, at), creep], at + way, 28
            pieces += [np.full(rest, at)]
    position = np.concatenate(pieces)
    speed = np.gradient(position) * RATE_HZ
    current = np.tanh(speed / 0.02) + 0.5 * speed + 0.01 * rng.normal(size=speed.size)
    position = position + 1e-5 * rng.normal(size=speed.size)
    save_run(
        path,
        RunInfo(sampling_rate_hz=RATE_HZ),
        {"axis1_current": current[:stop], "axis1_position": position[:stop]},
    )


def motions(runs, out, reference=None):
    done = run_chain([runs], load_config(), out, reference=reference)
    found = {}
    for row in pq.read_table(done.motions).to_pylist():
        found.setdefault(row["run"], []).append(row["motion"])
    return done.motions, list(found.values())


CREPT, PLAIN = [0, 1, 2, 3, 4] * CYCLES, [0, 1, 2, 3] * CYCLES
ALL, NONE = tuple(range(CYCLES)), ()


@pytest.mark.parametrize("first_rest", [0, 150])
@pytest.mark.parametrize(
    ("baseline", "target", "expected"),
    [
        # a creep of every cycle is a motion like others, and the target's lack it
        ((ALL, ALL), ALL, CREPT),
        ((ALL, ALL), NONE, [0, 1, 3, 4] * CYCLES),
        # one that is not in every cycle of the baseline is none
        ((ALL, NONE), ALL, [0, 1, -1, 2, 3] * CYCLES),
        ((ALL, (0, 2, 3)), NONE, PLAIN),
        (((1, 2), (0, 3)), NONE, PLAIN),
        ((NONE, NONE), (1, 3), [*PLAIN[:6], -1, *PLAIN[6:14], -1, *PLAIN[14:]]),
    ],
)
def test_a_creep_costs_no_more_than_itself(tmp_path, baseline, target, expected, first_rest):
    for number, creeps in enumerate(baseline):
        save(tmp_path / f"baseline/{number}.parquet", number, creeps, first_rest=first_rest)
    save(tmp_path / "target/1.parquet", 9, target, first_rest=first_rest)
    reference, _ = motions(tmp_path / "baseline", tmp_path / "b")
    _, [found] = motions(tmp_path / "target", tmp_path / "t", reference)
    if first_rest:
        assert found == expected
    else:
        # the first motion touches the edge: a cycle from its second one on, or one cycle less
        assert found[-1] == expected[-1]
        assert np.mean(np.array(found) >= 0) > 0.6


def test_a_motion_of_a_tenth_of_the_others_way_is_one_of_the_program(tmp_path):
    for number in range(2):
        save(tmp_path / f"baseline/{number}.parquet", number, ALL, way=0.1)
    save(tmp_path / "target/1.parquet", 8, ALL, way=0.1)
    save(tmp_path / "other/1.parquet", 9, NONE)
    reference, found = motions(tmp_path / "baseline", tmp_path / "b")
    assert found == [CREPT] * 2
    assert motions(tmp_path / "target", tmp_path / "t", reference)[1] == [CREPT]
    assert motions(tmp_path / "other", tmp_path / "o", reference)[1] == [[-1] * 4 * CYCLES]


def test_a_motion_of_which_an_edge_leaves_little_is_no_creep(tmp_path):
    """Nor are recordings whole executions of the program that are cut there."""
    save(tmp_path / "whole/1.parquet", 1)
    reference, _ = motions(tmp_path / "whole", tmp_path / "w")
    eleventh, twelfth = (pq.read_table(reference).to_pylist()[k] for k in (10, 11))
    for number, after in enumerate((eleventh["stop"] + 50, twelfth["start"] + 45)):
        save(tmp_path / f"cut/{number}.parquet", number, stop=after)
    _, (without, cut) = motions(tmp_path / "cut", tmp_path / "c")
    assert without == [*PLAIN[:8], -1, -1, -1]
    assert cut == [*without, -1]
