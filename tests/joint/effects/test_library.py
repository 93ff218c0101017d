"""The vocabulary, and what a user adds to it."""

import pickle

import pytest

from opamc_cli.errors import ConfigError
from opamc_cli.joint.effects.library import (
    UnknownEffectError,
    built_in_library,
    effect_named,
)
from opamc_cli.stages.model.declared.users_effects import load_user_effects

VOCABULARY = [
    "inertia",
    "gravity",
    "offset",
    "coulomb",
    "viscous",
    "stribeck",
    "quadratic_friction",
    "sublinear_friction",
    "asymmetric_friction",
    "load_friction",
    "thermal_viscous",
    "warmup",
    "spring",
    "payload_change",
    "position_drag",
    "hysteresis",
    "elasticity",
    "coupling",
    "ripple",
    "time_delay",
    "sensor_offset",
    "sensor_gain",
    "dead_time",
    "mains_hum",
]
DOMAINS = {
    "motor-angle",
    "joint-angle",
    "velocity",
    "acceleration",
    "load",
    "temperature",
    "time",
    "frequency",
    "electrical",
}


def test_library_is_the_vocabulary():
    library = built_in_library()
    assert list(library) == VOCABULARY
    assert {effect.domain for effect in library.values()} <= DOMAINS
    assert all(effect.meaning for effect in library.values())


def test_unknown_effect_is_refused_with_the_nearest_name():
    with pytest.raises(ConfigError, match="did you mean stribeck"):
        effect_named(built_in_library(), "striebeck")


def test_a_users_effect_joins_the_library(tmp_path):
    path = tmp_path / "sticky.py"
    path.write_text(
        "from opamc_cli.joint.effects.base import Effect, stack\n"
        "class Sticky(Effect):\n"
        "    name = 'sticky'\n"
        "    domain = 'velocity'\n"
        "    meaning = 'mine'\n"
        "    def columns(self, track, parameters):\n"
        "        return stack(track.velocity**3)\n"
    )
    assert [effect.name for effect in load_user_effects(path)] == ["sticky"]
    path.write_text("raise RuntimeError('no')\n")
    with pytest.raises(ConfigError, match="does not run: RuntimeError: no"):
        load_user_effects(path)
    path.write_text("x = 1\n")
    with pytest.raises(ConfigError, match="defines no class"):
        load_user_effects(path)


def test_a_library_is_without_what_is_excluded():
    assert "ripple" not in built_in_library(("ripple", "spring"))
    assert len(built_in_library(("ripple", "spring"))) == len(VOCABULARY) - 2


def test_what_resembles_nothing_is_told_what_is_known():
    with pytest.raises(UnknownEffectError, match="known are inertia, gravity") as caught:
        effect_named(built_in_library(), "xyzzy")
    assert caught.value.name == "xyzzy"
    # It comes from a worker process, with its name.
    again = pickle.loads(pickle.dumps(caught.value))
    assert (again.name, str(again)) == ("xyzzy", str(caught.value))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (None, "cannot be read"),
        ("raise SystemExit(3)\n", "does not run: SystemExit"),
        ("from opamc_cli.joint.effects.base import Effect\nclass A(Effect):\n    name = 'a'\n",
         "with a name and a domain"),
        ("from opamc_cli.joint.effects.base import Effect\n", "defines no class"),
    ],
)  # fmt: skip
def test_a_file_without_an_effect_is_refused(tmp_path, text, why):
    path = tmp_path / "mine.py"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ConfigError, match=why):
        load_user_effects(path)
