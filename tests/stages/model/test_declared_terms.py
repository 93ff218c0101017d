"""Declared effects and the parameters that they are given."""

from types import SimpleNamespace

import pytest

from opamc_cli.config.joint_model import DeclaredEffect, load_joint_model
from opamc_cli.errors import ConfigError
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.stages.model.declared_terms import declared_term


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
