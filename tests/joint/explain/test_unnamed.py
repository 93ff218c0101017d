"""Functions without a name: how a covariate is stretched, and where travel begins anew."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from closing import joint_of, plain_fit
from hypothesis import given, settings
from hypothesis import strategies as st
from simulator import simulate

from opamc_cli.joint.explain.saturated import unnamed_library
from opamc_cli.joint.explain.unnamed import (
    Response,
    Shift,
    stretched,
    time_since_rest,
    travel_since_reversal,
)
from opamc_cli.joint.fit.model import Term, fit_terms
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import coarsen
from opamc_cli.signal.transform.filters import answers


@settings(max_examples=60)
@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=80), st.integers(0, 2**32 - 1))
def test_a_covariate_is_stretched_within_0_and_1_in_its_own_order(values, seed):
    values = np.array(values)
    members = np.random.default_rng(seed).random(values.size) < 0.7
    place = stretched(values, members)
    assert np.all((place >= 0) & (place <= 1))
    order = np.argsort(values, kind="stable")
    assert np.all(np.diff(place[order]) >= 0)
    # A range below 1e-300 is none.
    if members.any() and np.ptp(values[members]) > 1e-300:
        # Of equal values all have the rank of the last.
        assert place[members].max() == 1


def test_every_stretch_of_a_covariate_is_seen_and_none_is_flattened():
    # Nine tenths of the samples are in a tenth of the range.
    values = np.concatenate([np.linspace(0, 1, 900), np.linspace(1.01, 10, 100)])
    place = stretched(values, np.ones(1000, dtype=bool))
    assert place[899] == pytest.approx((0.9 + 0.1) / 2, abs=0.02)
    assert np.all(np.diff(place) > 0)


def test_a_model_beside_its_own_rates_of_change_settles_at_once():
    # Late by 15 times the noise, which it did not do when the last fit was shifted.
    made = simulate(6, ("time_delay",), 15.0, rate=500.0, cycles=6)
    before = plain_fit(
        Recording("run", made.rate_hz, current_a=made.current, position_rad=made.position)
    )
    terms = (*before.terms, Term(unnamed_library()["unnamed_shift"], {}))
    after = fit_terms(before.dataset, terms)
    assert after.rmse(sealed=False) < 0.75 * before.rmse(sealed=False)
    again = fit_terms(after.dataset, terms)
    assert again.rmse(sealed=False) == pytest.approx(after.rmse(sealed=False), rel=1e-9)


@pytest.fixture(scope="module")
def track():
    made = joint_of("cyclic", None, rate=250.0, seconds=8.0)
    return plain_fit(made).dataset.fine.track


@pytest.mark.parametrize(
    ("name", "covariate", "modifiers", "first"),
    [
        ("speed", lambda t: np.abs(t.velocity), lambda t: [t.direction], 0),
        ("speed_and_direction", lambda t: np.abs(t.velocity), lambda t: [1.0], 0),
        ("angle", lambda t: t.position_rad, lambda t: [1.0], 0),
        ("angle_and_direction", lambda t: t.position_rad, lambda t: [t.direction], 0),
        ("load", lambda t: np.abs(t.load_a), lambda t: [t.direction], 0),
        ("acceleration", lambda t: t.acceleration, lambda t: [1.0], 1),
        ("time", lambda t: t.time_s, lambda t: [1.0], 0),
        ("time_and_speed", lambda t: t.time_s, lambda t: [t.direction, t.velocity], 0),
        ("time_and_load", lambda t: t.time_s,
         lambda t: [np.sin(t.position_rad), np.cos(t.position_rad), t.acceleration], 0),
        ("time_and_current", lambda t: t.time_s, lambda t: [t.model_a], 1),
    ],
)  # fmt: skip
def test_a_smooth_function_is_cosines_of_its_covariate_times_what_it_changes(
    track, name, covariate, modifiers, first
):
    effect = unnamed_library()[f"unnamed_{name}"]
    place = np.pi * stretched(covariate(track), track.moving)
    waves = [np.cos(k * place) for k in range(first, 5)]
    expected = np.stack([part * wave for part in modifiers(track) for wave in waves], axis=1)
    np.testing.assert_allclose(effect.columns(track, {"degree": 4.0}), expected)
    assert [guess["degree"] for guess in effect.guesses(track, track.time_s)] == [2, 4, 8, 16]
    assert effect.from_motion is (name != "load" and not name.endswith("current"))
    assert effect.changes_in_time is name.startswith("time")


def test_a_response_is_low_and_band_passes_of_the_acceleration(track):
    effect = Response()
    counts = [guess["filters"] for guess in effect.guesses(track, track.time_s)]
    assert counts == [3.0, 6.0, 12.0]
    columns = effect.columns(track, {"filters": 3.0})
    frequencies = [1.5, np.sqrt(1.5 * 60.0), 60.0]
    expected = [
        answer
        for frequency in frequencies
        for answer in answers(
            [track.acceleration], 2 * np.pi * frequency, 0.3, track.rate_hz, track.bounds
        )
    ]
    np.testing.assert_allclose(columns, np.stack(expected, axis=1), atol=1e-12)
    for grid in (track, coarsen(track, 3)):
        rows = np.arange(1, grid.size, 5)
        some = effect.columns_at(grid, {"filters": 3.0}, rows)
        np.testing.assert_array_equal(some, effect.columns(grid, {"filters": 3.0})[rows])
    # A slower recording has no room for 60 Hz.
    slow = replace(track, rate_hz=90.0)
    highest = answers([slow.acceleration], 2 * np.pi * 30.0, 0.3, 90.0, slow.bounds)
    last = effect.columns(slow, {"filters": 3.0})[:, -len(list(highest)) :]
    np.testing.assert_allclose(last, np.stack(list(highest), axis=1))


def test_a_shift_is_the_rates_of_change_of_the_open_samples_fit(track):
    static = fit_terms(plain_fit(joint_of("cyclic", None, rate=100.0)).dataset, ())
    empty = static.dataset.fine.track
    np.testing.assert_array_equal(
        Shift().columns(replace(empty, open_samples=None), {}), np.zeros((empty.size, 2))
    )
    columns = track.static_columns
    rows = track.open_samples
    model = columns @ np.linalg.lstsq(columns[rows], track.current_a[rows])[0]
    rate = track.rate_hz
    expected = np.stack([rate * np.gradient(model), rate**2 * np.gradient(np.gradient(model))], 1)
    np.testing.assert_allclose(Shift().columns(track, {}), expected, rtol=1e-9, atol=1e-6)


def test_a_shift_is_as_large_on_a_coarse_grid(track):
    """By samples it was as many times larger there as the grid is coarser, and judged so."""
    coarse = coarsen(track, 3)
    opened = track.open_samples[: 3 * coarse.size].reshape(-1, 3).all(axis=1)
    coarse = replace(coarse, open_samples=opened)
    sizes = [Shift().columns(grid, {})[:, 0].std() for grid in (track, coarse)]
    assert sizes[1] == pytest.approx(sizes[0], rel=0.2)


def test_of_no_samples_nothing_is_stretched():
    values = np.arange(3.0)
    np.testing.assert_array_equal(stretched(values, np.zeros(3, dtype=bool)), np.zeros(3))
    np.testing.assert_array_equal(stretched(np.ones(3), np.ones(3, dtype=bool)) <= 1, True)


def test_what_is_fitted_to_its_own_recordings_or_smooths_the_motion_says_so():
    library = unnamed_library()
    own = {name for name, effect in library.items() if effect.of_its_recordings}
    assert own == set(library) - {"unnamed_response", "unnamed_order", "unnamed_presliding"}
    smooth = {name for name, effect in library.items() if effect.as_smoothing}
    assert smooth == {"unnamed_response", "unnamed_shift"}


def test_travel_since_reversal_of_a_zigzag():
    track = SimpleNamespace(
        position_rad=np.array([0.0, 1, 2, 3, 2, 1, 1, 0, 1, 3]),
        direction=np.array([1, 1, 1, 1, -1, -1, 0, -1, 1, 1]),
        size=10,
    )
    # A rest is no reversal; a reversal counts from the sample at which the direction is another.
    np.testing.assert_array_equal(travel_since_reversal(track), [0, 1, 2, 3, 0, 1, 1, 2, 0, 2])


def test_time_since_rest_begins_anew_at_rests_reversals_and_recordings():
    track = SimpleNamespace(
        direction=np.array([1, 1, 0, 1, 1, 1, -1, -1, -1, -1]),
        bounds=((0, 8), (8, 10)),
        size=10,
        rate_hz=2.0,
    )
    since = 2.0 * time_since_rest(track)
    np.testing.assert_array_equal(since, [0, 1, 0, 0, 1, 2, 0, 1, 0, 1])
