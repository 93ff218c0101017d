"""Evidence by the spectrum: changes of size, and none where nothing differs."""

from dataclasses import replace

import numpy as np
import pytest

from opamc_cli.decision.witnesses.deviation import change_between
from opamc_cli.decision.witnesses.spectra import (
    SpectrumCell,
    SpectrumEvidence,
    clearest_change,
    size_effect,
    typical_ratio,
)
from tests.decision.fleet import Fleet, cells, judge, spectra


@pytest.mark.long
def test_a_change_of_size_alone_is_found_by_the_spectrum():
    plan = Fleet(louder=0.6)
    found = [judge(cells(plan, s), spectra_by_axis=spectra(plan, s)) for s in range(10)]
    assert sum(j[plan.faulty].state != "healthy" for j in found) >= 7
    assert np.mean([judge(cells(plan, s))[plan.faulty].state == "healthy" for s in range(10)]) > 0.8
    assert np.median([j[plan.faulty].effects["spectrum"] for j in found]) == pytest.approx(
        0.6, rel=0.2
    )


def test_identical_spectra_are_no_evidence():
    plan = Fleet(n_axes=1, n_motions=1)
    cell = spectra(plan, 0)[1][0]
    cell.sessions[:] = cell.sessions[0]
    assert size_effect([cell], plan.n_baseline) == 0.0


def test_the_clearest_change_is_told_by_place_frequency_and_size():
    plan = Fleet(n_axes=1, n_baseline=5, between_sessions=0.02)
    own = spectra(plan, 2)[1]
    frame, bin_number = 3, 5
    cell = own[1]
    cell.sessions[5:, frame * cell.bins + bin_number] += 4.0
    change, _ = change_between(cell.sessions, 5)
    found = clearest_change(own, 5)
    assert found.motion == cell.motion
    # eight frames, each two ninths of the motion, from its beginning to its end
    assert (found.start, found.stop) == pytest.approx((3 / 7 * 7 / 9, 3 / 7 * 7 / 9 + 2 / 9))
    assert found.frequency_hz == (bin_number + 1) * cell.bin_hz
    assert found.size_ratio == pytest.approx(np.exp(change[frame * 8 + bin_number] / 2))
    assert clearest_change([replace(c, sessions=c.sessions[:2]) for c in own], 1) is None


def test_what_is_empty_by_chance_is_not_the_clearest_change():
    own = spectra(Fleet(n_axes=1, n_motions=1, n_baseline=5), 2)[1][0]
    grown, empty = 2 * own.bins + 3, 7
    own.sessions[5:, grown] += 4.0
    limited = own.sessions.copy()
    own.sessions[5:, empty] -= 9.0
    limited[5:, empty] -= 1.0
    alone, beside = (clearest_change([replace(own, limited=one)], 5) for one in (None, limited))
    assert alone.size_ratio < 1 < beside.size_ratio
    assert beside.frequency_hz == (3 + 1) * own.bin_hz


@pytest.mark.filterwarnings("error")
def test_the_typical_size_passes_over_motions_that_a_side_lacks():
    whole = np.zeros((4, 6))
    whole[3] = 2 * np.log(0.4)
    lacking = np.full((4, 6), 1.0)
    lacking[3] = np.nan
    cells = [SpectrumCell(0, one, np.ones(4), np.ones(6), 2, 3, 5.0) for one in (whole, lacking)]
    assert typical_ratio(cells, 3) == pytest.approx(0.4)
    assert np.isnan(typical_ratio(cells[1:], 3))


def test_sessions_of_one_cycle_are_expected_to_differ_by_more_than_noise_alone_does():
    own, within = np.random.default_rng(0).normal(size=(6, 60)), np.ones(60)
    noisy = SpectrumCell(0, own, np.full(6, 1.0), within, 6, 10, 5.0)
    expected = {
        name: SpectrumEvidence([replace(noisy, within=one)], 5).healthy_spread.scale
        for name, one in {"noise": within, "unknown": within * np.nan, "none": 0 * within}.items()
    }
    assert expected["noise"] < expected["unknown"] < expected["none"]
