from dataclasses import replace

import numpy as np
import pytest
from simulator import simulate

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.explain.declared import declared_fit
from opamc_cli.joint.fit import thinning
from opamc_cli.joint.fit.model import Term, dataset_of, fit_terms
from opamc_cli.joint.fit.regressor_cache import RegressorCache
from opamc_cli.joint.loop import close_loop
from opamc_cli.joint.motion.groups import group_samples
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.recordings import grouped_track
from opamc_cli.joint.motion.track import Joint

DECLARED = ("inertia", "gravity", "coulomb", "viscous")
LIMIT = 20_000


def long_track(seed=5, effects=("load_friction",), cycles=12, kind="trapezoid"):
    made = simulate(seed, effects, 0.8, rate=500.0, cycles=cycles, kind=kind)
    recording = Recording("run", made.rate_hz, current_a=made.current, position_rad=made.position)
    return grouped_track([recording], Joint(made.gear_ratio, made.pole_pairs))


def terms(*effects):
    library = built_in_library()
    return tuple(Term(library[name], parameters) for name, parameters in effects)


def test_cycles_are_taken_whole():
    track, grouping = long_track(cycles=30)
    dataset = dataset_of(track, grouping, LIMIT)
    taken = np.unique(dataset.fine.track.group[dataset.fine.fit])
    assert grouping.kind == "cycles"
    assert thinning.FEWEST_GROUPS <= taken.size < len(dataset.grouping.open)
    for group in taken:
        there = np.count_nonzero(dataset.fine.fit & (dataset.fine.track.group == group))
        assert there == np.count_nonzero(track.moving & (grouping.group == group))


def test_of_blocks_the_first_and_the_last_part_is_taken():
    track, _ = long_track(cycles=30, kind="sines")
    blocks = group_samples(track.moving, track.bounds, None, track.rate_hz, ("run",))
    assert blocks.kind == "blocks"
    dataset = dataset_of(track, blocks, LIMIT)
    fine = dataset.fine
    assert np.count_nonzero(fine.fit) == pytest.approx(LIMIT * 0.75, rel=0.02)
    for group in dataset.grouping.open:
        whole = track.time_s[track.moving & (blocks.group == group)]
        part = fine.track.time_s[fine.fit & (fine.track.group == group)]
        assert part[0] == whole[0]
        assert part[-1] == whole[-1]
    outside = fine.track.group == -1
    assert not (fine.fit & outside).any()
    sealed = dataset.opened.fine.sealed
    assert np.count_nonzero(sealed) == pytest.approx(LIMIT * 0.25, rel=0.02)
    # What comes before a piece lets the effects with a memory settle.
    for start, stop in fine.track.bounds[1:]:
        held = np.flatnonzero(fine.track.group[start:stop] >= 0)
        assert held[0] >= thinning.LEAD_S * track.rate_hz - 1


def test_nothing_sealed_is_on_the_grids_and_all_of_it_is_opened_at_the_end():
    track, grouping = long_track(cycles=20)
    dataset = dataset_of(track, grouping, LIMIT)
    assert not dataset.fine.sealed.any()
    fitted = fit_terms(dataset, terms(*((name, {}) for name in DECLARED)))
    opened = fitted.opened
    sealed = track.moving & np.isin(grouping.group, grouping.sealed)
    np.testing.assert_array_equal(
        opened.dataset.fine.track.current_a[opened.dataset.fine.sealed], track.current_a[sealed]
    )
    np.testing.assert_allclose(
        np.concatenate(opened.coefficients), np.concatenate(fitted.coefficients), rtol=1e-9
    )


@pytest.mark.long
def test_a_sample_of_a_long_recording_tells_what_all_of_it_tells():
    track, grouping = long_track(cycles=20)
    library = built_in_library()
    declared = tuple((library[name], None) for name in DECLARED)
    whole = close_loop(declared_fit(dataset_of(track, grouping), declared), library)
    part = close_loop(declared_fit(dataset_of(track, grouping, LIMIT), declared), library)
    assert [s.term.effect.name for s in part.steps] == [s.term.effect.name for s in whole.steps]
    assert part.verdict == whole.verdict == "closed"
    assert part.rmse_before_a == pytest.approx(whole.rmse_before_a, rel=0.02)
    assert part.rmse_after_a == pytest.approx(whole.rmse_after_a, rel=0.02)


def test_fits_that_share_regressors_are_those_that_compute_their_own():
    track, grouping = long_track(cycles=6)
    ripple = ("ripple", {"order": 2.0, "speed": 1.0, "direction": 1.0, "load": 1.0})
    everything = terms(
        *((name, {}) for name in DECLARED), ("load_friction", {}), ripple, ("offset", {})
    )
    shared = own = fit_terms(dataset_of(track, grouping), everything[:4])
    for chosen in (everything[:5], everything[:6], everything, everything[:4] + everything[5:]):
        shared = fit_terms(shared.dataset, chosen)
        own = fit_terms(replace(own.dataset, cache=RegressorCache()), chosen)
        for ours, theirs in zip(shared.coefficients, own.coefficients, strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=1e-8)
        for term in chosen:
            np.testing.assert_allclose(
                shared.dataset.columns(term, fine=False),
                term_columns(own.dataset, term),
                atol=1e-9,
            )


def term_columns(dataset, term):
    return replace(dataset, cache=RegressorCache()).columns(term, fine=False)


def test_friction_that_follows_the_load_finds_none_where_nothing_carries_one():
    track, grouping = long_track(cycles=6)
    dataset = dataset_of(track, grouping)
    with_load = fit_terms(
        dataset, terms(("coulomb", {}), ("spring", {}), ("load_friction", {"inertia_share": 1.0}))
    )
    left = fit_terms(with_load.dataset, (with_load.terms[0], with_load.terms[2]))
    alone = fit_terms(dataset, with_load.terms[:1])
    assert left.rmse(sealed=False) == pytest.approx(alone.rmse(sealed=False), rel=1e-9)
