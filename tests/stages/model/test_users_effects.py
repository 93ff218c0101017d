"""What a user's effect answers is checked, and a mistake is told with its place."""

import os
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from opamc_cli.errors import ConfigError
from opamc_cli.stages.model.declared.users_effects import load_user_effects

TRACK = SimpleNamespace(size=4, rate_hz=100.0, channels={"position"})
HEAD = (
    "import numpy as np\n"
    "from opamc_cli.joint.effects.base import Effect\n"
    "class Mine(Effect):\n"
    "    name, domain, meaning = 'mine', 'velocity', 'mine'\n"
)


def effect_of(tmp_path, body):
    path = tmp_path / "mine.py"
    path.write_text(HEAD + body)
    (effect,) = load_user_effects(path)
    return effect


def method(name, answer, arguments="self, track, parameters"):
    return f"    def {name}({arguments}):\n        return {answer}\n"


@pytest.mark.parametrize(
    ("answer", "why"),
    [
        ("[1.0, 2.0]", r"list; \(4, m\) is needed"),
        ("np.ones(4)", r"shape \(4,\); \(4, m\)"),
        ("np.ones((3, 1))", r"shape \(3, 1\)"),
        ("np.ones((4, 0))", "0 columns"),
        ("np.full((4, 1), 'a')", "columns of <U1"),
        ("np.array([[1.0], [2.0], [np.nan], [1.0]])", "not finite"),
    ],
)
def test_columns_are_finite_numbers_for_every_sample(tmp_path, answer, why):
    effect = effect_of(tmp_path, method("columns", answer))
    with pytest.raises(ConfigError, match=rf"mine.py:5: columns of effect 'mine' returns.*{why}"):
        effect.columns(TRACK, {})


@pytest.mark.parametrize("answer", ["np.ones((4, 2))", "np.ones((4, 1), dtype=int)"])
def test_what_is_right_passes(tmp_path, answer):
    effect = effect_of(tmp_path, method("columns", answer))
    np.testing.assert_array_equal(effect.columns(TRACK, {}), eval(answer))


@pytest.mark.parametrize(
    ("name", "arguments", "wrong", "right"),
    [
        ("guesses", "self, track, residual", ("[]", "{}", "[{'a': 'b'}]", "[{'a': float('inf')}]"),
         "[{'a': 1}]"),
        ("limits", "self, track", ("[]", "{'a': (2, 1)}", "{'a': 1}", "{'a': [0, 1]}"),
         "{'a': (0, 1)}"),
        ("interpretation", "self, parameters, track", ("None", "3"), "'told'"),
        ("untestable", "self, track", ("True", "0"), "None"),
    ],
)  # fmt: skip
def test_every_answer_has_its_form(tmp_path, name, arguments, wrong, right):
    given = {"residual": np.zeros(4), "parameters": {}, "track": TRACK}
    called = [given[each] for each in arguments.split(", ")[1:]]
    for answer in wrong:
        effect = effect_of(tmp_path, method(name, answer, arguments))
        with pytest.raises(ConfigError, match=f"mine.py:5: {name} of effect 'mine'"):
            getattr(effect, name)(*called)
    effect = effect_of(tmp_path, method(name, right, arguments))
    assert getattr(effect, name)(*called) == eval(right)


@pytest.mark.parametrize("name", ["needs", "searches", "forms"])
@pytest.mark.parametrize("given", ["'position'", "['position']", "(1,)"])
def test_lists_of_names_are_tuples_of_texts(tmp_path, name, given):
    with pytest.raises(ConfigError, match=f"{name} of effect 'mine' is"):
        effect_of(tmp_path, f"    {name} = {given}\n")
    assert getattr(effect_of(tmp_path, f"    {name} = ('a',)\n"), name) == ("a",)


def test_a_file_that_was_corrected_within_the_second_is_read_anew(tmp_path, monkeypatch):
    """Bytecode that an interpreter keeps is told from another's by size and second alone."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    path = tmp_path / "mine.py"
    for size in (0.5, 0.7):
        path.write_text(f"{HEAD}    size = {size}\n")
        os.utime(path, (1e9, 1e9))
        (effect,) = load_user_effects(path)
        assert effect.size == size
    assert [path.name for path in tmp_path.iterdir()] == ["mine.py"]
