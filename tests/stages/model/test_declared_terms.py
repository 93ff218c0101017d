"""Declared effects and the parameters that they are given."""

from types import SimpleNamespace

import numpy as np
import pytest

from opamc_cli.config.joint_model import DeclaredEffect, load_joint_model
from opamc_cli.errors import ConfigError
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.motion.kinematics import Recording, build_track
from opamc_cli.joint.motion.track import Joint
from opamc_cli.stages.model.declared.terms import declared_term


@pytest.mark.parametrize("name", ["load_friction", "sublinear_friction"])
@pytest.mark.parametrize("exponent", [-3.0, 0.0])
def test_an_exponent_that_makes_no_friction_is_refused(name, exponent):
    """The power of a load of zero was infinite, and ended as a bug."""
    declared = DeclaredEffect(effect=name, parameters={"exponent": exponent})
    with pytest.raises(ConfigError, match=f"{name}.* has exponent {exponent:g}; .* above 0"):
        declared_term(built_in_library()[name], declared, SimpleNamespace(size=1))


@pytest.mark.parametrize(
    ("entry", "sentence"),
    [
        ("{effect: ripple, parameters: {order: abc}}", "parameters.order is 'abc'; it takes a num"),
        ("{effect: ripple, parameters: {order: .nan}}", "parameters.order is nan; it takes a num"),
        ("{effect: ripple, parameters: {order: [1]}}", "parameters.order is [1]; it takes a num"),
        ("{effect: ripple, parameters: 3}", "parameters is 3; it takes keys and their values"),
        ("{effect: ripple, coefficients: 3}", "coefficients is 3; it takes a list, such as "),
        ("{effect: 3}", "effect is 3; it takes a word"),
        ("{effect: ripple, parametrs: {}}", "parametrs'; did you mean 'parameters'?"),
    ],
)
def test_what_is_no_number_is_refused_by_its_key(entry, sentence, tmp_path):
    file = tmp_path / "model.yaml"
    file.write_text(f"effects: [inertia, {entry}]\n")
    with pytest.raises(ConfigError) as refused:
        load_joint_model(file)
    assert f"effects.1.{sentence}" in str(refused.value)
    assert str(refused.value).startswith(f"{file}: ")
    assert refused.value.exit_code == 2


def test_a_form_takes_no_parameter_of_another():
    given = DeclaredEffect(effect="elasticity", parameters={"link": 1.0, "resonance_hz": 20.0})
    with pytest.raises(ConfigError, match="has no parameter 'resonance_hz'; known: link"):
        declared_term(built_in_library()["elasticity"], given, SimpleNamespace(size=1))


@pytest.mark.parametrize("name", built_in_library())
def test_every_form_that_a_closed_model_may_hold_is_read_again(name):
    """A warm-up of dry friction alone, a payload's weight, or hum, was written and then refused."""
    t = np.arange(4000) / 100.0
    place, beside = np.sin(t), {2: np.cos(0.7 * t), 3: np.sin(1.3 * t)}
    laid = Recording(
        "run", 100.0, np.cos(t), position_rad=place, temperature_c=20 + t, others_rad=beside
    )
    track = build_track([laid], Joint(100.0, 4))
    effect = built_in_library()[name]
    guesses = effect.guesses(track, np.sin(30 * place) + np.sin(2 * np.pi * 40 * t))
    assert guesses
    for guess in guesses:
        for form, keep in [(guess, None), *effect.variants(guess)]:
            columns = None if effect.flags_choose_columns else keep
            declared = DeclaredEffect(effect=name, parameters=form, columns=columns)
            term = declared_term(effect, declared, track)
            if term is None:
                assert not form
                continue
            assert (term.parameters.items() >= form.items(), term.keep) == (True, columns)


def test_a_column_that_an_effect_has_not_is_refused():
    """It ended as a bug."""
    laid = Recording("run", 100.0, np.zeros(400), position_rad=np.sin(np.arange(400) / 40))
    declared = DeclaredEffect(effect="gravity", columns=(0, 7))
    track = build_track([laid], Joint())
    term = declared_term(built_in_library()["gravity"], declared, track)
    with pytest.raises(ConfigError, match="'gravity' has no column 7; its 2 count from 0"):
        term.columns(track)


def test_a_payload_that_is_held_in_every_cycle_is_declared_by_its_rests():
    """`model evaluate` refused its own closed model: "declared without 'since_s'"."""
    path = np.cumsum(np.sin(np.arange(2000) / 100)) / 100
    track = build_track([Recording("r", 250.0, current_a=path, position_rad=path)], Joint())
    held = {"gripped_s": 0.5, "released_s": 2.0}
    declared = DeclaredEffect(effect="payload_change", parameters=held)
    term = declared_term(built_in_library()["payload_change"], declared, track)
    assert term is not None
    assert term.parameters == held


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"gripped_s": 3.0}, "declared without 'released_s'; give it too"),
        ({"released_s": 3.0}, "declared without 'gripped_s'"),
        ({"until_s": 3.0}, "declared without 'since_s'"),
        ({"since_s": 20.0, "until_s": 5.0}, "has until_s 5; it has to be above since_s, 20"),
        (
            {"gripped_s": 2.0, "released_s": 2.0},
            "has released_s 2; it has to be above gripped_s",
        ),
    ],
)
def test_a_payload_with_one_end_too_few_or_that_ends_before_it_begins_is_refused(given, why):
    """One ended as a bug, two were fitted to nothing without a word."""
    path = np.cumsum(np.sin(np.arange(2000) / 100)) / 100
    track = build_track([Recording("r", 250.0, current_a=path, position_rad=path)], Joint())
    declared = DeclaredEffect(effect="payload_change", parameters=given)
    with pytest.raises(ConfigError, match=why):
        declared_term(built_in_library()["payload_change"], declared, track)
