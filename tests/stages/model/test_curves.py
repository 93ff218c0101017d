"""A step's partial residual over what its effect is drawn over."""

from types import SimpleNamespace

import numpy as np
import pytest

from opamc_cli.joint.explain.saturated import unnamed_library
from opamc_cli.stages.model.tables import POINTS as BINS
from opamc_cli.stages.model.tables import curve_of

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
    curve = curve_of(fit, 1)
    numbers = {key: np.array(curve[key]) for key in ("x", "residual_a", "named_a")}
    return SimpleNamespace(**curve | numbers)


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
