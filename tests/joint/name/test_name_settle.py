"""What a chain keeps when each effect is asked again beside all others, and what ties with it."""

from types import SimpleNamespace

import numpy as np
import pytest
from closing import joint_of, plain_fit
from scipy.signal import bilinear, lfilter

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.explain.saturated import unnamed_library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.name.chain import chain_of, extended
from opamc_cli.joint.name.search import Pool, beam, trials
from opamc_cli.joint.name.settle import _takes_the_name, lowering, settled

LIBRARY = built_in_library()
SPEED = {"stribeck_speed": 0.1, "exponent": 2.0}


def stribeck(q, v, a, t):
    return np.sign(v) * np.exp(-((v / 0.1) ** 2))


def settle(effect, *terms, names=None, without=(), strength=5.0):
    recording = joint_of("cyclic", effect, strength=strength, rate=100.0)
    start = chain_of(plain_fit(recording), 0)
    dataset = start.fit.dataset
    library = LIBRARY if names is None else {name: LIBRARY[name] for name in names}
    pool = Pool.of(dataset, library, without=without)
    unnamed = Pool.of(dataset, unnamed_library(), without=without)
    return settled(extended(start, *terms), pool, unnamed)


def term(name, **parameters):
    return Term(LIBRARY[name], parameters)


def test_what_adds_nothing_is_dropped():
    for place in (0, 1):
        terms = [term("stribeck", **SPEED)]
        terms.insert(place, term("quadratic_friction"))
        chain, named = settle(stribeck, *terms, names=("stribeck", "quadratic_friction"))
        assert [one.effect.name for one in chain.terms] == ["stribeck"]
        assert [one.term for one in named] == [terms[1 - place]]
        assert named[0].trial.why_not is None


def test_two_imitators_give_way_to_the_effect_that_is_there():
    terms = (term("quadratic_friction"), term("sublinear_friction", exponent=0.3))
    names = ("stribeck", "quadratic_friction", "sublinear_friction")
    chain, _ = settle(stribeck, *terms, names=names)
    assert [one.effect.name for one in chain.terms] == ["stribeck"]


def test_what_looks_the_same_whatever_fits_best_is_a_tie(monkeypatch):
    monkeypatch.setattr(LIBRARY["stribeck"], "ties", lambda parameters, track: ("dead_time",))
    _, (named,) = settle(stribeck, term("stribeck", **SPEED), names=("stribeck",))
    assert named.ties == ("dead_time",)


@pytest.mark.parametrize("name", ["offset", "spring"])
def test_a_name_that_holds_a_part_of_what_a_smooth_function_does_goes(name):
    def stop(q, v, a, t):
        return np.maximum(q - 0.5, 0.0)

    chain, _ = settle(stop, term(name), names=(name,))
    assert [one.effect.name for one in chain.terms] == ["unnamed_angle"]
    kept, _ = settle(stop, term(name), names=(name,), without=("unnamed",))
    assert [one.effect.name for one in kept.terms] == [name]


def test_of_two_names_for_one_regressor_each_tells_the_other():
    def constant(q, v, a, t):
        return np.ones(t.size)

    for mine, other in (("offset", "spring"), ("spring", "offset")):
        added = term(mine) if mine == "offset" else Term(LIBRARY["spring"], {}, keep=(1,))
        chain, named = settle(constant, added, names=("offset", "spring"))
        assert [one.effect.name for one in chain.terms] == [mine]
        assert named[0].ties == (other,)
    chain, named = settle(constant, term("offset"), names=("offset",))
    assert named[0].ties == ()


def test_a_name_that_holds_nine_tenths_of_a_function_keeps_its_place():
    # The rest is told beside it, and is no reason to take the name off.
    def bent(q, v, a, t):
        return np.sign(v) * (np.exp(-((v / 0.1) ** 2)) + 0.12 * np.exp(-((v / 0.4) ** 8)))

    chain, named = settle(bent, term("stribeck", **SPEED), names=("stribeck",), strength=20.0)
    assert [one.term.effect.name for one in named] == ["stribeck"]
    assert [one.effect.name for one in chain.terms] == ["stribeck"]


@pytest.mark.parametrize("resonance_hz", [18.0, 25.0])
def test_a_ripple_that_shakes_the_measured_motion_keeps_its_name(resonance_hz):
    """What looks at the acceleration fits the current better: the acceleration is the ripple's."""
    rng, rate, order, w = np.random.default_rng(2), 1000.0, 60.0, 2 * np.pi * resonance_hz
    t = np.arange(round(20 * rate)) / rate
    speed = 0.6 * np.clip(3 * np.sin(2 * np.pi * t / 5), -1, 1)
    path = np.cumsum(speed) / rate
    swelling = 1 + np.interp(t, np.arange(30) * 0.7, rng.normal(size=30))
    torque = 0.3 * swelling * np.cos(order * path)
    shaken = path + 0.2 * lfilter(*bilinear([1.0], [1.0, 0.6 * w, w**2], rate), torque)
    rigid = 0.2 * np.gradient(speed) * rate + np.sin(path) + 0.5 * np.sign(speed) + 0.3 * speed
    current = rigid + torque + rng.normal(0, 0.01, t.size)
    recording = Recording("run", rate, current_a=current, position_rad=shaken)
    start = chain_of(plain_fit(recording), 0)
    pool = Pool.of(start.fit.dataset, {"ripple": LIBRARY["ripple"]})
    unnamed = Pool.of(start.fit.dataset, unnamed_library())
    best = beam(start, pool)
    assert min(trial.chain.score for trial in trials(start, unnamed)) < best.score - 0.2
    _, named = settled(best, pool, unnamed)
    assert "ripple" in [one.term.effect.name for one in named]


@pytest.mark.parametrize(
    ("name", "beside", "goes"),
    [
        ("ripple", -1.1, True),
        ("ripple", -2.1, False),  # it takes as much where the function is, and is no part of it
        ("mains_hum", -1.1, True),
        ("coupling", -1.1, False),
    ],
)
def test_a_smooth_function_that_does_as_well_takes_a_line_s_place_and_no_joint_s(
    name, beside, goes, monkeypatch
):
    """Of a UR10's elbow a function of the time took the place of the shoulder, and failed."""
    drawn = np.random.default_rng(0).normal(1.0, 0.01, (2, 40))
    best, rival = (SimpleNamespace(deviation=one, score=-1.0, mean_square=1.0) for one in drawn)
    parent = SimpleNamespace(mean_square=4.0, score=1.0)
    both = SimpleNamespace(score=beside)
    monkeypatch.setattr("opamc_cli.joint.name.settle.extended", lambda chain, term: both)
    assert _takes_the_name(rival, best, parent, term(name)) is goes


def test_a_line_keeps_its_name_where_a_smooth_function_of_the_same_size_lacks_too():
    """Of a joint with three effects a ripple of twice the noise lost its name to presliding."""

    def both(q, v, a, t):
        return np.cos(40 * q) + 4 * np.sign(v) * np.exp(-(((np.abs(v) - 0.5) / 0.2) ** 2))

    line = term("ripple", order=40.0)
    _, named = settle(both, line, names=("ripple",))
    assert [one.term.effect.name for one in named] == ["ripple"]


def test_a_name_is_not_dropped_for_what_functions_hold_beside_it():
    def bent(q, v, a, t):
        return q + 0.3 * np.sin(4 * q)

    start = chain_of(plain_fit(joint_of("cyclic", bent, strength=15.0, rate=100.0)), 0)
    angle = Term(unnamed_library()["unnamed_angle"], {"degree": 16.0})
    both = extended(start, Term(LIBRARY["spring"], {}, keep=(0,)), angle)
    alone = extended(start, angle)
    assert alone.fit.rmse(sealed=False) < 1.005 * both.fit.rmse(sealed=False)
    assert [one.effect.name for one in lowering(both).terms] == ["spring", "unnamed_angle"]
    # What takes nothing off the error without them goes.
    idle = extended(start, term("stribeck", **SPEED), angle)
    assert [one.effect.name for one in lowering(idle).terms] == ["unnamed_angle"]
