"""configs/arm.py: an arm's links by the laws of mechanics, and what is left beside them."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from opamc_cli.__main__ import main

ARM = Path(__file__).parents[3] / "configs" / "arm.py"
UR10 = (
    ((0.0, 0.0, 0.1273), (0.0, 0.0, 0.0), (0, 0, 1)),
    ((0.0, 0.220941, 0.0), (0.0, np.pi / 2, 0.0), (0, 1, 0)),
    ((0.0, -0.1719, 0.612), (0.0, 0.0, 0.0), (0, 1, 0)),
    ((0.0, 0.0, 0.5723), (0.0, np.pi / 2, 0.0), (0, 1, 0)),
    ((0.0, 0.1149, 0.0), (0.0, 0.0, 0.0), (0, 0, 1)),
    ((0.0, 0.0, 0.1157), (0.0, 0.0, 0.0), (0, 1, 0)),
)


@pytest.fixture
def arm():
    module = loaded(ARM)
    module.JOINTS = UR10
    return module


def loaded(path):
    spec = importlib.util.spec_from_file_location("arm", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def links(seed):
    """Inertial parameters of six solid links: a sum of point masses each; (6, 10)."""
    rng = np.random.default_rng(seed)
    found = []
    for mass in (7.8, 12.9, 3.9, 2.0, 2.0, 1.5):
        points, share = rng.normal(0, 0.15, (8, 3)), mass / 8
        inertia = share * sum(p @ p * np.eye(3) - np.outer(p, p) for p in points)
        found.append([mass, *(share * points.sum(0)), *inertia[np.triu_indices(3)]])
    return np.array(found)


def asked(arm, motion, parameters):
    """Torques of all joints; (6, n)."""
    each = [arm.torques(motion, joint) @ parameters[joint:].ravel() for joint in range(6)]
    return np.array(each)


def test_two_links_on_parallel_axes_are_the_planar_elbow(arm):
    # Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, 2006, section 7.3; y is up.
    arm.UP = (0.0, 1.0, 0.0)
    arm.JOINTS = tuple(((x, 0.0, 0.0), (0.0, 0.0, 0.0), (0, 0, 1)) for x in (0.0, 0.7))
    motion = np.random.default_rng(0).uniform(-2, 2, (3, 2, 50))
    (q1, q2), (v1, v2), (a1, a2) = motion
    m1, m2, c1, c2, i1, i2, l1, g = 3.0, 2.0, 0.3, 0.4, 0.2, 0.1, 0.7, 9.81
    b, s = m2 * l1 * c2 * np.cos(q2), m2 * l1 * c2 * np.sin(q2)
    far = m2 * c2**2 + i2
    upper = (m1 * c1**2 + i1 + m2 * l1**2 + far + 2 * b) * a1 + (far + b) * a2
    upper += -s * v2**2 - 2 * s * v1 * v2 + (m1 * c1 + m2 * l1) * g * np.cos(q1)
    upper += m2 * c2 * g * np.cos(q1 + q2)
    lower = (far + b) * a1 + far * a2 + s * v1**2 + m2 * c2 * g * np.cos(q1 + q2)
    first = np.array([m1, m1 * c1, 0, 0, 0, 0, 0, 0, 0, m1 * c1**2 + i1])
    second = np.array([m2, m2 * c2, 0, 0, 0, 0, 0, 0, 0, far])
    assert np.allclose(arm.torques(motion, 0) @ np.r_[first, second], upper)
    assert np.allclose(arm.torques(motion, 1) @ second, lower)


def test_an_arm_keeps_its_energy_and_its_weight_has_a_potential(arm):
    own, rng = links(1), np.random.default_rng(2)
    q, v = rng.uniform(-2, 2, (2, 6))
    still, unit, step = np.zeros(6), np.eye(6), 1e-5

    def torque(q, v, a):
        return asked(arm, np.array([q, v, a])[:, :, None], own)[:, 0]

    def inertia(q):
        return np.array([torque(q, still, one) - torque(q, still, still) for one in unit])

    def weight(q):
        return torque(q, still, still)

    assert np.allclose(inertia(q), inertia(q).T)
    assert np.linalg.eigvalsh(inertia(q)).min() > 0
    slopes = np.array([(weight(q + step * e) - weight(q - step * e)) / (2 * step) for e in unit])
    assert np.allclose(slopes, slopes.T, atol=1e-6)
    assert np.abs(slopes).max() > 1
    # What speeds alone ask changes the kinetic energy by as much as the pose changes the inertia.
    turning = torque(q, v, still) - weight(q)
    changing = (inertia(q + step * v) - inertia(q - step * v)) / (2 * step)
    assert np.isclose(v @ turning, 0.5 * v @ changing @ v, rtol=1e-6)


def waves(joints, rate, rng):
    """Time, and angles, speeds and accelerations of 40 s of random motions, (joints, n)."""
    t, many = np.arange(int(40 * rate)) / rate, (joints, 5, 1)
    speed, phase = rng.uniform(0.2, 3.0, many), rng.uniform(0, 6, many)
    size, angle = rng.uniform(0.1, 0.4, many), speed * t + phase
    q = (size * np.sin(angle)).sum(1)
    v = (size * speed * np.cos(angle)).sum(1)
    return t, q, v, -(size * speed**2 * np.sin(angle)).sum(1)


def saved(folder, rate, columns):
    """Write a run."""
    record = json.dumps({"sampling_rate_hz": rate}).encode()
    table = pa.table(columns).replace_schema_metadata({b"opamc": record})
    pq.write_table(table, folder / "run.parquet")


def searched(folder):
    """Have the run's joints found by a copy of arm.py that holds none."""
    (folder / "arm.py").write_text(ARM.read_text())
    words = (sys.executable, str(folder / "arm.py"), str(folder / "run.parquet"))
    return subprocess.run(words, capture_output=True, text=True, check=False)


def recorded(arm, folder, lacks, axes=range(1, 7)):
    """40 s of random motions of all axes, the current of axis 4 with one thing more."""
    rate, rng, noise = 200.0, np.random.default_rng(3), 0.02
    t, q, v, a = waves(6, rate, rng)
    own, motion = links(4), np.array([q, v, a])
    current = asked(arm, motion, own)[3] / 5
    current += 0.3 * a[3] + 0.4 * np.sign(v[3]) + 0.1 * v[3] + noise * rng.normal(size=t.size)
    if lacks == "payload_change":
        # A kilogram, a tenth of a metre before the flange.
        held = np.array([1.0, 0.0, 0.1, 0.0, *(0.01, 0.0, 0.0, 0.0, 0.0, 0.01)])
        current += (t > 21) * (arm.torques(motion, 3)[:, -10:] @ held) / 5
    else:
        current += 0.2 / np.mean(v[3] ** 2) * v[3] * np.abs(v[3])
    columns = {f"axis{axis}_position": q[axis - 1] for axis in axes}
    saved(folder, rate, {"axis4_current": current, **columns})
    (folder / "arm.py").write_text(f"{ARM.read_text()}\n\nJOINTS = {UR10}\n")
    (folder / "model.yaml").write_text(
        "library: [arm.py]\neffects: [arm, inertia, offset, coulomb, viscous]\n"
        "without: [coupling]\n"
    )
    return noise


def close(folder):
    run, model, out = (str(folder / name) for name in ("run.parquet", "model.yaml", "out"))
    words = ("--model", model, "--axis", "4", "--out", out, "--jobs", "1")
    return ended("model", "close", run, *words)


def ended(*words):
    with pytest.raises(SystemExit) as stopped:
        main([*words])
    return int(stopped.value.code or 0)


@pytest.mark.long
@pytest.mark.parametrize("lacks", ["quadratic_friction", "payload_change"])
def test_beside_a_declared_arm_what_its_joint_lacks_is_named(arm, tmp_path, lacks):
    noise = recorded(arm, tmp_path, lacks)
    assert close(tmp_path) == 0
    (loop,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    assert [step["effect"] for step in loop["steps"]] == [lacks]
    assert loop["verdict"] == "closed"
    assert loop["after"]["rmse_a"] < 1.1 * noise
    if lacks != "payload_change":  # which other recordings need not carry
        applied = ("evaluate", str(tmp_path / "run.parquet"), "--axis", "4", "--quiet")
        closed = ("--model", str(tmp_path / "out" / "model.yaml"), "--out", str(tmp_path / "on"))
        assert ended("model", *applied, *closed) == 0
        (one,) = json.loads((tmp_path / "on" / "evaluation.json").read_text())["axes"]
        assert one["rmse_a"] < 1.1 * noise


def test_an_arm_that_nobody_has_written_is_asked_for(arm, tmp_path, capsys):
    recorded(arm, tmp_path, "")
    (tmp_path / "arm.py").write_text(ARM.read_text())
    assert close(tmp_path) == 2
    assert "knows no joints yet" in capsys.readouterr().err


def test_an_arm_asks_for_all_of_its_axes(arm, tmp_path, capsys):
    recorded(arm, tmp_path, "", axes=range(1, 6))
    assert close(tmp_path) == 2
    assert "those of axes 1, 2, 3, 5: log all" in capsys.readouterr().err


def test_an_arm_is_found_from_all_currents(arm, tmp_path):
    # An elbow beyond a shoulder's offset, and a wrist that turns the other way about the forearm.
    arm.JOINTS = tuple(
        (way, (0.0, 0.0, 0.0), axis)
        for way, axis in (
            ((0.0, 0.0, 0.3), (0, 0, 1)),
            ((0.15, 0.0, 0.2), (0, 1, 0)),
            ((0.0, 0.0, 0.6), (0, 1, 0)),
            ((0.35, 0.0, 0.1), (-1, 0, 0)),
        )
    )
    rate, rng = 100.0, np.random.default_rng(5)
    _, q, v, a = waves(4, rate, rng)
    motion, own = np.array([q, v, a]), links(6)
    asked_of = [arm.torques(motion, k) @ own[k:4].ravel() for k in range(4)]
    current = np.array(asked_of) + 0.5 * a + np.sign(v) + 0.5 * v
    current[1] += 3 * np.sin(20 * q[1])  # A fault in one of them.
    current += 0.02 * rng.normal(size=current.shape)
    motion[0, 2] += 0.06  # An encoder whose zero is off.
    columns = {f"axis{k + 1}_position": motion[0, k] for k in range(4)}
    saved(tmp_path, rate, columns | {f"axis{k + 1}_current": current[k] for k in range(4)})
    told = searched(tmp_path)
    assert told.returncode == 0
    assert "axis 1 " in told.stdout
    found = loaded(tmp_path / "arm.py")
    for joint, torque in enumerate(asked_of):
        columns = found.torques(motion, joint)
        columns = np.hstack([columns, a[joint][:, None]])  # Its rotor is beside.
        left = torque - columns @ np.linalg.lstsq(columns, torque, rcond=1e-10)[0]
        assert np.std(left) < 0.02 * np.std(torque)


def test_an_arm_is_not_found_without_its_currents(arm, tmp_path):
    recorded(arm, tmp_path, "quadratic_friction")
    told = searched(tmp_path)
    assert told.returncode != 0
    assert "currents of all axes" in told.stderr
    assert "Traceback" not in told.stderr
    assert (tmp_path / "arm.py").read_text() == ARM.read_text()


@pytest.mark.parametrize(
    ("first", "axes", "samples", "moving", "said"),
    [
        (1, 3, 2000, True, "does not tell where the joints are"),
        (2, 3, 2000, True, "holds axes 2, 3, 4; an arm of axes 1 to n, of 7 at most"),
        (1, 8, 2000, True, "holds axes 1, 2, 3, 4, 5, 6, 7, 8; an arm of axes 1 to n, of 7"),
        (1, 3, 12, True, "12 samples are known on all axes: too few"),
        (1, 3, 2000, False, "0 samples of motion, 500 are needed"),
    ],
)
def test_an_arm_is_not_found_where_a_run_does_not_tell(
    tmp_path, first, axes, samples, moving, said
):
    rng = np.random.default_rng(8)
    t = np.arange(samples) / 100.0
    names = range(first, first + axes)
    columns = {f"axis{k}_position": moving * np.sin(0.4 * (k + 1) * t) for k in names}
    columns |= {f"axis{k}_current": rng.normal(size=t.size) for k in names}
    saved(tmp_path, 100.0, columns)
    told = searched(tmp_path)
    assert told.returncode == 1
    assert said in told.stderr
    assert "Traceback" not in told.stderr
    assert (tmp_path / "arm.py").read_text() == ARM.read_text()
