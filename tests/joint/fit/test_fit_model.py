"""The joint fit on two grids, and terms that follow what was fitted."""

from dataclasses import replace

import numpy as np
import pytest
from closing import joint_of, plain_fit, slow_stroke

from opamc_cli.joint.effects.base import Effect, stack
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.fit import model
from opamc_cli.joint.fit.model import Term, currents, dataset_of, fit_terms, static_terms
from opamc_cli.joint.motion.groups import group_samples
from opamc_cli.joint.motion.kinematics import Recording, Smoothing, build_track
from opamc_cli.joint.motion.recordings import grouped_track
from opamc_cli.joint.motion.track import Joint

LIBRARY = built_in_library()


def term(name, **parameters):
    return Term(LIBRARY[name], parameters)


def rigid():
    return tuple(term(name) for name in ("inertia", "gravity", "coulomb", "viscous"))


def dataset_from(recording):
    track, grouping = grouped_track([recording], Joint())
    return dataset_of(track, grouping)


def test_the_fit_is_least_squares_of_the_open_samples():
    dataset = dataset_from(joint_of("cyclic", None, rate=1000.0))
    fitted = fit_terms(dataset, rigid())
    rows = dataset.fine.fit
    assert not (rows & dataset.fine.sealed).any()
    design = np.concatenate([one.columns(dataset.fine.track) for one in rigid()], axis=1)
    current = dataset.fine.track.current_a
    known = np.linalg.lstsq(design[rows], current[rows])[0]
    np.testing.assert_allclose(np.concatenate(fitted.coefficients), known, rtol=1e-6)
    np.testing.assert_allclose(fitted.residual_a, current - design @ known, atol=1e-9)
    rest = fitted.residual_a[dataset.sharp.fit]
    assert fitted.rmse(sealed=False) == pytest.approx(np.sqrt(np.mean(rest**2)))
    rest = fitted.residual_a[dataset.sharp.sealed]
    assert fitted.rmse(sealed=True) == pytest.approx(np.sqrt(np.mean(rest**2)))


def test_what_looks_at_the_terms_alone_is_fitted_once(monkeypatch):
    dataset = dataset_from(joint_of("cyclic", None, rate=1000.0))
    terms = (*rigid(), term("time_delay", delay_s=0.01))
    rounds = []
    once = model._fit_once
    monkeypatch.setattr(model, "_fit_once", lambda *given: rounds.append(1) or once(*given))
    fitted = fit_terms(dataset, terms)
    assert len(rounds) == 1
    # Another round, with the fitted model on the grid, would change nothing.
    again = once(fitted.dataset, terms)
    np.testing.assert_allclose(again.residual_a, fitted.residual_a, atol=1e-12)
    late = terms[-1]
    assert again.dataset.columns(late, True) is fitted.dataset.columns(late, True)
    fewer = fit_terms(dataset, (*terms[1:-1], late)).dataset
    for one in (fewer, again.dataset):
        own = late.columns(one.fine.track)
        np.testing.assert_array_equal(one.columns(late, True), own)
    # Beside what follows the load it changes with the fit.
    beside = fit_terms(dataset, (*rigid(), term("load_friction"), late)).dataset
    moved = beside.with_model(
        beside.fine.track.load_a + 1.0, beside.fine.track.model_a, beside.fine.track.static_terms
    )
    assert not np.allclose(moved.columns(late, True), beside.columns(late, True))


def test_the_coarse_grid_averages_and_leaves_out_what_a_sealed_sample_reaches(monkeypatch):
    monkeypatch.setattr(model, "COARSE_SAMPLES", 6000)
    dataset = dataset_from(joint_of("one stroke", None, rate=1000.0))
    assert dataset.factor == 4
    assert dataset.coarse.track.rate_hz == 1000.0 / dataset.factor
    fine = np.flatnonzero(dataset.fine.sealed)
    assert dataset.coarse.sealed.sum() == pytest.approx(fine.size / 4, rel=0.01)
    assert not (dataset.coarse.sealed & dataset.coarse.fit).any()
    blocks = np.unique(fine // dataset.factor)
    assert not dataset.coarse.fit[blocks[blocks < dataset.coarse.track.size]].any()
    # A grid that is as coarse as the recording is the recording, where nothing was averaged.
    track, grouping = grouped_track([joint_of("cyclic", None, rate=100.0)], Joint())
    slow = dataset_of(replace(track, kernel=np.ones(1)), grouping)
    assert slow.coarse is slow.fine


def test_groups_come_one_after_the_other():
    dataset = dataset_from(joint_of("cyclic", None, rate=250.0))
    parts, group = dataset.fine.parts, dataset.fine.track.group
    owners = [set(group[parts.rows[start:stop]].tolist()) for start, stop in parts.slices]
    assert [min(owner) for owner in owners] == sorted(min(owner) for owner in owners)
    assert all(len(owner) == 1 for owner in owners)
    assert set.union(*owners) == set(dataset.grouping.open)
    assert sorted(parts.rows) == np.flatnonzero(dataset.fine.fit).tolist()


def test_what_is_not_clear_is_fitted_and_not_looked_at():
    track, grouping = grouped_track([joint_of("cyclic", None, rate=250.0)], Joint())
    clear = track.clear.copy()
    clear[1000:1100] = False
    dataset = dataset_of(replace(track, clear=clear), grouping)
    assert dataset.fine.fit[1000:1100].any()
    assert not dataset.sharp.fit[1000:1100].any()
    assert dataset_of(replace(track, clear=np.ones_like(clear)), grouping).sharp is not None
    whole = dataset_of(replace(track, clear=np.ones_like(clear)), grouping)
    assert whole.sharp is whole.fine


@pytest.mark.parametrize("terms", [rigid(), rigid()[1:]], ids=["with inertia", "without"])
def test_every_moving_sample_is_judged_once(terms):
    dataset = dataset_from(slow_stroke(0.5))
    grid, track = dataset.fine, dataset.fine.track
    fitted = fit_terms(dataset, terms)
    found = fitted.judged
    np.testing.assert_array_equal(found.open, grid.fit)
    np.testing.assert_array_equal(found.sealed, grid.sealed)
    np.testing.assert_array_equal(found.residual_a[track.clear], fitted.residual_a[track.clear])
    smooth = np.zeros(track.size)
    if terms[0].effect.name == "inertia":
        smooth = terms[0].columns(track)[:, 0] * fitted.coefficients[0][0]
    half = track.kernel.size // 2
    for some, others in ((grid.fit, grid.sealed), (grid.sealed, grid.fit)):
        rows = np.flatnonzero(some & ~track.clear)
        assert rows.size
        for row in rows:
            near = np.arange(max(row - half, 0), min(row + half + 1, track.size))
            near = near[~others[near]]
            weights = track.kernel[near - row + half]
            rest = weights @ (fitted.residual_a + smooth)[near] / weights.sum() - smooth[row]
            assert found.residual_a[row] == pytest.approx(rest, abs=1e-9)
            mean = weights @ track.current_a[near] / weights.sum()
            assert found.current_a[row] == pytest.approx(mean, abs=1e-9)


@pytest.mark.parametrize(("quantum", "in_blocks_s"), [(1e-5, 0.1), (1e-4, 0.2)])
def test_an_average_next_to_rest_is_that_of_the_acceleration(quantum, in_blocks_s):
    """Over counted samples alone the right inertia took 7 % off an error of 0.037 A, not 65.

    Blocks are of the samples that move as seen over a window of `in_blocks_s`.
    """
    recordings = [slow_stroke(0.5, quantum)]
    first, track = (
        build_track(recordings, Joint(), Smoothing(window_s, from_velocity=False))
        for window_s in (in_blocks_s, 0.2)
    )
    grouping = group_samples(first.moving, track.bounds, None, track.rate_hz, ("run",))
    dataset = dataset_of(track, grouping)
    with_it, without = (fit_terms(dataset, terms) for terms in (rigid(), rigid()[1:]))
    for sealed in (False, True):
        assert without.rmse(sealed) > 3 * 0.02
        assert with_it.rmse(sealed) < 1.4 * 0.02


def test_a_load_friction_is_found_together_with_the_load_whose_zero_it_moves():
    """Beside the load fitted without it, it stays where it is: 0.1 is fitted, not 0.3."""

    def by_load(q, v, a, t):
        return 0.3 * np.abs(0.2 * a + np.sin(q) + 0.4 * np.cos(q)) * np.sign(v)

    recording = joint_of("cyclic", None, noise_a=0.01)
    track, _ = grouped_track([recording], Joint())
    q = recording.position_rad
    v = np.gradient(q) * 250
    extra = by_load(q, v, np.gradient(v) * 250, None)
    recording = replace(recording, current_a=recording.current_a + extra)
    terms = (*rigid(), term("load_friction", inertia_share=1.0))
    fitted = fit_terms(dataset_from(recording), terms)
    assert fitted.coefficients[-1][0] == pytest.approx(0.3, abs=0.02)
    assert fitted.coefficients[2][0] == pytest.approx(0.5, abs=0.02)
    # The dataset that comes back holds the load that was fitted.
    load = fitted.dataset.fine.track.load_a
    columns = [LIBRARY[name].columns(track, {}) for name in ("inertia", "gravity")]
    parts = [c @ k for c, k in zip(columns, fitted.coefficients, strict=False)]
    np.testing.assert_allclose(load[dataset_rows(fitted)], sum(parts)[dataset_rows(fitted)],
                               atol=0.02)  # fmt: skip


def dataset_rows(fitted):
    return fitted.dataset.fine.fit


class Following(Effect):
    """Takes half of what the static terms say: settles in a few rounds."""

    name, domain, static = "following", "time", False
    rounds = 0

    def columns(self, track, parameters):
        type(self).rounds += 1
        return stack(np.tanh(track.model_a) * np.sign(np.sin(7 * track.time_s)))


def test_terms_that_follow_the_model_are_fitted_until_that_settles(monkeypatch):
    dataset = dataset_from(joint_of("cyclic", lambda q, v, a, t: np.sin(7 * t) * np.sin(q)))
    terms = (*rigid(), Term(Following(), {}))
    Following.rounds = 0
    fitted = fit_terms(dataset, terms)
    assert 2 < Following.rounds < model.MOST_ROUNDS
    dataset.cache.clear()
    again = fit_terms(fitted.dataset, terms)
    assert again.residual_a is not fitted.residual_a
    assert again.rmse(sealed=False) == pytest.approx(fitted.rmse(sealed=False), rel=1e-3)
    monkeypatch.setattr(model, "SETTLED", -1.0)
    dataset.cache.clear()
    Following.rounds = 0
    fit_terms(dataset, terms)
    assert Following.rounds == model.MOST_ROUNDS


def test_fast_terms_are_kept_near_what_anybody_asks_for():
    recording = joint_of("cyclic", lambda q, v, a, t: np.sin(40 * q), rate=1000.0)
    fitted = fit_terms(dataset_from(recording), (*rigid(), term("ripple", order=40.0)))
    dataset, grid = fitted.dataset, fitted.dataset.fine
    block = dataset.columns(fitted.terms[-1], True)
    whole = fitted.terms[-1].columns(grid.track)
    assert block.shape[0] == grid.near.size < grid.track.size
    np.testing.assert_array_equal(block, whole[grid.near])
    np.testing.assert_array_equal(grid.parts.taken(block), grid.parts.taken(whole))
    ripple = whole @ fitted.coefficients[-1]
    known = grid.fit | grid.sealed
    spread = grid.spread(block @ fitted.coefficients[-1])
    np.testing.assert_allclose(spread[known], ripple[known], atol=1e-12)
    assert grid.spread(ripple) is ripple


def test_a_current_is_added_up_by_what_it_is():
    parts = [np.full(4, 10.0**k) for k in range(4)]
    terms = (term("gravity"), term("coulomb"), term("ripple", order=2.0), Term(Following(), {}))
    total, static, load = currents(terms, parts, 4)
    assert (total[0], static[0], load[0]) == (1111.0, 11.0, 1.0)
    assert static_terms(terms) == terms[:2]


def test_a_term_keeps_some_of_its_columns_and_is_known_by_that():
    track = dataset_from(joint_of("cyclic", None)).fine.track
    whole = term("gravity")
    sine = Term(LIBRARY["gravity"], {}, keep=(0,))
    np.testing.assert_array_equal(sine.columns(track), whole.columns(track)[:, :1])
    assert whole.key != sine.key
    assert whole.key == term("gravity").key


def test_fast_terms_are_taken_as_fitted_on_the_coarse_grid():
    recording = joint_of("cyclic", lambda q, v, a, t: np.sin(40 * q), rate=500.0)
    terms = (*rigid(), term("ripple", order=40.0))
    fitted = fit_terms(dataset_from(recording), terms)
    dataset, track = fitted.dataset, fitted.dataset.coarse.track
    sums, slow, fast = fitted.coarse_sums
    assert sum(block.shape[1] for block in slow) == sums.moment.shape[1] == 5
    ripple = terms[-1].columns(track) @ fitted.coefficients[-1]
    rows = dataset.parts[1].rows
    np.testing.assert_allclose(fast[rows], ripple[rows], atol=1e-12)
    columns, left = np.concatenate(slow, axis=1)[rows], (track.current_a - ripple)[rows]
    np.testing.assert_allclose(sums.moment.sum(axis=0), columns.T @ left)
    assert sums.power.sum() == pytest.approx(left @ left)
    fitted.forget()
    assert "coarse_sums" not in vars(fitted)


def test_drift_and_smoothing_stand_beside_a_fit():
    plain = plain_fit(joint_of("cyclic", None))
    drifting = plain_fit(joint_of("cyclic", lambda q, v, a, t: t, strength=10.0))
    assert drifting.sums.held_out().sum() > 10 * plain.sums.held_out().sum()
    error = drifting.drift_free_error
    # What is left within a half of a unit is a slope.
    assert error.sum() < 0.05 * drifting.sums.held_out().sum()
    assert plain.unsmoothed_error.size == plain.sums.held_out().size


def test_a_motion_of_a_third_of_a_second_has_samples_to_fit_after_a_long_window_too():
    rate = 2000.0
    time = np.arange(round(1.35 * rate)) / rate
    place = 2 * np.clip(time - 0.5, 0.0, 0.35)
    noise = np.random.default_rng(0).normal(size=time.size)
    current = np.sign(np.gradient(place)) + 0.01 * noise
    recording = Recording("run", rate, current_a=current, position_rad=place)
    track, grouping = grouped_track([recording], Joint())
    other = build_track([recording], Joint(), Smoothing(0.12, from_velocity=False))
    dataset = dataset_of(replace(other, moving=track.moving, clear=track.clear), grouping)
    # Its moving average carries every open block's samples into sealed ones.
    assert other.kernel.size > 200
    fine, coarse = dataset.parts
    assert coarse.rows.size == fine.rows.size > 0
