"""The choice of order and γ from healthy data alone."""

from pathlib import Path

import numpy as np
import pytest

from opamc_cli.config import load_config
from opamc_cli.decision.divergence.jensen_shannon import jensen_shannon
from opamc_cli.decision.divergence.selection import self_consistency
from opamc_cli.errors import NotEnoughDataError
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.tuning import select

SAMPLE = Path(__file__).parents[3] / "data" / "samples" / "normal" / "session-000.parquet"


def drawn(rng, n_motions=4, n_cycles=5, n=200, difference=1.0, n_patterns=24):
    base = rng.normal(size=n_patterns)
    pmf = np.exp(base + difference * rng.normal(size=(n_motions, n_patterns)))
    pmf /= pmf.sum(axis=1, keepdims=True)
    motion, cycle = np.tile(np.arange(n_motions), n_cycles), np.repeat(range(n_cycles), n_motions)
    return np.array([rng.multinomial(n, pmf[m]) for m in motion]), motion, cycle


@pytest.mark.parametrize(("n_motions", "n_cycles"), [(4, 5), (2, 2)])
def test_it_is_what_its_definition_says(n_motions, n_cycles):
    counts, motion, cycle = drawn(np.random.default_rng(0), n_motions, n_cycles)
    gain = []
    for row, m, c in zip(counts, motion, cycle, strict=True):
        by_motion = {
            other: jensen_shannon(row, counts[(cycle != c) & (motion == other)].sum(axis=0))
            for other in range(n_motions)
        }
        gain.append(min(v for k, v in by_motion.items() if k != m) - by_motion[m])
    expected = np.mean(gain) / np.std(gain, ddof=1)
    assert self_consistency(counts, motion, cycle) == pytest.approx(expected)


def test_it_grows_with_the_difference_between_motions_and_with_the_data():
    rng = np.random.default_rng(1)
    by_difference = [self_consistency(*drawn(rng, difference=d)) for d in (0.0, 0.3, 1.0)]
    assert by_difference[0] < 0.2
    assert (np.diff(by_difference) > 0).all()
    by_data = [self_consistency(*drawn(rng, n=n, difference=0.3)) for n in (30, 300, 3000)]
    assert (np.diff(by_data) > 0).all()


def test_one_motion_or_one_cycle_cannot_be_rated():
    counts, motion, cycle = drawn(np.random.default_rng(2))
    assert np.isnan(self_consistency(counts, 0 * motion, cycle))
    assert np.isnan(self_consistency(counts, motion, 0 * cycle))


@pytest.fixture(scope="module")
def motions(tmp_path_factory):
    return run_chain([SAMPLE], load_config(), tmp_path_factory.mktemp("select")).motions


def test_a_recording_chooses_a_setting_and_warns_of_few_patterns(motions, tmp_path):
    outcome = select.run(motions, load_config(), tmp_path, orders=(4, 6), gammas=(0.5, 2.0))
    assert len(outcome.table) == 3 * 2 * 2
    mean = {
        (order, gamma): np.mean(
            [
                row["self_consistency"]
                for row in outcome.table.to_pylist()
                if (row["order"], row["gamma"]) == (order, gamma)
            ]
        )
        for order in (4, 6)
        for gamma in (0.5, 2.0)
    }
    assert (outcome.order, outcome.gamma) == max(mean, key=mean.get)
    few = [row for row in outcome.table.to_pylist() if row["patterns_per_cell"] < 1]
    assert {row["order"] for row in few} <= {6}
    assert len(outcome.warnings) == bool(few)


def test_windows_of_one_kind_are_refused(motions, tmp_path):
    import pyarrow as pa

    from opamc_cli.storage.sources import read_sources, sources_record
    from opamc_cli.storage.tables import read_table, write_table

    table = read_table(motions, "identify")
    one = table.filter(pa.compute.equal(table["motion"], 0))
    write_table(
        tmp_path / "motions.parquet",
        one,
        stage="identify",
        config={},
        inputs=[],
        extra=sources_record(read_sources(motions), tmp_path),
    )
    with pytest.raises(NotEnoughDataError, match="two motions"):
        select.run(tmp_path / "motions.parquet", load_config(), tmp_path)
