"""`opamc model arm` and the key `arm` of a model: what is written, and every refusal."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from opamc_cli.__main__ import main
from opamc_cli.config.joint_model import ArmConfig, ArmJoint, load_joint_model
from opamc_cli.stages.model.arm import FoundArm

sys.path.append(str(Path(__file__).parents[2] / "arm"))
import arms


def called(capsys, *words):
    with pytest.raises(SystemExit) as stopped:
        main([str(word) for word in words])
    said = capsys.readouterr()
    return int(stopped.value.code or 0), said.out, said.err


def test_what_is_found_is_a_model(tmp_path, capsys):
    run, out = arms.small_run(tmp_path), tmp_path / "arm.yaml"
    code, told, _ = called(capsys, "model", "arm", run, "--out", out, "--json")
    assert code == 0
    told = json.loads(told)
    assert told["arm"] == yaml.safe_load(out.read_text())["arm"]
    assert [*told["left"]] == ["1", "2", "3", "4"]
    model = load_joint_model(out)
    assert model.declared()[0].effect == "arm"
    (tmp_path / "own.yaml").write_text("arm: arm.yaml\nlibrary: []\n")
    own = load_joint_model(tmp_path / "own.yaml")
    assert own.arm == model.arm
    assert [one.effect for one in own.declared()] == ["arm", "inertia", "coulomb", "viscous"]
    assert own.not_searched() == ("gravity", "coupling")
    assert load_joint_model(Path("model"), [f"arm={out}"]).arm == model.arm
    # Once more, but over no other file.
    assert called(capsys, "model", "arm", run, "--out", out, "--quiet") == (0, "", "")
    out.write_text("effects: [arm]\n")
    code, _, said = called(capsys, "model", "arm", run, "--out", out)
    assert code == 2
    assert "choose another --out" in said
    assert out.read_text() == "effects: [arm]\n"


def test_an_arm_is_found_beside_a_payload_that_changes(tmp_path, capsys):
    run, out = arms.small_run(tmp_path, payload_kg=8.0), tmp_path / "arm.yaml"
    code, told, _ = called(capsys, "model", "arm", run, "--out", out, "--json")
    assert code == 0
    assert json.loads(told)["part"] == "last third"
    assert json.loads(told)["left"]["3"] < 0.05


@pytest.mark.parametrize(
    ("first", "axes", "samples", "moving", "code", "said"),
    [
        (1, 3, 2000, True, 5, "does not tell where the joints are"),
        (
            2,
            3,
            2000,
            True,
            3,
            "an arm of axes 1 to n, of 7 at most, is found, not one of axes 2, 3, 4:",
        ),
        (1, 8, 2000, True, 3, "is found, not one of axes 1, 2, 3, 4, 5, 6, 7, 8: number"),
        (1, 3, 12, True, 3, "12 samples are known on all axes: too few"),
        (1, 3, 2000, False, 3, "0 axes with a current move, 2 are needed"),
        (1, 3, 60, True, 3, "46 samples of motion, 250 are needed"),
        (1, 0, 2000, True, 3, "from the positions and currents of all axes"),
    ],
)
def test_a_run_that_does_not_tell_is_refused(
    tmp_path, capsys, first, axes, samples, moving, code, said
):
    rng = np.random.default_rng(8)
    t = np.arange(samples) / 100.0
    names = range(first, first + axes)
    columns = {f"axis{k}_position": moving * np.sin(0.4 * (k + 1) * t) for k in names}
    columns |= {f"axis{k}_current": rng.normal(size=t.size) for k in names or (1,)}
    run, out = arms.saved(tmp_path / "run.parquet", 100.0, columns), tmp_path / "arm.yaml"
    ended, _, error = called(capsys, "model", "arm", run, "--out", out, "--quiet")
    assert ended == code
    assert said in error
    assert error.count("\n") == 1
    assert not out.exists()


def close(tmp_path, capsys, run, text, axis=3):
    """Close an axis; what it says, loop.json's entry, and the model that is written."""
    model, out = tmp_path / "model.yaml", tmp_path / "out"
    model.write_text(text)
    given = ("--model", model, "--axis", axis, "--out", out, "--jobs", 1)
    _, _, said = called(capsys, "model", "close", run, *given)
    (loop,) = json.loads((out / "loop.json").read_text())["axes"]
    return said, loop, yaml.safe_load((out / "model.yaml").read_text())


def test_a_close_finds_the_arm_by_itself(tmp_path, capsys):
    run = arms.small_run(tmp_path)
    said, loop, written = close(tmp_path, capsys, run, "effects: [inertia, gravity, coulomb]\n")
    assert "was found from all axes' currents" in said
    assert loop["declared"] == ["arm", "inertia", "coulomb"]
    assert [one["effect"] for one in loop["steps"]] == ["viscous"]
    assert loop["after"]["rmse_a"] < 0.05
    assert len(written["arm"]["joints"]) == 4
    applied = ("--model", tmp_path / "out" / "model.yaml", "--out", tmp_path / "on")
    assert called(capsys, "model", "evaluate", run, *applied)[0] == 0
    (one,) = json.loads((tmp_path / "on" / "evaluation.json").read_text())["axes"]
    assert one["rmse_a"] < 0.05
    assert called(capsys, "report", "--out", tmp_path / "out")[0] == 0


def test_a_wrong_arm_gives_way_to_couplings(tmp_path, capsys, monkeypatch):
    lying = tuple(ArmJoint(axis=(1.0, 0.0, 0.0)) for _ in range(4))
    found = FoundArm(ArmConfig(joints=lying), "xxxx", {3: 0.1}, {3: 0.5}, "whole")
    monkeypatch.setattr("opamc_cli.stages.model.model.arm_told", lambda *_: found)
    run = arms.small_run(tmp_path)
    said, loop, written = close(tmp_path, capsys, run, "without: []\n")
    assert "they leave less than the arm that was found" in said
    assert "was found from all axes' currents" not in said
    assert "arm" not in {*loop["declared"], *written}
    assert "coupling" in {step["effect"] for step in loop["steps"]}


@pytest.mark.parametrize("without", ["arm", "coupling"])
def test_a_close_finds_no_arm_where_the_model_says_something_of_it(tmp_path, capsys, without):
    run = arms.small_run(tmp_path)
    text = f"effects: [inertia, gravity, coulomb, viscous]\nwithout: [{without}]\n"
    said, loop, written = close(tmp_path, capsys, run, text)
    assert "currents" not in said
    assert "arm" not in loop["declared"]
    assert "arm" not in written


def test_a_close_says_that_runs_do_not_tell_of_an_arm(tmp_path, capsys):
    rng, t = np.random.default_rng(8), np.arange(3000) / 100.0
    columns = {}
    for k in range(1, 5):  # Joints that ask nothing of each other, one after the other.
        own = np.clip(t - 7.5 * (k - 1), 0, 7.5)
        angle, speed = np.sin(2 * own), np.cos(2 * own) * (own > 0) * (own < 7.5)
        noise = 0.05 * rng.normal(size=t.size)
        columns[f"axis{k}_current"] = np.cos(angle) + np.sign(speed) + noise
        columns[f"axis{k}_position"] = angle
    run = arms.saved(tmp_path / "run.parquet", 100.0, columns)
    said, loop, written = close(tmp_path, capsys, run, "without: []\n")
    assert "do not tell where the arm's joints are" in said
    assert "arm" not in {*loop["declared"], *written}


@pytest.mark.parametrize("moving", [4, 1])
def test_a_close_says_why_no_arm_is_sought(tmp_path, capsys, moving):
    """Axes counted from 2 were closed with couplings, and nobody was told."""
    t = np.arange(3000) / 100.0
    columns = {}
    for k in range(4):
        angle = np.sin((2 + 0.3 * k) * t) * (k < moving)
        friction = np.sign(np.gradient(angle)) + 0.05 * np.random.default_rng(k).normal(size=t.size)
        columns |= {f"axis{k + 2}_current": friction, f"axis{k + 2}_position": angle}
    run = arms.saved(tmp_path / "run.parquet", 100.0, columns)
    said, loop, _ = close(tmp_path, capsys, run, "without: []\n", axis=2)
    why = "an arm of axes 1 to n, of 7 at most, is found, not one of axes 2, 3, 4, 5"
    assert (why in said) == (moving == 4)
    assert any(why in note for note in loop["notes"]) == (moving == 4)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("effects: [arm, inertia]\n", "not where the joints are"),
        ("arm: none.yaml\n", "none.yaml: cannot be read"),
        ("arm: model.yaml\n", "has no `arm` that tells where the joints are"),
        ("arm: {joints: []}\n", "arm.joints"),
        ("arm: {joints: [{axis: [0, 0, 0]}]}\n", "is no direction"),
        ("arm: {joints: [{xyz: [0, 0]}]}\n", "arm.joints.0.xyz.2 is missing"),
        ("arm: {joint: []}\n", "did you mean 'joints'"),
    ],
)
def test_an_arm_that_tells_nothing_is_refused(tmp_path, capsys, text, said):
    run, model = arms.small_run(tmp_path), tmp_path / "model.yaml"
    model.write_text(text)
    given = ("--model", model, "--axis", 2, "--out", tmp_path / "out")
    code, _, error = called(capsys, "model", "fit", run, *given)
    assert code == 2
    assert said in error
    assert error.count("\n") == 1


def test_the_effect_is_listed_and_its_file_read(tmp_path, capsys):
    code, told, _ = called(capsys, "model", "effects", "arm")
    assert code == 0
    assert "base parameters" in told
