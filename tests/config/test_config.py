import ast
from functools import cache
from pathlib import Path

import pytest
import yaml
from pydantic import BaseModel

from opamc_cli.config import Config, load_config
from opamc_cli.config.cell import load_cell
from opamc_cli.config.joint_model import load_joint_model
from opamc_cli.config.yaml.document import to_yaml
from opamc_cli.errors import ConfigError

PACKAGE = Path(__file__).parents[2] / "opamc_cli"
DEFAULTS = Path(__file__).parents[2] / "configs" / "default.yaml"


def leaves(model):
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from leaves(field.annotation)
        else:
            yield name, field


def test_the_default_file_is_the_documented_defaults():
    assert DEFAULTS.read_text(encoding="utf-8") == to_yaml(Config())
    assert load_config(DEFAULTS) == Config()


@pytest.mark.parametrize("name", sorted({name for name, _ in leaves(Config)}))
def test_every_key_is_documented_and_read(name):
    field = next(field for other, field in leaves(Config) if other == name)
    assert field.description
    assert name in attributes_read()


@cache
def attributes_read():
    return {
        node.attr
        for path in PACKAGE.rglob("*.py")
        if "config" not in path.relative_to(PACKAGE).parts[:1]
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load)
    }


@pytest.mark.parametrize(
    "override",
    [
        "score.false_alarm_rate=1e-300",
        "joint.gear_ratio=120000",
        "joint.gear_ratio=0.01",
        "identify.speed_tolerance=2",
        "segment.min_still_s=80",
    ],
)
def test_values_that_cannot_be_meant_are_refused(override):
    key, _, value = override.partition("=")
    with pytest.raises(ConfigError, match=rf"^--set: {key} is {value}; .* than or equal to "):
        load_config(None, [override])


@pytest.mark.parametrize("key", ["joint.gear_ratio", "joint.pole_pairs", "patterns.tau"])
def test_a_number_is_not_yes_or_no(key):
    """It would count as 1."""
    with pytest.raises(ConfigError, match=rf"^--set: {key} is True; it takes a number"):
        load_config(None, [f"{key}=true"])
    assert load_config(None, ["joint.explain=false"]).joint.explain is False


def test_joints_have_gears_of_their_own():
    joint = load_config(None, ["joint.gear_ratio={1: 160, 3: 100}", "joint.pole_pairs=5"]).joint
    assert [joint.ratio_of(axis) for axis in (1, 2, 3)] == [160, None, 100]
    assert [joint.poles_of(axis) for axis in (1, 2)] == [5, 5]
    with pytest.raises(ConfigError, match="it takes a number or keys and their values"):
        load_config(None, ["joint.gear_ratio=[160, 100]"])
    with pytest.raises(ConfigError, match="takes a number"):
        load_config(None, ["joint.gear_ratio={1: 160, 3: yes}"])


@pytest.mark.parametrize("entry", ["parameters: {order: yes}", "coefficients: [0.1, yes]"])
def test_a_number_among_others_is_not_yes_or_no(tmp_path, entry):
    model = tmp_path / "model.yaml"
    model.write_text(f"effects: [{{effect: ripple, {entry}}}]\n")
    with pytest.raises(ConfigError, match="takes a number"):
        load_joint_model(model)


@pytest.mark.parametrize(
    "rule",
    ["alarm: {gross: 90}", "alarm: {of: 1000}", "set: {score.false_alarm_rate: 1.0e-300}"],
)
def test_a_rule_that_would_never_alarm_is_refused(tmp_path, rule):
    cell = tmp_path / "cell.yaml"
    cell.write_text(f"runs: logs/{{robot}}/*.parquet\n{rule}\n")
    with pytest.raises(ConfigError, match=r"cell.yaml: .* is .*; .* than or equal to "):
        load_cell(cell)


def test_yaml_round_trip():
    assert load_config(None) == Config.model_validate(yaml.safe_load(to_yaml(Config())))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("patterns: {gama: 1}", ["patterns.gama", "did you mean 'gamma'"]),
        ("patern: {gamma: 1}", ["patern", "did you mean 'patterns'"]),
        ("patterns: {gamma: -1}", ["patterns.gamma is -1", "greater than 0"]),
        ("patterns: {gamma: .nan}", ["patterns.gamma is nan"]),
        ("patterns: {orders: [2]}", ["patterns.orders.0 is 2", "greater than or equal to 3"]),
        ("patterns: {gamma: 1, gamma: 2}", ["given twice"]),
        (
            "patterns: {orders: 5}",
            ["patterns.orders is 5", "it takes a list, such as patterns.orders=[4,5]"],
        ),
        ("- a", ["holds a list"]),
        ("a: [", ["not valid YAML"]),
    ],
)
def test_wrong_files_are_named_in_one_line(tmp_path, text, words):
    path = tmp_path / "c.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    for word in words:
        assert word in message


def test_overrides_win_over_the_file(tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text("patterns: {gamma: 1.0, tau: 4}")
    config = load_config(path, ["patterns.gamma=3", "patterns.tau=null"])
    assert (config.patterns.gamma, config.patterns.tau) == (3.0, None)


@pytest.mark.parametrize("override", ["patterns.gamma", "=3", "patterns.gamma.deep=[1", "a.b.c=1"])
def test_wrong_overrides(override):
    with pytest.raises(ConfigError):
        load_config(None, [override])


def test_a_missing_and_a_binary_file(tmp_path):
    with pytest.raises(ConfigError, match="cannot be read"):
        load_config(tmp_path / "absent.yaml")
    binary = tmp_path / "b.yaml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="UTF-8"):
        load_config(binary)


def test_a_changed_key_changes_the_hash_and_order_does_not():
    changed = load_config(None, ["patterns.gamma=1"])
    assert changed.digest() != Config().digest()
    one = load_config(None, ["patterns.gamma=1", "score.base=10"])
    other = load_config(None, ["score.base=10", "patterns.gamma=1"])
    assert one.digest() == other.digest()


def test_an_override_that_is_wrong_is_not_the_file_s_fault(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("joint: {pole_pairs: 5}\n")
    with pytest.raises(ConfigError, match=r"^--set: joint\.gear_ratio is -3; "):
        load_config(file, ["joint.gear_ratio=-3"])
    file.write_text("joint: {pole_pairs: 0}\n")
    with pytest.raises(ConfigError, match=r"mine\.yaml: joint\.pole_pairs is 0; "):
        load_config(file, ["joint.gear_ratio=100"])
