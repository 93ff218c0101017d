"""Spectra on their way from recordings to the verdict."""

import numpy as np
import pyarrow as pa
import pytest

from opamc_cli.config import load_config
from opamc_cli.decision.witnesses.evidence import session_distances
from opamc_cli.decision.witnesses.spectra import clearest_change
from opamc_cli.stages.chain.compared.side import Sides, read_side
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.chain.witnesses import spectrum
from opamc_cli.stages.chain.witnesses.kept_rows import Names
from opamc_cli.stages.recordings.sessions import Sessions
from opamc_cli.stages.verdict.evidence import bundles, session_names
from opamc_cli.storage.schemas import files
from opamc_cli.storage.tables import read_table
from tests.stages.chain.test_chain import FAULT, NORMAL


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    out = tmp_path_factory.mktemp("spectra")
    normal = run_chain([NORMAL], load_config(), out / "b")
    fault = run_chain([FAULT], load_config(), out / "t", reference=normal.motions)
    return normal, fault


def test_every_whole_segment_has_one_row_of_its_frames_and_bins(both):
    for side in both:
        table = read_table(side.patterns.with_name(files.SPECTRA), "patterns", spectrum.SCHEMA)
        rows = table.to_pylist()
        keys = {(r["run"], r["axis"], r["segment"]) for r in rows}
        counted = read_table(side.patterns, "patterns").to_pylist()
        assert keys == {(r["run"], r["axis"], r["segment"]) for r in counted}
        assert len(keys) == len(rows)
        for row in rows:
            assert len(row["log_power"]) == row["frames"] * row["bins"] == 256
            assert row["bin_hz"] == pytest.approx(
                2048 / (2 * (row["stop"] - row["start"]) // 17), rel=1e-9
            )


def test_sessions_of_the_cells_are_the_means_of_their_cycles(both):
    sides = Sides(*(read_side(side.patterns) for side in both))
    names = session_names(3, *sides.rows)
    own, cells = bundles(sides)[3].cells, bundles(sides)[3].witnesses["spectrum"].cells
    assert [c.motion for c in cells] == sorted({c.motion for c in own})
    assert {c.sessions.shape[0] for c in cells} == {len(own[0].baseline) + len(own[0].target)}
    rows: dict[str, list] = {}
    for side, sessions in zip((sides.baseline, sides.target), sides.sessions, strict=True):
        for row in side.witnesses[files.SPECTRA].to_pylist():
            if (row["axis"], row["motion"]) == (3, 2):
                rows.setdefault(sessions.of_run[row["run"]], []).append(row["log_power"])
    # a part that happens to be next to nothing counts as a third of all sessions' median
    least = np.median([np.median(own, axis=0) for own in rows.values()], axis=0) - 1.0
    own = rows[names[1][0]]
    cell = next(c for c in cells if c.motion == 2)
    expected = np.maximum(own, least).mean(axis=0)
    np.testing.assert_allclose(cell.limited[len(names[0])], expected, rtol=1e-6)
    np.testing.assert_allclose(cell.sessions[len(names[0])], np.mean(own, axis=0), rtol=1e-6)
    assert cell.cycles[len(names[0])] == len(own)


def test_one_part_without_power_makes_no_distance():
    """Where noise is all, a part's power is exponential: its logarithm is low without bound."""
    rng = np.random.default_rng(0)
    powers = np.log(rng.exponential(size=(8, 64))).astype(np.float32)
    found = []
    for last in (powers[7, 0], -30.0):
        powers[7, 0] = last
        evidence = evidence_of(powers)
        found.append(session_distances(evidence, 7, 1)["orthogonal"].each[7])
    assert found[1] == pytest.approx(found[0], abs=0.05)


def test_a_target_of_many_cycles_does_not_hide_how_much_it_grew():
    rng = np.random.default_rng(0)
    powers = np.log(rng.exponential(size=(8, 64)))
    powers[7] += 5.0
    few = evidence_of(powers).effect()
    assert few == pytest.approx(2.5, rel=0.2)
    many = np.concatenate([powers, powers[7] + rng.normal(0, 0.1, size=(40, 64))])
    runs = [f"night {k}" for k in range(7)] + ["night 7"] * 41
    assert evidence_of(many, runs).effect() == pytest.approx(few, rel=0.05)


def evidence_of(powers, runs=None):
    """One cycle in each of as many sessions, or in those named; the last is the target's."""
    runs = runs or [f"night {k}" for k in range(len(powers))]
    shape = {"axis": 1, "motion": 0, "frames": 4, "bins": 16, "bin_hz": 1.0}
    rows = [{"run": run, **shape, "log_power": own} for run, own in zip(runs, powers, strict=True)]
    n_own = runs.index(runs[-1])
    sides = (runs[:n_own], runs[-1:])
    tables = (pa.Table.from_pylist(rows[:n_own]), pa.Table.from_pylist(rows[n_own:]))
    names = Names(sides, tuple(Sessions({run: run for run in own}, ("file",)) for own in sides))
    return spectrum.evidence(*tables, 1, names)


def test_the_fault_shows_at_the_order_of_the_flexspline(both):
    sides = Sides(*(read_side(side.patterns) for side in both))
    witness = bundles(sides)[3].witnesses["spectrum"]
    change = clearest_change(witness.cells, witness.n_baseline)
    # 2(N+1)/N per motor turn at 314 Hz and 5 pole pairs is 127 Hz, within a bin of 15 Hz
    assert change.frequency_hz == pytest.approx(127, abs=15)
    assert change.size_ratio > 2
