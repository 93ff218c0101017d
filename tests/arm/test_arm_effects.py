"""What the links ask of one joint, as an effect: named beside it is what the joint lacks."""

import json

import arms
import numpy as np
import pytest

from opamc_cli.__main__ import main
from opamc_cli.arm.effects import arm_effects
from opamc_cli.arm.torques import JointPlace, KinematicChain, torques
from opamc_cli.errors import ConfigError
from opamc_cli.joint.motion.kinematics import Recording, build_track
from opamc_cli.joint.motion.track import Joint


def recorded(folder, lacks):
    """40 s of random motions of all axes, the current of axis 4 with one thing more."""
    rate, rng, noise = 200.0, np.random.default_rng(3), 0.02
    t, q, v, a = arms.waves(6, rate, rng)
    motion = np.array([q, v, a])
    current = arms.asked(arms.chain(), motion, arms.bodies(4))[3] / 5
    current += 0.3 * a[3] + 0.4 * np.sign(v[3]) + 0.1 * v[3] + noise * rng.normal(size=t.size)
    if lacks == "payload_change":
        # A kilogram, a tenth of a metre before the flange.
        held = np.array([1.0, 0.0, 0.1, 0.0, *(0.01, 0.0, 0.0, 0.0, 0.0, 0.01)])
        current += (t > 21) * (torques(arms.chain(), motion)[3][:, -10:] @ held) / 5
    else:
        current += 0.2 / np.mean(v[3] ** 2) * v[3] * np.abs(v[3])
    columns = {f"axis{axis}_position": q[axis - 1] for axis in range(1, 7)}
    arms.saved(folder / "run.parquet", rate, {"axis4_current": current, **columns})
    places = [{"xyz": xyz, "rpy": rpy, "axis": axis} for xyz, rpy, axis in arms.UR10]
    (folder / "ur10.yaml").write_text(json.dumps({"arm": {"joints": places}}))
    (folder / "model.yaml").write_text(
        "arm: ur10.yaml\neffects: [inertia, gravity, offset, coulomb, viscous]\n"
    )
    return noise


def ended(*words):
    with pytest.raises(SystemExit) as stopped:
        main([str(word) for word in words])
    return int(stopped.value.code or 0)


@pytest.mark.long
@pytest.mark.parametrize("lacks", ["quadratic_friction", "payload_change"])
def test_beside_a_declared_arm_what_its_joint_lacks_is_named(tmp_path, lacks):
    noise, run = recorded(tmp_path, lacks), tmp_path / "run.parquet"
    given = ("--model", tmp_path / "model.yaml", "--axis", 4, "--jobs", 1)
    assert ended("model", "close", run, *given, "--out", tmp_path / "out") == 0
    (loop,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    assert loop["declared"] == ["arm", "inertia", "offset", "coulomb", "viscous"]
    assert [step["effect"] for step in loop["steps"]] == [lacks]
    assert loop["verdict"] == "closed"
    assert loop["after"]["rmse_a"] < 1.1 * noise
    if lacks != "payload_change":  # which other recordings need not carry
        closed, alone = tmp_path / "out" / "model.yaml", tmp_path / "alone.yaml"
        alone.write_text(closed.read_text())
        (tmp_path / "ur10.yaml").unlink()
        applied = ("--model", alone, "--out", tmp_path / "on", "--quiet")
        assert ended("model", "evaluate", run, *applied) == 0
        (one,) = json.loads((tmp_path / "on" / "evaluation.json").read_text())["axes"]
        assert one["rmse_a"] < 1.1 * noise


def track(axes, of=6):
    """A joint's track with the positions of some others."""
    t, q, _, _ = arms.waves(of, 100.0, np.random.default_rng(1))
    others = {axis: q[axis - 1] for axis in axes}
    recording = Recording("run", 100.0, np.sin(t), position_rad=q[3], others_rad=others)
    return build_track([recording], Joint())


def test_an_arm_asks_for_all_of_its_axes():
    effect, rows = arm_effects(arms.chain())["arm"], np.arange(50)
    known = track((1, 2, 3, 5, 6))
    columns = effect.columns_at(known, {}, rows)
    assert columns.shape[0] == 50
    assert np.linalg.matrix_rank(effect.columns(known, {})) == columns.shape[1]
    with pytest.raises(ConfigError, match="those of axes 1, 2, 3, 5: log all"):
        effect.columns_at(track((1, 2, 3, 5)), {}, rows)


def test_a_weight_that_asks_nothing_of_an_upright_joint_is_not_sought():
    known = track((1, 2, 3, 5, 6))
    upright = JointPlace((0.0, 0.0, 0.1), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    payload = arm_effects(KinematicChain((upright,) * 6))["payload_change"]
    assert payload.untestable(known) == "a weight in the gripper asks nothing of this joint"
    assert "asks nothing" not in str(arm_effects(arms.chain())["payload_change"].untestable(known))


def test_base_parameters_hold_all_that_links_ask():
    effect, known = arm_effects(arms.chain())["arm"], track((1, 2, 3, 5, 6))
    motion = np.empty((3, 6, known.size))
    motion[:, 3] = known.position_rad, known.velocity, known.acceleration
    for place, axis in enumerate(known.other_axes):
        motion[:, axis - 1] = known.others[:, place::5].T
    asked = arms.asked(arms.chain(), motion, arms.bodies(4))[3]
    columns = effect.columns(known, {})
    left = asked - columns @ np.linalg.lstsq(columns, asked)[0]
    assert np.abs(left).max() < 1e-8 * np.abs(asked).max()
