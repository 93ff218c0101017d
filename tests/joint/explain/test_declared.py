"""A declared model: terms that are given or searched, and the window that predicts best."""

from dataclasses import replace

import numpy as np
import pytest
from closing import MODEL, close_on, close_recording, fit_declared, joint_of, plain_fit
from simulator import simulate

from opamc_cli.joint.effects.hysteresis import dahl_state
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.explain.declared import Ways, declared_fit
from opamc_cli.joint.fit.model import Term, fit_terms
from opamc_cli.joint.motion.kinematics import Recording, Smoothing
from opamc_cli.joint.motion.track import Joint
from tests.marks import long

LIBRARY = built_in_library()
BASE = ("inertia", "gravity", "coulomb", "viscous", "offset")


def stribeck(q, v, a, t):
    return np.sign(v) * np.exp(-((v / 0.15) ** 2))


def declared(*names):
    return tuple((LIBRARY[name], None) for name in names)


@pytest.fixture(scope="module")
def dataset():
    return plain_fit(joint_of("cyclic", stribeck, strength=20.0, rate=100.0)).dataset


def names_of(fit):
    return [term.effect.name for term in fit.terms]


def test_effects_without_parameters_are_fitted_as_they_are(dataset):
    fit = declared_fit(dataset, declared(*BASE))
    direct = fit_terms(dataset, tuple(Term(LIBRARY[name], {}) for name in BASE))
    assert names_of(fit) == list(BASE)
    for found, known in zip(fit.coefficients, direct.coefficients, strict=True):
        np.testing.assert_allclose(found, known)


def test_parameters_that_are_not_given_are_searched_and_the_order_stays(dataset):
    fit = declared_fit(dataset, declared("stribeck", *BASE))
    assert names_of(fit) == ["stribeck", *BASE]
    assert fit.terms[0].parameters["stribeck_speed"] == pytest.approx(0.15, rel=0.1)
    # A fifth of the speed's noise is left.
    without = declared_fit(dataset, declared(*BASE))
    assert fit.rmse(sealed=True) < 0.1 * without.rmse(sealed=True)


def test_parameters_are_searched_again_beside_what_was_found():
    """Alone a Stribeck speed of 1.8 rad/s made up for the weight that the model lacked."""
    recording = joint_of("cyclic", stribeck, strength=5.0, rate=100.0)
    names = ("inertia", "offset", "coulomb", "viscous", "stribeck")
    ways = Ways([recording], Joint(), lambda _: declared(*names))
    before, gravity = ways.best_fit(), Term(LIBRARY["gravity"], {})
    assert before.terms[-1].parameters["stribeck_speed"] > 1
    after = ways.fit_anew(before, (gravity,))
    assert names_of(after) == list(names)
    assert after.terms[-1].parameters["stribeck_speed"] == pytest.approx(0.15, rel=0.02)
    # Where that is no better, nothing is done again.
    assert ways.fit_anew(after, (gravity,)) is None


@pytest.mark.parametrize("share", [0.002, 0.1])
def test_a_declared_hysteresis_may_be_as_short_as_a_bearing_s(share):
    """Healthy joints whose friction builds up over a thousandth of the travel lacked presliding."""
    lengths = []

    def bearing(q, v, a, t):
        lengths.append(share * np.ptp(q))
        return dahl_state(q, lengths[-1]) - np.sign(v)

    recording = joint_of("cyclic", bearing, strength=8.0, rate=1000.0)
    fitted = fit_declared([recording], base=(*MODEL, "inertia", "gravity", "hysteresis"))
    assert fitted.terms[-1].parameters["length_rad"] == pytest.approx(lengths[-1], rel=0.2)


def test_parameters_that_are_given_are_believed(dataset):
    given = Term(LIBRARY["stribeck"], {"stribeck_speed": 0.4, "exponent": 2.0})
    fit = declared_fit(dataset, (*declared(*BASE), (LIBRARY["stribeck"], given)))
    assert fit.terms[-1] is given


def test_two_effects_are_searched_one_beside_the_other(dataset):
    fit = declared_fit(dataset, declared("position_drag", *BASE, "stribeck"))
    assert names_of(fit) == ["position_drag", *BASE, "stribeck"]
    assert fit.terms[-1].parameters["stribeck_speed"] == pytest.approx(0.15, rel=0.1)


@pytest.mark.parametrize("last", ["load_friction", "stribeck"])
@pytest.mark.parametrize(("curve", "loaded", "strength"), [(0.5, 1.0, 5.0), (1.0, 0.5, 8.0)])
def test_each_of_two_is_searched_beside_the_other(curve, loaded, strength, last):
    """A Stribeck speed of 1.4 rad/s, and half of the inertia, made up for what came after them."""

    def both(q, v, a, t):
        load = np.sin(q) + 0.4 * np.cos(q) + 0.15 * a
        return curve * stribeck(q, v, a, t) + loaded * np.sign(v) * np.abs(load)

    (first,) = {"load_friction", "stribeck"} - {last}
    dataset = plain_fit(joint_of("cyclic", both, strength, rate=100.0)).dataset
    fit = declared_fit(dataset, declared(first, *BASE, last))
    parameters = fit.terms[0].parameters | fit.terms[-1].parameters
    assert parameters["stribeck_speed"] == pytest.approx(0.15, rel=0.05)
    assert parameters["inertia_share"] == 0.75
    assert fit.rmse(sealed=True) == pytest.approx(0.02, rel=0.02)


def test_an_effect_that_cannot_be_shown_is_left_out(dataset):
    fit = declared_fit(dataset, declared(*BASE, "thermal_viscous", "dead_time"))
    assert names_of(fit)[: len(BASE)] == list(BASE)
    assert "dead_time" not in names_of(fit)


def rest(seconds=10.0):
    t = np.arange(round(seconds * 100)) / 100
    rng = np.random.default_rng(0)
    return Recording("rest", 100.0, current_a=rng.normal(size=t.size), position_rad=0 * t)


def test_a_joint_at_rest_has_no_fit():
    assert Ways([rest()], Joint(), lambda dataset: declared(*BASE)).best_fit() is None


@pytest.mark.parametrize("motion", ["cyclic", "steps of torque"])
def test_the_window_that_predicts_best_is_taken_and_judged_by_the_same_samples(motion):
    made = joint_of(motion, None, noise_a=1e-3, seconds=20.0)
    seen = 1e-4 * np.round(made.position_rad / 1e-4)
    recording = Recording("run", made.rate_hz, current_a=made.current_a, position_rad=seen)
    ask = [recording], Joint(), lambda dataset: declared(*BASE)
    ways = Ways(*ask)
    best, plain = ways.best_fit(), ways.best_fit(without_rules=("windows",))
    one, other = best.dataset.fine.track, plain.dataset.fine.track
    assert one.kernel.size != other.kernel.size
    np.testing.assert_array_equal(one.moving, other.moving)
    np.testing.assert_array_equal(one.clear, other.clear)
    parts = best.sums.parts
    errors = [fit.sums.held_out()[parts.judged].sum() for fit in (best, plain)]
    assert errors[0] < 0.97 * errors[1]


@pytest.mark.parametrize("seed", [1, 10])
def test_of_windows_that_leave_as_little_the_one_that_leaves_least_at_corners_is_taken(seed):
    """Corners do not count where windows are compared, and the longer one lost 40 % there."""
    made = simulate(seed, (), rate=500.0, kind="trapezoid", cycles=8, quantum=2e-4)
    recording = Recording("run", 500.0, current_a=made.current, position_rad=made.position)
    ways = Ways([recording], Joint(), lambda dataset: declared(*BASE[:4]))
    fit = ways.best_fit()
    assert fit.dataset.smoothing == Smoothing(0.05, from_velocity=False)
    plain = ways.best_fit(without_rules=("windows",))
    told = [one.rmse(sealed=False) for one in (fit, plain)]
    assert told[0] == pytest.approx(told[1], rel=0.02)
    at_corners = [np.std(one.residual_a[one.dataset.fine.fit]) for one in (fit, plain)]
    assert at_corners[0] < 0.85 * at_corners[1]


@pytest.mark.parametrize(
    ("hidden", "size", "rate", "seed"),
    [("time_delay", 15.0, 100.0, 14000014), long("elasticity", 5.0, 2000.0, 14000013)],
)
def test_a_window_does_not_smooth_away_what_something_missing_answers_to(hidden, size, rate, seed):
    # With the declared model alone a window of 120 ms predicts better by 4 % of the error and more.
    _, loop = close_on(seed, (hidden,), size, rate=rate)
    assert [step.term.effect.name for step in loop.steps if step.named] == [hidden]
    assert loop.before.dataset.fine.track.kernel.size < 0.1 * rate
    assert loop.rmse_after_a < 0.5 * loop.rmse_before_a


def test_a_delay_that_a_long_window_hides_next_to_rest_has_its_name():
    """A wind-up of 15.7 Hz had its place: of a joint at rest the window takes more than it does."""
    made = simulate(3, (), rate=250.0, cycles=8, kind="quintic")
    late = np.roll(made.current, 6)
    seen = replace(made, position=5e-6 * np.round(made.position / 5e-6))
    _, loop = close_recording(seen, late)
    assert [step.term.effect.name for step in loop.steps if step.named] == ["time_delay"]
    assert loop.steps[0].term.parameters["delay_s"] == pytest.approx(0.024, abs=0.002)


def test_without_a_reason_the_window_stays():
    ask = [joint_of("cyclic", None)], Joint(), lambda dataset: declared(*BASE)
    ways = Ways(*ask)
    best, plain = ways.best_fit(), ways.best_fit(without_rules=("windows",))
    assert best.dataset.fine.track.kernel.size == plain.dataset.fine.track.kernel.size
    coulomb, viscous = best.coefficients[2], best.coefficients[3]
    assert coulomb == pytest.approx(MODEL["coulomb"], rel=0.02)
    assert viscous == pytest.approx(MODEL["viscous"], rel=0.05)
