"""Regressors of the effects, one by one."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import bilinear, lfilter
from simulator import simulate
from track_of import track_of

from opamc_cli.joint.effects.elasticity import Elasticity
from opamc_cli.joint.effects.hysteresis import dahl_state
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.effects.time_delay import TimeDelay
from opamc_cli.joint.explain.saturated import unnamed_library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.kinematics import Recording, build_track
from opamc_cli.joint.motion.track import Joint, coarsen
from opamc_cli.signal.motion.smoothing import averaged, block_mean
from opamc_cli.signal.transform.filters import answers, lagging, late_means

VOCABULARY = list(built_in_library())


@pytest.mark.parametrize("name", VOCABULARY)
def test_regressors_are_finite_and_as_long_as_the_track(name):
    _, track = track_of()
    effect = built_in_library()[name]
    noise = np.where(track.moving, np.random.default_rng(0).normal(size=track.size), 0.0)
    noise += np.where(track.moving, np.cos(5 * track.machine_angle_rad), 0.0)
    for guess in effect.guesses(track, noise):
        columns = effect.columns(track, guess)
        assert columns.shape[0] == track.size
        assert np.all(np.isfinite(columns))
        # a payload need not be put down
        known = set(guess) | {"until_s"}
        assert effect.form_of(guess) or set(effect.limits(track)) <= known


def test_a_place_is_sought_where_it_is_passed_both_ways():
    """Learnt on strokes one way, its tail was added to the other way's with the sign turned."""
    _, track = track_of()
    drag, middle = built_in_library()["position_drag"], float(np.median(track.position_rad))
    apart = replace(track, direction=np.where(track.position_rad > middle, 1.0, -1.0))
    met = drag.guesses(apart, None)
    assert met
    assert all(abs(guess["place_rad"] - middle) <= guess["width_rad"] for guess in met)
    # nothing contradicts a recording that has one way alone
    one_way = replace(track, direction=np.ones(track.size))
    assert drag.guesses(one_way, None) == drag.guesses(track, None)


@pytest.mark.parametrize("parameters", [{}, {"inertia_share": 0.3}, {"exponent": 2.0}])
def test_friction_beside_any_load_is_laid_like_its_column_and_grows_as_differences_say(parameters):
    _, track = track_of()
    friction, rows = built_in_library()["load_friction"], np.flatnonzero(track.moving)[::7]
    carriers = np.stack([track.acceleration, np.cos(track.position_rad), np.ones(track.size)], 1)
    by_load = friction.beside(track, parameters, carriers, rows)

    def laid(values):
        loaded = track.with_model(carriers @ values, track.model_a, ())
        return friction.columns_at(loaded, parameters, rows)[:, 0]

    values, step = np.array([0.02, 1.5, 0.4]), 1e-6
    regressor, slopes = by_load(values)
    np.testing.assert_allclose(regressor, laid(values), atol=1e-9)
    for k in range(3):
        aside = step * np.eye(3)[k]
        along = (laid(values + aside) - laid(values - aside)) / (2 * step)
        # Where the load passes zero its size has a corner.
        assert np.quantile(np.abs(along - slopes[:, k]), 0.99) < 1e-4 * np.abs(slopes[:, k]).max()


def test_what_a_motion_never_shows_is_untestable():
    """A gear at one speed, one way: 74 165 A of a Stribeck curve were named, and `closed`."""
    _, track = track_of()
    stribeck, asymmetric = (built_in_library()[n] for n in ("stribeck", "asymmetric_friction"))
    assert stribeck.untestable(track) is asymmetric.untestable(track) is None
    speeds = np.abs(track.velocity)
    steady = replace(track, velocity=np.clip(speeds, 0.6 * speeds.max(), None))
    assert stribeck.untestable(steady) == "the joint never goes slowly"
    slowest = np.abs(track.velocity[track.moving]).min()
    low, _ = stribeck.limits(track)["stribeck_speed"]
    assert low >= slowest / 2
    one_way = replace(track, direction=np.ones(track.size))
    assert asymmetric.untestable(one_way) == "the joint moves one way alone"


@pytest.mark.parametrize("name", [*VOCABULARY, *unnamed_library()])
def test_regressors_at_some_samples_are_those_of_all(name):
    _, track = track_of()
    effect = {**unnamed_library(), **built_in_library()}[name]
    waves = np.where(track.moving, np.cos(5 * track.machine_angle_rad), 0.0)
    rows = np.random.default_rng(0).permutation(track.size)[:400]
    for guess in effect.guesses(track, waves)[:3]:
        some = effect.columns_at(track, guess, rows)
        np.testing.assert_allclose(some, effect.columns(track, guess)[rows], rtol=1e-12)


def test_a_place_is_sought_where_the_fitted_samples_have_been():
    _, track = track_of()
    low, high = np.quantile(track.position_rad[track.moving], [0.0, 0.5])
    shown = track.moving & (track.position_rad < high)
    drag = built_in_library()["position_drag"]
    for rows, top in ((None, track.position_rad[track.moving].max()), (shown, high)):
        places = [
            guess["place_rad"] for guess in drag.guesses(replace(track, open_samples=rows), None)
        ]
        assert drag.limits(replace(track, open_samples=rows))["place_rad"] == pytest.approx(
            (low, top), rel=1e-2
        )
        assert low <= min(places) < max(places) < 1.1 * top - 0.1 * low


def slow_dahl(position, length):
    state, states = 0.0, []
    previous = position[0]
    for place in position:
        travelled = 0.0
        step = (place - previous) / 2000
        while abs(travelled) < abs(place - previous) - 1e-15:
            state += (1 - state * np.sign(step)) * step / length
            travelled += step
        states.append(state)
        previous = place
    return np.array(states)


@pytest.mark.parametrize("name", VOCABULARY)
def test_every_effect_is_a_fault_or_not_as_the_documentation_says(name):
    text = (Path(__file__).parents[3] / "docs" / "decision.md").read_text()
    rows = {
        cells[1].strip(): (cells[2], cells[3].strip())
        for line in text.splitlines()
        if len(cells := line.split("|")) == 5
    }
    effect = built_in_library()[name]
    causes, state = rows[effect.origin]
    assert f"`{name}`" in causes
    assert state == ("`changed`" if effect.origin != "joint" else "`fault`")


@settings(max_examples=10)
@given(st.lists(st.sampled_from([-1.0, -0.3, 0.0, 0.2, 0.7, 1.0]), min_size=2, max_size=12))
def test_dahl_state_solves_its_equation(places):
    position = np.array(places)
    np.testing.assert_allclose(dahl_state(position, 0.4), slow_dahl(position, 0.4), atol=2e-3)


@pytest.mark.parametrize("damping", [0.005, 0.1, 0.4])
def test_filters_of_second_order_are_discrete_as_scipy_makes_them(damping):
    signal = np.random.default_rng(0).normal(size=300)
    signal[0] = 0.0
    w = 2 * 100.0 * np.tan(2 * np.pi * 7.0 / 200.0)
    expected = [
        lfilter(*bilinear(above, (1.0, 2 * damping * w, w * w), 100.0), signal)
        for above in ((0.0, 0.0, w * w), (0.0, w, 0.0))
    ]
    found = answers([signal], 2 * np.pi * 7.0, damping, 100.0, ((0, 300),))
    np.testing.assert_allclose(found, expected, atol=1e-10)


@pytest.mark.parametrize("starts", [(None, None), (0.0, 86_400.0)])
def test_hum_has_a_phase_for_every_recording(starts):
    made = simulate(3, rate=500.0, cycles=4, kind="quintic")
    recordings = [
        Recording("run", 500.0, made.current, position_rad=made.position, started_s=start)
        for start in starts
    ]
    track = build_track(recordings, Joint())
    hum = built_in_library()["mains_hum"].columns(track, {"frequency_hz": 50.0, "turning": 0.0})
    assert hum.shape == (track.size, 4)
    first = track.bounds[0][1]
    assert np.any(hum[:first, 0])
    assert not np.any(hum[first:, 0])
    # two lines differ by what one recording can tell apart, however far apart they are
    (step,) = built_in_library()["mains_hum"].first_steps(track, {}).values()
    assert step == pytest.approx(0.5 / track.run_time_s.max())


@pytest.mark.parametrize(
    ("line_hz", "rate_hz", "shown_hz"),
    [
        (50.0, 125.0, 50.0),
        (100.0, 125.0, 25.0),
        (180.0, 125.0, 55.0),
        (600.0, 2000.0, 600.0),
        (28.06, 125.0, None),  # The 20th order of a UR10's motor at 5 degrees a second.
        (14.03, 125.0, None),
    ],
)
def test_a_line_is_hum_near_a_multiple_of_the_mains_only(line_hz, rate_hz, shown_hz):
    time_s = np.arange(round(10 * rate_hz)) / rate_hz
    recording = Recording("run", rate_hz, np.sin(time_s), position_rad=np.cos(0.4 * time_s))
    line = np.cos(2 * np.pi * line_hz * time_s)
    found = built_in_library()["mains_hum"].guesses(build_track([recording], Joint()), line)
    near = [one["frequency_hz"] for one in found if abs(one["frequency_hz"] - line_hz) < 0.1]
    if shown_hz is None:
        assert not near
    else:
        assert found[0]["frequency_hz"] == pytest.approx(shown_hz, abs=0.1)


@pytest.mark.parametrize(
    ("frequency_hz", "rate_hz", "said"),
    [
        (20.04, 66.8, "folded by the sampling rate, or the logger's own: 3/10 of its rate)"),
        (33.4, 100.2, "folded by the sampling rate, or the logger's own: 1/3 of its rate)"),
        (20.4, 66.8, "folded by the sampling rate)"),
        (50.1, 250.5, "(1 x 50 Hz)"),
    ],
)
def test_a_folded_line_at_a_tenth_of_the_rate_may_be_the_loggers(frequency_hz, rate_hz, said):
    recording = Recording("run", rate_hz, np.zeros(300), position_rad=np.cos(np.arange(300) / 99))
    track = build_track([recording], Joint())
    text = built_in_library()["mains_hum"].interpretation({"frequency_hz": frequency_hz}, track)
    assert text.endswith(said)


def test_a_filtered_current_lags_as_a_recursion_of_first_order_does():
    rng = np.random.default_rng(3)
    columns, pole = rng.normal(size=(50, 2)), np.exp(-1 / 2.5)
    expected = columns.copy()
    for i in range(1, 50):
        expected[i] = pole * expected[i - 1] + (1 - pole) * columns[i]
    np.testing.assert_allclose(lagging(columns, pole), expected)


@pytest.mark.parametrize("samples", [0.0, 3.0, 7.4, -2.6, 55.0])
@pytest.mark.parametrize("factor", [1, 8])
def test_means_of_late_blocks_are_those_of_the_interpolated_signal(samples, factor):
    columns = np.random.default_rng(0).normal(size=(203, 3)).cumsum(axis=0)
    bounds = ((0, 80), (80, 203))
    late, sums = [], []
    for start, stop in bounds:
        places = np.arange(stop - start)
        for column in columns[start:stop].T:
            late.append(np.interp(places - samples, places, column))
        sums.append(np.concatenate([np.zeros((1, 3)), np.cumsum(columns[start:stop], axis=0)]))
    shifted = np.concatenate([np.stack(late[:3], axis=1), np.stack(late[3:], axis=1)])
    expected = block_mean(shifted, bounds, factor)
    found = late_means(np.concatenate(sums), bounds, samples, factor)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_wind_up_on_the_coarse_grid_is_the_average_of_that_at_the_full_rate():
    _, track = track_of(quantum=2e-4)
    coarse = coarsen(track, 25)
    parameters = {"resonance_hz": 7.0, "damping": 0.05}
    w = 2 * 500.0 * np.tan(2 * np.pi * 7.0 / 1000.0)
    below = (1.0, 2 * 0.05 * w, w * w)
    acceleration = track.acceleration
    slow = []
    for above in ((-1.0, -2 * 0.05 * w, 0.0), (0.0, w, 0.0)):
        zeros, poles = bilinear(above, below, 500.0)
        # A long time at the first acceleration, instead of a state to begin with.
        settled = np.concatenate([np.full(20_000, acceleration[0]), acceleration])
        slow.append(lfilter(zeros, poles, settled)[20_000:])
    expected = block_mean(np.stack(slow, axis=1), track.bounds, 25)
    scale = np.abs(expected).max()
    columns = Elasticity().columns(coarse, parameters)
    np.testing.assert_allclose(columns, expected, atol=1e-6 * scale)


def test_a_delay_shorter_than_the_coarse_samples_has_its_own_length_and_a_coefficient_of_one():
    _, track = track_of(quantum=2e-4)
    library = built_in_library()
    names = ("inertia", "gravity", "coulomb", "viscous")
    terms = tuple(Term(library[name], {}) for name in names)
    sizes = (0.3, 1.0, 2.0, 0.5, 0.3)
    sharp = np.concatenate([term.columns(track) for term in terms], axis=1)
    # What was averaged already is not averaged again.
    smooth = averaged(sharp, track.bounds, track.kernel)
    smooth[:, 0] = track.acceleration
    late = np.interp(np.arange(track.size) - 4.0, np.arange(track.size), smooth @ sizes)
    coarse = coarsen(track, 25)
    moving = coarse.moving
    coarse = replace(
        coarse.with_model(np.zeros(track.size), np.zeros(track.size), terms),
        current_a=block_mean(late, track.bounds, 25),
        open_samples=moving,
    )
    wanted = coarse.current_a - block_mean((smooth @ sizes)[:, None], track.bounds, 25)[:, 0]
    column = TimeDelay().columns(coarse, {"delay_s": 4.0 / 500.0})[:, 0]
    assert np.dot(column, wanted) / np.dot(column, column) == pytest.approx(1.0, abs=0.05)
    assert np.std((wanted - column)[moving]) < 0.1 * np.std(wanted[moving])
    # three quarters of a sample are late; less is what sampling does to corners
    for delay, late in ((0.76, True), (0.74, False), (-0.74, False), (-0.76, True)):
        assert TimeDelay().columns(coarse, {"delay_s": delay / 500.0}).any() == late
    assert TimeDelay().columns(coarse, {"delay_s": 0.74 / 500.0, "filtered": 1.0}).any()


@pytest.mark.parametrize(("waves", "clocks", "steps"), [(0.5, {0.0}, 1), (2.0, {0.0, 1.0}, 32)])
def test_time_within_a_recording_is_told_only_where_one_comes_back(waves, clocks, steps):
    """Of strokes one way it is a function of the place: friction was a warm-up or a payload."""
    place = -np.cos(2 * np.pi * waves * np.linspace(0, 1, 2000))
    runs = [Recording(f"run {k}", 200.0, current_a=place, position_rad=place) for k in range(2)]
    track = build_track(runs, Joint())
    found = built_in_library()["warmup"].guesses(track, np.zeros(0))
    assert {guess["per_recording"] for guess in found} == clocks
    payloads = built_in_library()["payload_change"].guesses(track, np.zeros(0))
    payloads = [guess for guess in payloads if "until_s" not in guess]
    assert len(payloads) == steps
    assert steps > 1 or payloads == [{"since_s": 10.0}]


def test_a_payload_is_held_from_rest_to_rest_where_the_position_is_logged():
    """Half turns that are lost at one rest and found at another displace the load, too."""
    moves = np.tile(np.repeat([0.0, 1.0, 0.0, -1.0], 250), 6)
    run = Recording("run", 250.0, current_a=moves, position_rad=np.cumsum(moves) / 250)
    track = build_track([run], Joint())
    track = replace(track, period_s=4.0, group=np.zeros(track.size, dtype=np.int64))
    effect = built_in_library()["payload_change"]
    assert any("gripped_s" in guess for guess in effect.guesses(track, np.zeros(0)))
    followed = replace(track, channels=track.channels - {"logged"})
    assert not any("gripped_s" in guess for guess in effect.guesses(followed, np.zeros(0)))


@pytest.mark.parametrize(("begins_s", "since"), [(4.0, 4.0), (8.0, 4.5)])
def test_a_tool_is_changed_between_recordings_if_nothing_open_tells(begins_s, since):
    """In the middle of what is sealed half of that was predicted with the wrong payload."""
    rows = np.r_[0:30, 61:100]
    track = SimpleNamespace(
        open_samples=rows,
        time_s=np.arange(100) / 10,
        starts_s=np.array([0.0, begins_s]),
        payload_kg=None,
    )
    found = built_in_library()["payload_change"].settled({"since_s": 3.3}, track)
    assert found["since_s"] == pytest.approx(since)


def test_a_whole_dead_time_is_what_each_logged_phase_loses():
    _, track = track_of()
    effect = built_in_library()["dead_time"]
    angle = np.linspace(0.0, 40.0, track.size)
    side = np.where(np.arange(track.size) % 700 < 300, -1.0, 1.0)
    track = replace(track, electrical_rad=angle, model_a=3.0 * side)
    frames = np.exp(-2j * np.pi / 3 * np.arange(3))
    phases = np.real(3.0 * side[:, None] * np.exp(1j * angle)[:, None] * frames)
    lost = np.real(2 / 3 * np.sign(phases) @ np.conj(frames) * np.exp(-1j * angle))
    whole = {"six_step": 1.0, "whole": 1.0}
    np.testing.assert_allclose(effect.columns(track, whole)[:, 0], lost, atol=1e-12)
    rest = effect.columns(track, {"six_step": 1.0})[:, 0]
    np.testing.assert_allclose(lost - rest, side * 4 / np.pi, atol=1e-12)
    logged = replace(track, channels=track.channels | {"phases"})
    assert whole in effect.guesses(logged, angle)
    assert whole not in effect.guesses(replace(track, channels=frozenset()), angle)
