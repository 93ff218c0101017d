"""Which slow effect of the library the target has and the baseline has not."""

import numpy as np
import pytest
import sessions
from closing import moved
from sessions import COEFFICIENTS, LIBRARY, RATE, TERMS, units_of

from opamc_cli.joint.change import search
from opamc_cli.joint.change.search import find_slow_causes
from opamc_cli.joint.change.slow import learn, with_model

FEW = {search.SCALE.name: search.SCALE} | {name: LIBRARY[name] for name in (
    "payload_change", "offset", "coulomb", "viscous", "sublinear_friction", "quadratic_friction",
    "spring", "asymmetric_friction", "thermal_viscous",
)}  # fmt: skip


def causes_of(extra, library=FEW, colder=None, **options):
    units = units_of(extra, colder=colder, **options)
    population = learn(units, TERMS)
    return find_slow_causes(with_model(units, population), population, library)


def only(*names):
    return {name: LIBRARY[name] for name in names}


def payload(q, v, a, t):
    return 0.1 * a + 0.3 * np.sin(q) + 0.1 * np.cos(q)


def scaled(q, v, a, t):
    columns = np.stack([a, np.sin(q), np.cos(q), np.sign(v), v, np.ones(q.size)], axis=1)
    return 0.15 * columns @ COEFFICIENTS


def heavy(q, v, a, t):
    return 0.15 * np.sign(v)


def thick(q, v, a, t):
    return 0.15 * v


def stiff(q, v, a, t):
    return 1.5 * q + 0.5


def of_friction(extra):
    """By which share a joint has more friction in all, as root mean square on its way."""
    q, v, _ = moved("cyclic", RATE, 16.0)
    own = COEFFICIENTS[3] * np.sign(v) + COEFFICIENTS[4] * v
    before, after = (np.mean(one[np.abs(v) > 0.1] ** 2) for one in (own, own + extra(q, v, 0, 0)))
    return np.sqrt(after / before) - 1


def test_healthy_sessions_have_no_cause():
    assert causes_of(None) == []
    assert causes_of(payload, library={}) == []


def test_another_payload_is_told_from_a_gear():
    (cause,) = causes_of(payload)
    assert cause.effect == "payload_change"
    assert cause.parameters == {}
    assert "check the tool, not the gear" in cause.interpretation
    assert cause.p_value < 1e-3
    np.testing.assert_allclose(cause.shift.coefficients, [0.3, 0.1, 0.1], atol=0.05)


def test_all_of_the_current_in_one_proportion_is_no_payload():
    (cause,) = causes_of(scaled)
    assert (cause.effect, cause.ties) == ("current_scale", ())
    assert cause.evidence["relative_change"] == pytest.approx(0.15, rel=0.1)
    assert "magnets that have weakened" in cause.interpretation
    # what one of two causes explains as well, or both better, is none
    assert causes_of(lambda *at: scaled(*at) + 2 * heavy(*at))[0].effect != "current_scale"
    assert causes_of(lambda *at: payload(*at) + 0.5 * thick(*at))[0].effect != "current_scale"


def test_a_scale_that_is_sure_while_friction_is_not_is_named_in_a_tie(monkeypatch):
    likeliest = search._likeliest

    def unsure(*given):
        best = likeliest(*given)
        return {name: (p if name == "current_scale" else 1.0, s) for name, (p, s) in best.items()}

    monkeypatch.setattr(search, "_likeliest", unsure)
    (cause,) = causes_of(scaled)
    assert (cause.effect, cause.ties) == ("current_scale", ())
    # what friction of both kinds explains much better is none
    assert causes_of(heavy) == []
    monkeypatch.setattr(search, "NEARLY_AS_GOOD", 0.0)
    assert causes_of(scaled)[0].ties == ("coulomb", "viscous")


def test_what_no_model_holds_has_no_slow_cause():
    """Noise in a current's place was magnets that had lost 102 %, or friction that had lost 97."""
    rng = np.random.default_rng(0)

    def noise(*at):
        return -scaled(*at) / 0.15 + rng.normal(0, 1.0, at[0].size)

    assert causes_of(noise) == []
    (cause,) = causes_of(lambda *at: -0.95 * scaled(*at) / 0.15)
    assert cause.effect == "current_scale"


def test_an_offset_is_told():
    (cause,) = causes_of(lambda q, v, a, t: 0.2 + 0 * q)
    assert (cause.effect, cause.interpretation) == ("offset", LIBRARY["offset"].meaning)
    assert cause.shift.coefficients == pytest.approx([0.2], abs=0.03)


def test_dry_friction_is_no_grease():
    (cause,) = causes_of(heavy)
    assert cause.effect == "coulomb"
    assert not set(cause.ties) & {"thermal_viscous", "payload_change"}


def test_a_change_that_is_too_small_is_of_no_interest():
    (cause,) = causes_of(lambda q, v, a, t: 0.05 + 0 * q, noise_a=0.001, spread=0.0)
    assert cause.effect == "offset"
    assert causes_of(lambda q, v, a, t: 0.005 + 0 * q, noise_a=0.001, spread=0.0) == []


def test_friction_that_grows_with_the_speed_may_be_grease_where_no_temperature_is_logged():
    (cause,) = causes_of(thick)
    assert cause.effect == "thermal_viscous"
    assert cause.parameters == {}
    assert "no temperature was logged" in cause.interpretation
    assert cause.evidence["relative_change"] == pytest.approx(of_friction(thick), rel=0.3)
    assert "viscous" in cause.ties
    # By a factor of two at most.
    assert causes_of(lambda q, v, a, t: 0.5 * v)[0].effect == "viscous"
    # Less may be warmth, however much.
    less = causes_of(lambda q, v, a, t: -0.2 * v)[0]
    assert (less.effect, less.ties[0]) == ("thermal_viscous", "viscous")
    assert causes_of(thick, library=only("viscous"))[0].effect == "viscous"


@pytest.mark.parametrize("change", [0.5, -0.5])
def test_of_friction_it_is_known_by_how_much_it_has_grown(change):
    """Of all of it, dry and viscous: how they share is not sure (a brake's 67 % were 316 %)."""

    def more(q, v, a, t):
        return change * COEFFICIENTS[3] * np.sign(v)

    (cause,) = causes_of(more, library=only("coulomb"), noise_a=0.001, spread=0.0)
    assert cause.evidence["relative_change"] == pytest.approx(of_friction(more), rel=0.05)


def test_friction_that_has_grown_at_all_speeds_is_no_grease():

    def names(dry, wet):
        def more(q, v, a, t):
            return dry * COEFFICIENTS[3] * np.sign(v) + wet * COEFFICIENTS[4] * v

        return {cause.effect for cause in causes_of(more)}

    assert "thermal_viscous" in names(0.1, 0.9)
    assert names(0.5, 0.9)
    assert "thermal_viscous" not in names(0.5, 0.9)


@pytest.mark.parametrize(
    ("colder", "size", "effect", "word"),
    [
        (15.0, 0.15, "thermal_viscous", "colder grease (by 15 °C"),
        (-15.0, -0.1, "thermal_viscous", "warmer grease (by 15 °C"),
        (0.0, 0.15, "viscous", ""),  # as warm as ever
        (1.5, 0.15, "viscous", ""),
        (-15.0, 0.15, "viscous", ""),  # warmer, and stiffer
        (4.0, 0.15, "viscous", ""),  # half as stiff again for four degrees
    ],
)
def test_grease_of_another_temperature_is_stiffer_when_cold_and_not_by_more(
    colder, size, effect, word
):
    cause = causes_of(lambda q, v, a, t: size * v, colder=colder)[0]
    assert cause.effect == effect
    assert word in cause.interpretation
    if effect == "thermal_viscous":
        assert cause.parameters["warmer_c"] == pytest.approx(-colder, abs=0.1)
        assert "viscous" in cause.ties


@pytest.mark.parametrize(("colder", "dry", "effect"), [
    (3.0, 0.7, "coulomb"), (-3.0, -0.5, "coulomb"), (-3.0, -0.1, "thermal_viscous"),
])  # fmt: skip
def test_dry_friction_changes_by_no_more_than_the_temperature_can_do(colder, dry, effect):
    """A brake that drags by 70 % was colder grease by 2 degrees, for viscous friction rose, too."""

    def more(q, v, a, t):
        return dry * COEFFICIENTS[3] * np.sign(v) + 0.1 * np.sign(dry) * COEFFICIENTS[4] * v

    (cause, *_) = causes_of(more, colder=colder, noise_a=0.001, spread=0.0)
    assert cause.effect == effect


@pytest.mark.parametrize(
    ("colder", "effect", "word"),
    [
        (None, "coulomb", search.LESS_FRICTION),  # warmth would thin the grease
        (-15.0, "thermal_viscous", "warmer grease (by 15 °C"),
        (0.0, "coulomb", search.LESS_FRICTION),  # as warm as ever
    ],
)
def test_friction_that_falls_is_warmth_first_where_that_can_be(colder, effect, word):
    """Grease amount and seals were to be checked where a hall was 22 degrees warmer."""

    def less(q, v, a, t):
        return -0.2 * np.sign(v)

    (cause,) = causes_of(less, colder=colder)
    assert cause.effect == effect
    assert word in cause.interpretation
    assert cause.shift.falls == pytest.approx(0.2, abs=0.03)
    assert cause.evidence["relative_change"] == pytest.approx(of_friction(less), abs=0.06)


@pytest.mark.parametrize(("dry", "wet"), [(-0.08, -0.3), (0.0, -0.6), (-0.3, -0.3)])
def test_friction_that_falls_as_warmth_lowers_it_may_be_warmth(dry, wet):
    def less(q, v, a, t):
        return dry * COEFFICIENTS[3] * np.sign(v) + wet * COEFFICIENTS[4] * v

    cause = causes_of(less)[0]
    assert cause.effect == "thermal_viscous"
    assert "less friction, as in warmer grease" in cause.interpretation


@pytest.mark.parametrize(("dry", "wet"), [(0.0, 0.09), (-0.08, -0.02)])
def test_a_current_that_falls_with_the_speed_knows_of_no_warmth(dry, wet, monkeypatch):
    """A ball screw whose friction had fallen was excused: -0.4 A s/rad had grown by 38 %."""
    stepper = np.where(np.arange(6) == 4, -0.2, COEFFICIENTS)
    monkeypatch.setattr(sessions, "COEFFICIENTS", stepper)
    found = causes_of(lambda q, v, a, t: dry * np.sign(v) + wet * v)
    assert found
    assert "thermal_viscous" not in {cause.effect for cause in found}


def test_dry_and_wet_friction_that_fall_are_one_cause():
    found = causes_of(lambda q, v, a, t: -0.2 * np.sign(v) - 0.2 * v, spread=0.0)
    assert [cause.effect for cause in found].count("thermal_viscous") == 1


def test_what_falls_by_more_than_there_was_of_it_is_no_friction():
    def less(q, v, a, t):
        return -1.3 * COEFFICIENTS[3] * np.sign(v)

    assert causes_of(less, library=only("coulomb", "viscous", "thermal_viscous")) == []


def test_a_bump_that_is_gone_is_no_friction_that_falls():
    def gone(q, v, a, t):
        return -0.6 * np.sign(v) * np.exp(-(((q - np.median(q)) / 0.05) ** 2))

    (cause, *_) = causes_of(gone, library=only("position_drag", "thermal_viscous"))
    assert (cause.effect, cause.shift.falls) == ("position_drag", 0.0)


def test_cold_grease_that_stiffens_dry_friction_a_little_is_one_cause():
    both = causes_of(lambda q, v, a, t: 0.25 * v + 0.18 * np.sign(v), colder=15.0, spread=0.0)
    assert [cause.effect for cause in both] == ["thermal_viscous"]
    names = [term.effect.name for term in both[0].shift.terms]
    assert names == ["viscous", "coulomb"]
    assert both[0].shift.coefficients == pytest.approx([0.25, 0.18], abs=0.03)
    # Found before the dry friction, another payload keeps its place and holds both.
    three = causes_of(
        lambda q, v, a, t: 0.25 * v + 0.18 * np.sign(v) + payload(q, v, a, t), colder=15.0
    )
    assert [cause.effect for cause in three] == ["thermal_viscous", "payload_change"]
    names = [[term.effect.name for term in cause.shift.terms] for cause in three]
    assert names == [["viscous"], ["viscous", "payload_change", "coulomb"]]


def test_what_a_ripple_leaves_in_the_slow_current_is_no_cause():
    """Beside what sessions differ by it was sublinear, dry and quadratic friction."""
    assert causes_of(lambda q, v, a, t: 0.1 * np.cos(50 * q + 1)) == []


def test_only_friction_is_a_first_cause_that_the_mean_square_does_not_show(monkeypatch):
    monkeypatch.setattr(search, "left_by", lambda compared, *given: np.ones(compared.after.size))
    assert [cause.effect for cause in causes_of(heavy)] == ["coulomb"]
    assert causes_of(payload, library=only("payload_change")) == []
    assert causes_of(stiff, library=only("spring")) == []
    monkeypatch.setattr(search, "HIDDEN_P", 0.0)
    assert causes_of(heavy) == []


def test_two_causes_are_fitted_together():
    found = causes_of(lambda q, v, a, t: payload(q, v, a, t) + heavy(q, v, a, t))
    assert {cause.effect for cause in found} == {"payload_change", "coulomb"}
    assert [len(cause.shift.terms) for cause in found] == [1, 2]
    names = [term.effect.name for term in found[1].shift.terms]
    assert names == [cause.effect for cause in found]


def test_four_things_at_once_are_no_more_than_three_causes():
    def many(q, v, a, t):
        drag = np.sign(v) * np.exp(-0.5 * ((q - 0.3) / 0.1) ** 2)
        return 2 * payload(q, v, a, t) + 0.2 + heavy(q, v, a, t) + drag

    assert len(causes_of(many)) == 3


def test_what_is_no_cause_of_a_change_is_not_asked():
    names = ("inertia", "gravity", "elasticity", "time_delay", "warmup", "stribeck", "ripple")
    assert causes_of(payload, library=only(*names)) == []


def test_a_spring_is_named_where_no_payload_can_be():
    (cause,) = causes_of(stiff, library=only("spring"))
    assert cause.effect == "spring"


def test_what_is_expected_of_the_cold_needs_less_proof():
    def little(q, v, a, t):
        return 0.02 * v

    assert causes_of(little) == causes_of(little, colder=0.0) == []
    assert [cause.effect for cause in causes_of(little, colder=15.0)] == ["thermal_viscous"]
