"""Chains side by side, and what a candidate has to show."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from closing import joint_of, plain_fit

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.name import search
from opamc_cli.joint.name.candidates import Beside
from opamc_cli.joint.name.chain import chain_of, extended
from opamc_cli.joint.name.search import Pool, beam, candidates, objection, trials

LIBRARY = built_in_library()


def chain_on(motion, effect, **options):
    return chain_of(plain_fit(joint_of(motion, effect, rate=100.0, **options)), 0)


def pool_of(chain, *names, without=()):
    return Pool.of(chain.fit.dataset, {name: LIBRARY[name] for name in names}, without=without)


def names_of(chain):
    return [term.effect.name for term in chain.terms]


def bump(q, v, a, t):
    return np.exp(-0.5 * ((q - 0.3) / 0.1) ** 2) * np.sign(v)


def one(values):
    return (values - np.mean(values)) / np.std(values)


def test_a_single_chain_takes_what_imitates_a_spring_and_two_find_it():
    # Forwards only, a drag at one place imitates a spring and a Stribeck curve, and comes first.
    def both(q, v, a, t):
        return one(q) + 6 * np.sign(v) * np.exp(-((v / 0.2) ** 2))

    names = ("spring", "position_drag", "stribeck", "quadratic_friction", "sublinear_friction",
             "hysteresis")  # fmt: skip
    chain = chain_on("one stroke", both)
    single, two = (beam(chain, pool_of(chain, *names), width) for width in (1, 2))
    assert {"spring", "stribeck"} <= set(names_of(two))
    assert "spring" not in names_of(single)
    assert two.score < single.score - 1
    # The rule's switch is the single chain.
    off = beam(chain, pool_of(chain, *names, without=("beam",)))
    assert off.signature == single.signature


def test_what_is_right_takes_the_place_of_what_has_imitated_it():
    """A delay had imitated a ripple of 15 times the noise, which was refused for its sake."""
    chain = chain_on("cyclic", lambda q, v, a, t: np.sin(60 * q), strength=15.0)
    imitated = extended(chain, Term(LIBRARY["time_delay"], {"delay_s": -0.015}))
    trial, *_ = trials(imitated, pool_of(chain, "ripple"))
    assert names_of(trial.chain) == ["ripple"]
    assert trial.why_not is None


def test_nothing_is_added_to_noise():
    chain = chain_on("cyclic", None)
    names = ("spring", "stribeck", "position_drag", "hysteresis", "quadratic_friction")
    assert names_of(beam(chain, pool_of(chain, *names))) == []


def drag(place=0.3):
    parameters = {"place_rad": place, "width_rad": 0.1, "flatness": 2.0}
    return Term(LIBRARY["position_drag"], parameters)


def why_not(chain, term, *without):
    pool = pool_of(chain, term.effect.name, without=without)
    return objection(extended(chain, term), chain, pool)


@pytest.mark.long
def test_what_is_not_physical_hides_nothing(monkeypatch):
    """The best guess was refused, and what fell by less than a quarter of it was not looked at."""

    def both(q, v, a, t):
        return 2 * one(np.sin(7 * q)) + one(np.sign(v) * np.exp(-((v / 0.1) ** 2)))

    chain = chain_on("cyclic", both, strength=20.0)
    pool = pool_of(chain, "ripple", "stribeck")
    assert "ripple" in names_of(beam(chain, pool))
    monkeypatch.setattr(type(LIBRARY["ripple"]), "plausible", lambda self, values, names: False)
    assert names_of(beam(chain, pool)) == ["stribeck"]
    assert names_of(beam(chain, pool_of(chain, "ripple"))) == []


def friction_after_reversals(q, v, a, t):
    turns = np.flatnonzero(np.diff(np.sign(v), prepend=np.sign(v[0])))
    last = np.maximum.accumulate(np.where(np.isin(np.arange(t.size), turns), t, 0.0))
    return np.sign(v) * np.exp(-(t - last) / 0.2)


@pytest.mark.parametrize(
    ("shape", "why"),
    [
        (lambda q, v, a, t: np.sin(40 * q), None),
        (friction_after_reversals, "lines beside it explain as much: it is none"),
    ],
    ids=["a line", "friction"],
)
def test_a_line_is_one_that_others_do_not_stand_for(shape, why):
    """Thirty coefficients a direction held what every cycle repeats, at any order."""
    chain = chain_on("cyclic", shape, strength=15.0)
    answered = {"order": 40.0, "direction": 1.0, "answer": 1.0, "top_hz": 8.0}
    child = extended(chain, Term(LIBRARY["ripple"], answered))
    assert child.gain_over(chain)[0] > 0.3
    assert objection(child, chain, pool_of(chain, "ripple")) == why
    assert objection(child, chain, pool_of(chain, "ripple", without=("decoys",))) is None


def test_an_effect_has_to_take_its_share():
    chain = chain_on("cyclic", bump, strength=2.0)
    assert why_not(chain, drag()) is None
    assert "5% is asked" in why_not(chain, drag(-0.5))
    small = chain_on("cyclic", bump, strength=0.15)
    assert "5% is asked" in why_not(small, drag())
    assert why_not(small, drag(), "share") is None


def test_friction_resists():
    lowered = chain_on("cyclic", lambda q, v, a, t: -bump(q, v, a, t), strength=200.0)
    assert "not physical" in why_not(lowered, drag())
    assert why_not(lowered, drag(), "sign") is None


def test_slow_noise_is_no_payload():
    def drifting(q, v, a, t):
        return np.cumsum(np.random.default_rng(3).normal(size=t.size))

    chain = chain_on("cyclic", drifting, strength=3.0)
    pool = pool_of(chain, "payload_change", without=("drift",))
    found = beam(chain, pool)
    assert names_of(found) == ["payload_change"]
    assert "slow noise" in why_not(chain, found.terms[0])


def moving(waves, load=lambda q, t: np.sin(q), quantum=0.0, **logged):
    """A joint whose motion is a sum of waves (amplitude in rad, times in 10 s, phase)."""
    t, w = np.arange(6000) / 100.0, 2 * np.pi / 10
    q = sum(a * np.sin(k * w * t + p) for a, k, p in waves)
    v = sum(a * k * w * np.cos(k * w * t + p) for a, k, p in waves)
    acceleration = -sum(a * (k * w) ** 2 * np.sin(k * w * t + p) for a, k, p in waves)
    current = 0.4 * acceleration + load(q, t) + 0.5 * np.sign(v) + 0.3 * v
    current += np.random.default_rng(1).normal(0, 0.005, t.size)
    seen = np.round(q / quantum) * quantum if quantum else q
    recording = Recording("run", 100.0, current_a=current, position_rad=seen, **logged)
    return chain_of(plain_fit(recording), 0)


def test_a_payload_over_a_stroke_too_short_to_change_its_torque_is_no_slow_noise():
    chain = moving([(0.03, 1, 0.3)], lambda q, t: np.sin(q + 1.0) * (1 + 0.1 * (t > 31)))
    found = beam(chain, pool_of(chain, "payload_change"))
    assert names_of(found) == ["payload_change"]
    assert found.gain_beside_drift(chain)[0] < 0.05


def test_what_smoothing_takes_from_the_motion_is_no_wind_up():
    chain = moving([(0.7, 1, 0.3), (0.1, 8, 2.0)], quantum=2e-3)
    found = beam(chain, pool_of(chain, "elasticity", without=("smoothing",)))
    assert names_of(found) == ["elasticity"]
    assert "smoothing" in why_not(chain, found.terms[0])


def priced(*rules):
    chain = chain_on("cyclic", bump, strength=0.28)
    assert extended(chain, drag()).gain_over(chain)[0] > 0.05
    return names_of(beam(chain, pool_of(chain, "position_drag", without=rules)))


def test_a_price_is_asked_for_every_degree_of_freedom():
    assert priced() == []


def test_guesses_that_lie_ready_are_asked_only_if_their_effect_is_in_the_pool():
    chain = chain_on("cyclic", bump, strength=5.0)
    pool = pool_of(chain, "position_drag", "spring")
    assert "position_drag" in {one.term.effect.name for one in trials(chain, pool)}
    spring = replace(pool, library={"spring": LIBRARY["spring"]})
    assert "position_drag" not in {one.term.effect.name for one in trials(chain, spring)}


@pytest.mark.parametrize("motion", ["cyclic", "steps of torque"])
@pytest.mark.parametrize("strength", [5.0, 20.0])
@pytest.mark.parametrize("form", [{}, {"exponent": 2.0}])
def test_friction_that_follows_the_weight_alone_is_found_in_its_own_form(motion, strength, form):
    # All of the inertia taken into the load, it shows as nothing; and its own form was reached
    # from a load whose zero was right alone.
    def by_weight(q, v, a, t):
        return np.sign(v) * np.abs(np.sin(q) + 0.4 * np.cos(q)) ** form.get("exponent", 1.0)

    chain = chain_of(plain_fit(joint_of(motion, by_weight, strength)), 0)
    (found,) = trials(chain, pool_of(chain, "load_friction"))
    assert found.term.parameters == {"inertia_share": 0.0} | form
    assert found.why_not is None
    assert found.chain.fit.rmse(sealed=False) == pytest.approx(0.02, rel=0.05)


def called(name):
    return SimpleNamespace(effect=SimpleNamespace(name=name))


def test_of_chains_that_hold_the_same_effects_the_best_alone_is_followed(monkeypatch):
    kinds = ("ripple", -3.0), ("ripple", -2.0), ("drag", -1.0), ("spring", -0.5)
    made = [
        SimpleNamespace(score=score, mean_square=1.0, terms=[called(name)]) for name, score in kinds
    ]
    start, asked = SimpleNamespace(score=0.0, mean_square=1.0, terms=[]), []
    best = SimpleNamespace(score=-9.0, mean_square=1.0, terms=[called("hum")])
    refused = SimpleNamespace(chain=best, why_not="takes nothing")

    def possible(chain, pool, known):
        asked.append(chain)
        added = [SimpleNamespace(chain=one, why_not=None) for one in made]
        return [*added, refused] if chain is start else []

    monkeypatch.setattr(search, "trials", possible)
    assert beam(start, Pool([], {}), 2) is made[0]
    assert asked == [start, made[0], made[2]]


@pytest.mark.parametrize("width", [1, 2])
def test_chains_are_followed_as_far_as_the_score_falls(monkeypatch, width):
    scores = enumerate((0.0, -1.0, -0.5, -3.0))
    chains = [
        SimpleNamespace(score=score, mean_square=1.0, terms=[called(str(place))])
        for place, score in scores
    ]

    def possible(chain, pool, known):
        following = chains[chains.index(chain) + 1 :][:1]
        return [SimpleNamespace(chain=one, why_not=None) for one in following]

    monkeypatch.setattr(search, "trials", possible)
    assert beam(chains[0], Pool([], {}), width).score == -1.0


def test_friction_that_rises_at_the_lowest_speeds_alone_is_sublinear_beside_dry_friction():
    """The best exponent is the least that is tried; it was refused, and a function of speed added.

    (Sublinear friction of 1.5 times the noise, seeds 38000002 and 45000002 of the two masses.)
    """
    chain = chain_on("cyclic", lambda q, v, a, t: np.sign(v) * np.abs(v) ** 0.08)
    found = beam(chain, pool_of(chain, "sublinear_friction", "stribeck", "offset"))
    assert names_of(found) == ["sublinear_friction"]
    assert found.terms[0].parameters["exponent"] < 0.12


def test_a_slow_effect_is_judged_beside_a_ripple_that_is_fitted_with_it():
    def friction(q, v, a, t):
        return np.sign(v) * np.abs(v) ** 0.3

    fit = plain_fit(joint_of("steps of torque", friction, rate=1200.0, seconds=24.0))
    # Fitted by itself, what a drive makes of this ripple takes up most of the friction.
    forms = {"order": 2.0, "direction": 1.0, "answer": 1.0, "top_hz": 20.0}
    chain = extended(chain_of(fit, 0), Term(LIBRARY["ripple"], forms))
    assert chain.fit.dataset.factor > 1
    (found,) = candidates(chain, pool_of(chain, "sublinear_friction"))
    assert found.gain == pytest.approx(extended(chain, found.term).gain_over(chain)[0], abs=1e-4)
    assert found.gain > 0.98
    # As it was fitted without the friction, it leaves little to explain.
    assert Beside(chain, fine=False).candidate(found.term).gain < 0.6


def test_every_form_of_a_slow_effect_is_judged_beside_what_is_fitted_with_it():
    """Another joint's torques hold a constant: the slope alone was asked, and an offset added."""
    time_s = np.arange(6000) / 100.0
    other = 0.2 * np.sin(0.37 * time_s) + 0.1 * np.sin(1.73 * time_s)

    def load(q, t):
        v = np.gradient(q, t)
        return np.sin(q) + 0.3 * np.cos(q + other) + 0.1 * (v > 0) * (0.3 + v)

    waves = (0.7, 1, 0.3), (0.3, 2.37, 1.0), (0.1, 5.3, 2.0)
    rigid = moving(waves, load, others_rad={2: other})
    chain = extended(rigid, Term(LIBRARY["coupling"], {"axis": 2.0}))
    pool = pool_of(chain, "asymmetric_friction", "offset")
    asked = [Term(LIBRARY["asymmetric_friction"], *form) for form in (({},), ({"dry": 0.0}, (1,)))]
    (whole, slope), fitted = (
        [Beside(chain, fine).candidate(term) for term in asked] for fine in (False, True)
    )
    assert slope.score < whole.score
    assert fitted[0].score < fitted[1].score
    assert candidates(chain, pool)[0].term.keep is None
    assert names_of(beam(chain, pool)) == ["coupling", "asymmetric_friction"]
