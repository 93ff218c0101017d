"""How much of its domain's curve a name holds, and the curve over what it is drawn over."""

from types import SimpleNamespace

import numpy as np
import pytest
from closing import joint_of, plain_fit

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.explain.saturated import unnamed_library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.name.chain import chain_of, extended
from opamc_cli.joint.name.form import curve_of, share_of_form
from opamc_cli.joint.name.search import Pool

LIBRARY = built_in_library()
BINS = 40


def share(effect, *terms):
    start = chain_of(plain_fit(joint_of("cyclic", effect, strength=10.0, rate=100.0)), 0)
    best = extended(start, *terms)
    drop = start.mean_square - best.mean_square
    unnamed = Pool.of(start.fit.dataset, unnamed_library())
    return share_of_form(best, drop, terms[0], unnamed), start, best


def test_a_form_that_is_the_data_s_holds_all_of_the_curve():
    def spring(q, v, a, t):
        return q

    assert share(spring, Term(LIBRARY["spring"], {}))[0] == 1.0


def test_a_form_that_is_another_holds_what_it_takes_of_what_its_domain_explains():
    def waves(q, v, a, t):
        return np.sign(v) * np.sin(9 * np.abs(v))

    found, start, best = share(waves, Term(LIBRARY["quadratic_friction"], {}))
    # All that the effect is can be explained, but for the noise, which is a hundredth of it.
    took = 1 - best.mean_square / start.mean_square
    assert 0 <= took < 0.9
    assert found == pytest.approx(took, abs=0.02)


BEST = SimpleNamespace(mean_square=10.0, score=-1.0)


def effect(name, domain, fast=False):
    return SimpleNamespace(name=name, domain=domain, fast=fast)


VISCOUS = effect("viscous", "velocity")


def rival(left, t_value=3.0, score=-1.1):
    chain = SimpleNamespace(mean_square=left, score=score)
    return SimpleNamespace(chain=chain, t_value=t_value)


UNNAMED = {
    name: effect(name, domain, fast)
    for name, domain, fast in (("bend", "velocity", False), ("tone", "velocity", True),
                               ("place", "joint-angle", False))
}  # fmt: skip


def held(monkeypatch, drop, rivals, term=VISCOUS):
    """Return the share, and the pools that were asked."""
    pools = []
    monkeypatch.setattr(
        "opamc_cli.joint.name.form.trials", lambda chain, pool: pools.append(pool) or rivals
    )
    pool = Pool([], UNNAMED, 0.3, ("beam",))
    return share_of_form(BEST, drop, SimpleNamespace(effect=term), pool), pools


def test_what_explains_most_beside_a_name_is_what_its_form_lacks(monkeypatch):
    # Of an error of 10 the strongest leaves 4.
    assert held(monkeypatch, 2.0, [rival(7.0), rival(4.0), rival(8.0)])[0] == pytest.approx(0.25)
    assert held(monkeypatch, 2.0, [])[0] == 1.0
    assert held(monkeypatch, 2.0, [rival(12.0)])[0] == 1.0
    assert held(monkeypatch, -2.0, [rival(4.0)])[0] == 0.0


def test_only_what_is_sure_and_worth_its_price_counts(monkeypatch):
    for no_rival in (rival(4.0, t_value=2.0), rival(4.0, score=-1.0)):
        assert held(monkeypatch, 2.0, [no_rival])[0] == 1.0


def test_only_slow_functions_of_the_same_domain_are_asked(monkeypatch):
    (pool,) = held(monkeypatch, 2.0, [])[1]
    assert set(pool.library) == {"bend"}
    # However little it takes: the price decides.
    assert (pool.least_share, pool.without) == (0.0, ("beam",))


def test_a_line_is_whole(monkeypatch):
    line = effect("ripple", "velocity", fast=True)
    assert held(monkeypatch, 0.0, [rival(4.0)], line) == (1.0, [])


SIZE = 85
RNG = np.random.default_rng(0)
DIRECTION = np.where(np.arange(SIZE) % 3 == 0, -1.0, 1.0)
TRACK = SimpleNamespace(
    size=SIZE,
    direction=DIRECTION,
    velocity=DIRECTION * RNG.random(SIZE),
    acceleration=RNG.normal(size=SIZE),
    load_a=RNG.normal(size=SIZE),
    model_a=RNG.normal(size=SIZE),
    temperature_c=20 + RNG.random(SIZE),
    time_s=RNG.permutation(SIZE) / 10,
    machine_angle_rad=RNG.random(SIZE) * 30,
    electrical_rad=RNG.random(SIZE) * 30,
    position_rad=RNG.normal(size=SIZE),
)
RESIDUAL = RNG.normal(size=SIZE)
COLUMN = RNG.normal(size=(SIZE, 2))


def drawn(domain, track=TRACK, inside=None, of=None):
    of = of or SimpleNamespace(domain=domain, drawn_over=lambda track: None)
    term = SimpleNamespace(effect=of, parameters={"first": 3.0, "b": 9})
    inside = np.ones(SIZE, dtype=bool) if inside is None else inside
    dataset = SimpleNamespace(
        sharp=SimpleNamespace(spread=lambda part: part, fit=inside, track=track),
        columns=lambda term, fine: COLUMN if fine else None,
    )
    fit = SimpleNamespace(
        dataset=dataset,
        terms=(None, term),
        coefficients=(None, np.array([2.0, -1.0])),
        residual_a=RESIDUAL,
    )
    return curve_of(fit, 1)


@pytest.mark.parametrize(
    ("domain", "over", "side", "covariate", "unit"),
    [
        ("velocity", np.abs(TRACK.velocity), DIRECTION, "speed", "rad/s"),
        ("acceleration", TRACK.acceleration, 1.0, "acceleration", "rad/s²"),
        ("load", np.abs(TRACK.load_a), DIRECTION, "load", "A"),
        ("temperature", TRACK.temperature_c, DIRECTION, "temperature", "°C"),
        ("time", TRACK.time_s, DIRECTION, "time", "s"),
        ("motor-angle", 3 * TRACK.machine_angle_rad / (2 * np.pi) % 1, 1.0,
         "angle within the period", "turns"),
        ("electrical", TRACK.electrical_rad / (2 * np.pi) % 1, 1.0, "electrical angle", "turns"),
        ("frequency", 3 * TRACK.time_s % 1, 1.0, "time within the period", "periods"),
        ("joint-angle", TRACK.position_rad, DIRECTION, "joint angle", "rad"),
    ],
)  # fmt: skip
def test_a_curve_is_drawn_over_its_domain_s_covariate(domain, over, side, covariate, unit):
    inside = np.arange(SIZE) != 5
    curve = drawn(domain, inside=inside)
    assert (curve.covariate, curve.unit) == (covariate, unit)
    named = side * (COLUMN @ [2.0, -1.0])
    places = np.flatnonzero(inside)[np.argsort(over[inside], kind="stable")]
    for k, piece in enumerate(np.array_split(places, BINS)):
        assert curve.x[k] == pytest.approx(over[piece].mean())
        assert curve.named_a[k] == pytest.approx(named[piece].mean())
        both = (named + side * RESIDUAL)[piece].mean()
        assert curve.residual_a[k] == pytest.approx(both)
    assert curve.x.size == curve.named_a.size == curve.residual_a.size == BINS
    assert np.all(np.diff(curve.x) >= 0)


@pytest.mark.parametrize(
    ("name", "over", "side", "covariate"),
    [
        ("current", np.abs(TRACK.model_a), np.sign(TRACK.model_a), "current"),
        ("angle_and_speed", TRACK.position_rad, np.sign(TRACK.velocity), "angle and speed"),
        ("time_and_load", np.abs(TRACK.load_a), DIRECTION, "load"),
    ],
)
def test_a_function_is_drawn_over_what_it_is_a_function_of(name, over, side, covariate):
    function = unnamed_library()[f"unnamed_{name}"]
    curve = drawn(function.domain, of=function)
    assert curve.covariate == covariate
    order = np.argsort(over, kind="stable")
    for k, piece in enumerate(np.array_split(order, BINS)):
        assert curve.x[k] == pytest.approx(over[piece].mean())
        assert curve.named_a[k] == pytest.approx((side * (COLUMN @ [2.0, -1.0]))[piece].mean())


def test_fewer_samples_than_bins_have_a_bin_each():
    inside = np.zeros(SIZE, dtype=bool)
    inside[[3, 40, 41]] = True
    curve = drawn("acceleration", inside=inside)
    np.testing.assert_array_equal(curve.x, np.sort(TRACK.acceleration[inside]))
