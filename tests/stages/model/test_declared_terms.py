"""Declared effects and the parameters that they are given."""

from types import SimpleNamespace

import pytest

from opamc_cli.config.joint_model import DeclaredEffect
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
