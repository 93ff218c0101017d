"""`opamc model` on run files, and what it says where it cannot."""

import json
from dataclasses import replace
from importlib import resources
from pathlib import Path

import jsonschema
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from closing import moved
from scipy.signal import lfilter
from simulator import simulate
from threadpoolctl import threadpool_limits

from opamc_cli.__main__ import main
from opamc_cli.commands.model.model import _unjudged
from opamc_cli.errors import ExitCode
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.motion import kinematics
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.recordings import grouped_track
from opamc_cli.joint.motion.track import Joint
from opamc_cli.signal.motion.signs import friction_drives
from opamc_cli.stages.model import model as stage
from opamc_cli.stages.model.axis_model import too_little_motion

MODEL = (
    "joint: {gear_ratio: null, pole_pairs: null}\neffects: [inertia, gravity, coulomb, viscous]\n"
)


def write_run(path, rate, **columns):
    table = pa.table({name: pa.array(values) for name, values in columns.items()})
    record = json.dumps({"sampling_rate_hz": rate}).encode()
    pq.write_table(table.replace_schema_metadata({b"opamc": record}), path)
    return path


def opamc(*arguments):
    with pytest.raises(SystemExit) as stopped:
        main([str(argument) for argument in arguments])
    return int(stopped.value.code or 0)


@pytest.fixture
def folder(tmp_path):
    made = simulate(3, ("stribeck",), 0.8, rate=250.0, cycles=6)
    write_run(
        tmp_path / "run.parquet",
        250.0,
        axis1_current=made.current.astype("f4"),
        axis1_position=made.position,
        axis2_current=np.random.default_rng(0).normal(size=made.current.size).astype("f4"),
        axis2_position=np.zeros(made.current.size),
    )
    (tmp_path / "model.yaml").write_text(MODEL)
    return tmp_path


def close(folder, *more, model=None):
    if model is not None:
        (folder / "model.yaml").write_text(model)
    return opamc(
        "model", "close", folder / "run.parquet", "--model", folder / "model.yaml",
        "--out", folder / "out", *more,
    )  # fmt: skip


def test_a_fit_that_fails_on_the_sealed_data_is_said_also_if_quiet(tmp_path, capsys):
    made = simulate(3, (), rate=250.0, cycles=5)
    recording = Recording("run", 250.0, made.current, position_rad=made.position)
    _, grouping = grouped_track([recording], Joint())
    held = np.isin(grouping.group, grouping.sealed)  # What is sealed alone has the payload.
    changed = made.current + 8 * made.noise_rms * held * np.sin(made.position + 0.5)
    write_run(tmp_path / "run.parquet", 250.0, axis1_current=changed, axis1_position=made.position)
    assert close(tmp_path, "--quiet", model=MODEL) == 5
    said = capsys.readouterr()
    assert said.out == ""
    assert "times that of the rest: the fit fails there" in said.err
    (entry,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    assert entry["fails"] in said.err


def test_what_the_sealed_data_do_not_show_is_said_also_if_quiet(tmp_path, capsys, monkeypatch):
    made = simulate(3, (), rate=250.0, cycles=5)
    write_run(
        tmp_path / "run.parquet", 250.0, axis1_current=made.current, axis1_position=made.position
    )
    assert close(tmp_path, "--quiet", model=MODEL) == 0
    assert capsys.readouterr().err == ""
    true = stage.close_loop
    monkeypatch.setattr(
        stage, "close_loop", lambda *a, **k: replace(true(*a, **k), unconfirmed=("spring",))
    )
    assert close(tmp_path, "--quiet", model=MODEL) == 5
    assert "searched show spring" in capsys.readouterr().err
    (entry,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    assert (entry["verdict"], entry["unconfirmed"]) == ("nothing-missing", ["spring"])


@pytest.mark.parametrize("slow_a", [0.01, 0.1])
def test_what_nothing_explains_far_beyond_the_noise_is_said_also_if_quiet(slow_a, tmp_path, capsys):
    position, speed, acceleration = moved("one stroke", rate=100.0)
    current = 0.2 * acceleration + np.sin(position) + 0.5 * np.sign(speed) + 0.3 * speed
    white, slow = np.random.default_rng(3).normal(0.0, (0.02, 1.0), (speed.size, 2)).T
    slow = lfilter([1.0], [1.0, -0.95], slow)
    current += white + slow_a / np.std(slow) * slow
    write_run(tmp_path / "run.parquet", 100.0, axis1_current=current, axis1_position=position)
    code = close(tmp_path, "--quiet", model=MODEL)
    (entry,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    assert entry["verdict"] == "nothing-missing"
    said = "that are left beyond noise" in capsys.readouterr().err
    assert said == (entry["before"]["rmse_a"] > 3 * entry["noise_a"]) == (slow_a > 0.05)
    assert code == (5 if said else 0)


@pytest.mark.parametrize("hidden", ["ripple", "quadratic_friction"])
def test_names_of_a_place_that_is_a_guess_are_doubted(hidden, tmp_path, capsys, monkeypatch):
    made = simulate(3, (hidden,), 15.0, rate=1000.0, cycles=3)
    phases = {f"axis1_{name}": made.phases[:, k] for k, name in enumerate("abc")}
    write_run(tmp_path / "run.parquet", 2000.0, **phases)
    true = kinematics.without_slips
    monkeypatch.setattr(
        kinematics, "without_slips", lambda *a: replace(true(*a), guessed_s=(0.25, 0.5))
    )
    assert close(tmp_path, "--quiet", model=MODEL) == 0
    said = capsys.readouterr().err
    (entry,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    assert hidden in {step["effect"] for step in entry["steps"]}
    doubted = hidden == "ripple"
    assert ("ripple may be wrong: the place" in said) == doubted
    assert len(entry["doubts"]) == doubted
    assert any("turned without current (gaps: 2, 0.8 s in all)" in n for n in entry["notes"])


@pytest.mark.parametrize(
    ("off", "known_poles"),  # 0.8 of it with five pole pairs is the same as all of it with four
    [*((off, True) for off in (1.0, 1.005, 1.01, 0.8)), *((off, False) for off in (1.0, 1.01))],
)
def test_a_declared_ratio_that_phases_beside_a_position_deny_is_doubted(
    off, known_poles, tmp_path, capsys
):
    """One that was a per cent off moved lines and pole pairs without a word."""
    made = simulate(3, (), rate=1000.0, cycles=3)
    phases = {f"axis1_{name}": made.phases[:, k] for k, name in enumerate("abc")}
    write_run(tmp_path / "run.parquet", 1000.0, axis1_position=made.position, **phases)
    poles = made.pole_pairs if known_poles else "null"
    joint = f"joint: {{gear_ratio: {off * made.gear_ratio}, pole_pairs: {poles}}}"
    close(tmp_path, "--quiet", model=joint + "\n" + MODEL.split("\n")[1])
    assert ("the phases turn by" in capsys.readouterr().err) == (off != 1)
    (entry,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    assert len(entry["doubts"]) == (off != 1)
    assert entry["after"]["rmse_a"] < 1.2 * made.noise_rms


@pytest.mark.parametrize("viscous", [0.3, -0.3])
def test_a_declared_viscous_friction_that_drives_is_doubted(viscous, tmp_path, capsys):
    position, speed, acceleration = moved("one stroke", rate=100.0)
    current = 0.2 * acceleration + np.sin(position) + 0.9 * np.sign(speed) + viscous * speed
    current += np.random.default_rng(7).normal(0.0, 0.02, speed.size)
    write_run(tmp_path / "run.parquet", 100.0, axis1_current=current, axis1_position=position)
    close(tmp_path, "--quiet", model=MODEL)
    said = "the declared viscous drives the joint" in capsys.readouterr().err
    assert said == (viscous < 0)


@pytest.mark.parametrize("built_up", [0.9, 0.1])
def test_dry_friction_that_builds_up_over_a_way_resists_beside_a_negative_rest(
    built_up, tmp_path, capsys
):
    """Of a joint with presliding the declared part alone is below zero, and was doubted."""
    position, speed, acceleration = moved("cyclic", rate=250.0)
    state, z = np.zeros(speed.size), 0.0
    for k, step in enumerate(np.diff(position, prepend=position[0])):
        state[k] = z = np.sign(step) + (z - np.sign(step)) * np.exp(-abs(step) / 0.05)
    current = 0.2 * acceleration + np.sin(position) - 0.3 * np.sign(speed) + 0.7 * speed
    current += built_up * state + np.random.default_rng(7).normal(0.0, 0.02, speed.size)
    write_run(tmp_path / "run.parquet", 250.0, axis1_current=current, axis1_position=position)
    close(tmp_path, "--quiet", model=MODEL)
    said = "the declared coulomb drives the joint" in capsys.readouterr().err
    assert said == (built_up < 0.3)


@pytest.mark.parametrize("declared", ["coulomb, stribeck", "coulomb, viscous, stribeck"])
def test_a_declared_friction_that_drives_is_doubted(declared, tmp_path, capsys):
    """A Stribeck curve below zero stood for a viscous friction, and nothing was said to lack."""
    position, speed, acceleration = moved("one stroke", rate=100.0)
    current = 0.2 * acceleration + np.sin(position) + 0.5 * np.sign(speed) + 0.3 * speed
    current += np.random.default_rng(7).normal(0.0, 0.02, speed.size)
    write_run(tmp_path / "run.parquet", 100.0, axis1_current=current, axis1_position=position)
    effects = f"effects: [inertia, gravity, offset, {declared}, load_friction]\n"
    assert close(tmp_path, "--quiet", model=MODEL.split("\n")[0] + "\n" + effects) == 0
    (entry,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    assert entry["verdict"] == "nothing-missing"
    lacks = "viscous" not in declared
    assert ("the declared stribeck drives the joint" in capsys.readouterr().err) == lacks
    assert len(entry["doubts"]) == lacks


def test_close_writes_the_loop_the_tables_and_the_extended_model(folder, capsys):
    assert close(folder, "--axis", "1") == 0
    shown = capsys.readouterr().out
    written = json.loads((folder / "out" / "loop.json").read_text())
    text = (
        resources.files("opamc_cli.storage.schemas").joinpath("loop.schema.json").read_text("utf-8")
    )
    jsonschema.Draft202012Validator.check_schema(json.loads(text))
    jsonschema.validate(written, json.loads(text))
    loop = written["axes"][0]
    assert loop["axis"] == 1
    assert loop["declared"] == ["inertia", "gravity", "coulomb", "viscous"]
    assert loop["verdict"] == "closed"
    assert loop["sealed"] == ["run:2", "run:4"]
    step = loop["steps"][0]
    assert step["effect"] == "stribeck"
    assert step["domain"] == "velocity"
    for key in ("parameters", "interpretation", "gain", "t_value", "p_value", "decoy_gain", "ties"):
        assert key in step
    assert step["fit_of_name"] > 0.9
    assert step["approximate"] is False
    curve = step["curve"]
    assert (curve["covariate"], curve["unit"]) == ("speed", "rad/s")
    assert len(curve["x"]) == len(curve["residual_a"]) == len(curve["named_a"]) > 20
    # The curve is the effect's: high at low speed, gone at high speed.
    assert curve["named_a"][0] > 10 * abs(curve["named_a"][-1])
    assert np.std(np.subtract(curve["residual_a"], curve["named_a"])) < 0.3 * np.std(
        curve["named_a"]
    )
    assert loop["ceiling"]["share"] > 2 * loop["ceiling"]["standard_error"] > 0
    floor = loop["before"]["rmse_a"] * (1 - loop["ceiling"]["share"]) ** 0.5
    # Names may leave less than functions do.
    assert loop["floor_a"] == pytest.approx(min(floor, loop["after"]["rmse_a"]))
    candidates = pq.read_table(folder / "out" / "candidates.parquet").to_pylist()
    assert {"round", "effect", "score", "gain", "t_value", "p_value", "added", "why_not"} <= set(
        candidates[0]
    )
    assert [row["effect"] for row in candidates if row["added"]] == ["stribeck"]
    assert loop["after"]["rmse_a"] < loop["before"]["rmse_a"]
    assert f"{loop['before']['rmse_a']:.4g} → {loop['after']['rmse_a']:.4g} A" in shown
    assert {"effect": "thermal_viscous", "why": "no temperature channel"} in loop["untestable"]
    for name in ("candidates", "fit", "residuals", "order_spectrum"):
        assert pq.read_table(folder / "out" / f"{name}.parquet").num_rows > 0

    extended = yaml.safe_load((folder / "out" / "model.yaml").read_text())
    assert extended["effects"][-1]["effect"] == "stribeck"
    check_a_closed_model_applied_to_other_runs(folder, extended, capsys)
    (folder / "model.yaml").write_text((folder / "out" / "model.yaml").read_text())
    assert close(folder, "--axis", "1") == 0
    again = json.loads((folder / "out" / "loop.json").read_text())["axes"][0]
    assert again["verdict"] == "nothing-missing"
    assert again["before"]["rmse_a"] == pytest.approx(loop["after"]["rmse_a"], rel=0.01)


def check_a_closed_model_applied_to_other_runs(folder, extended, capsys):
    """Coefficients are those of the closed model; another load is an error, not another fit."""
    assert all(len(entry["coefficients"]) >= 1 for entry in extended["effects"])
    model = folder / "out" / "model.yaml"
    errors = {}
    for name, seed, load in (("own", 3, 1.0), ("other", 3, 1.5)):
        made = simulate(seed, ("stribeck",), 0.8, rate=250.0, cycles=6)
        current = made.current.astype("f4") * np.float32(load)
        run = folder / f"{name}.parquet"
        write_run(run, 250.0, axis1_current=current, axis1_position=made.position)
        out = folder / f"evaluated-{name}"
        assert opamc("model", "evaluate", run, "--model", model, "--out", out) == 0
        (axis,) = json.loads((out / "evaluation.json").read_text())["axes"]
        errors[name] = axis["rmse_a"]
        assert axis["closed"]["rmse_a"] == pytest.approx(extended["closed"]["rmse"])
        assert axis["not_applied"] == []
    assert errors["own"] == pytest.approx(extended["closed"]["rmse"], rel=0.2)
    # half of the current has no explanation in frozen coefficients
    assert errors["other"] > 0.3 * np.std(made.current)
    assert f"error {errors['other']:.4g} A" in capsys.readouterr().out


@pytest.mark.long
def test_a_model_is_applied_without_what_its_functions_took_from_its_terms(tmp_path):
    """Beside friction by the angle dry friction was anything, and was applied alone as it was."""
    made = simulate(3, (), rate=250.0, cycles=6)
    uneven = np.sign(np.gradient(made.position)) * np.cos(2.3 * made.position)
    uneven *= 20 * made.noise_rms
    current = (made.current + uneven).astype("f4")
    run, declared = tmp_path / "run.parquet", tmp_path / "declared.yaml"
    write_run(run, 250.0, axis1_current=current, axis1_position=made.position)
    terms = "[inertia, gravity, coulomb, viscous, offset]"
    declared.write_text(f"effects: {terms}\nwithout: [position_drag, ripple, load_friction]\n")
    out = ("--out", tmp_path / "out")
    assert opamc("model", "close", run, "--model", declared, *out) == 0
    (loop,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    assert "unnamed_angle_and_direction" in [step["effect"] for step in loop["steps"]]
    opamc("model", "evaluate", run, "--model", tmp_path / "out" / "model.yaml", *out)
    (axis,) = json.loads((tmp_path / "out" / "evaluation.json").read_text())["axes"]
    assert "unnamed_angle_and_direction" in [one["effect"] for one in axis["not_applied"]]
    assert axis["rmse_a"] < 1.1 * loop["before"]["rmse_a"]


@pytest.mark.parametrize(
    ("effects", "said"),
    [
        ("effects: [inertia]", "has not been closed"),
        ("effects: [inertia]\nclosed: {rmse: 1}", "'inertia' has no coefficients"),
        (
            "effects: [{effect: inertia, coefficients: [1, 2]}]\nclosed: {rmse: 1}",
            "2 coefficients for 1 regressors",
        ),
        (
            "effects: [{effect: inertia, coefficients: [1]}]\nclosed: {unit: Nm}",
            "is in A, the model was closed in Nm",
        ),
    ],
)
def test_a_model_that_cannot_be_evaluated(folder, capsys, effects, said):
    (folder / "model.yaml").write_text(effects)
    run, model = folder / "run.parquet", folder / "model.yaml"
    code = opamc("model", "evaluate", run, "--model", model, "--axis", 1, "--out", folder / "o")
    assert code in (2, 3)
    assert said in capsys.readouterr().err


@pytest.mark.long
def test_a_torque_is_never_called_a_current(folder, capsys):
    table = pq.read_table(folder / "run.parquet")
    record = {"sampling_rate_hz": 250.0, "current_unit": "Nm"}
    table = table.replace_schema_metadata({b"opamc": json.dumps(record).encode()})
    pq.write_table(table, folder / "run.parquet")
    assert close(folder, "--axis", "1") == 0
    assert opamc("model", "fit", folder / "run.parquet", "--axis", 1, "--out", folder / "out") == 0
    shown = capsys.readouterr().out
    assert "Nm rms left" in shown
    assert "Nm per rad/s²" in shown
    assert " A" not in shown.replace(" Axis", "")
    (axis,) = json.loads((folder / "out" / "loop.json").read_text())["axes"]
    assert axis["unit"] == "Nm"


def test_runs_at_rates_of_one_clock_are_one_model_s(folder, capsys):
    made, later = folder / "run.parquet", folder / "later.parquet"
    table = pq.read_table(made)
    # a copy would be refused
    place = table.schema.get_field_index("axis1_current")
    own = pa.array(1.01 * table["axis1_current"].to_numpy())
    table = table.set_column(place, "axis1_current", own)
    for rate, code in ((250.02, 0), (250.5, 3)):
        record = {b"opamc": json.dumps({"sampling_rate_hz": rate}).encode()}
        pq.write_table(table.replace_schema_metadata(record), later)
        assert opamc("model", "fit", made, later, "--axis", 1, "--out", folder / "out") == code
    assert "different rates (250, 250.5 Hz)" in capsys.readouterr().err


def test_fit_and_trace_write_their_tables(folder):
    for command, table in (("fit", "fit"), ("trace", "candidates")):
        code = opamc(
            "model", command, folder / "run.parquet", "--model", folder / "model.yaml",
            "--axis", "1", "--out", folder / "out", "--json",
        )  # fmt: skip
        assert code == 0
        assert pq.read_table(folder / "out" / f"{table}.parquet").num_rows >= 2


@pytest.mark.parametrize(
    ("model", "axis", "code", "words"),
    [
        ("effects: [inertia, stribek]\n", 1, 2, "did you mean stribeck"),
        ("effects: [inertia, thermal_viscous]\n", 1, 2, "no temperature channel"),
        ("joint: {gear_ratio: -100}\n", 1, 2, "joint.gear_ratio is -100"),
        ("joint: {gear_ration: 100}\n", 1, 2, "did you mean 'gear_ratio'"),
        (MODEL, 2, 5, "axis 2 does not move"),
        (MODEL, 7, 3, "axis 7"),
    ],
)
def test_wrong_declarations_end_in_one_sentence(folder, capsys, model, axis, code, words):
    assert close(folder, "--axis", axis, model=model) == code
    error = capsys.readouterr().err.strip()
    assert words in error
    assert len(error.splitlines()) == 1
    if code == 2:
        assert "model.yaml:" in error


def with_gaps(folder, share):
    """The current without a number in so much of every second."""
    table = pq.read_table(folder / "run.parquet")
    current = table.column("axis1_current").to_numpy().copy()
    current[np.arange(current.size) % 250 < share * 250] = np.nan
    table = table.set_column(0, "axis1_current", pa.array(current, from_pandas=False))
    pq.write_table(table, folder / "run.parquet")
    return int(np.isnan(current).sum())


def test_gaps_are_said(folder, capsys):
    missing = with_gaps(folder, 0.02)
    assert close(folder, "--axis", "1", "--quiet") == ExitCode.PARTIAL
    said = f"{missing} of 10972 samples lack a number and are left out"
    assert capsys.readouterr().err.strip().endswith(said)
    (entry,) = json.loads((folder / "out" / "loop.json").read_text())["axes"]
    assert said in entry["in_part"][0]
    assert entry["in_part"][0] in entry["notes"]


def test_a_joint_that_not_all_runs_have_is_said(folder, capsys):
    """It was left out without a word."""
    table = pq.read_table(folder / "run.parquet")
    of_second = [name for name in table.column_names if name.startswith("axis2_")]
    pq.write_table(table.drop_columns(of_second), folder / "lacking.parquet")
    moved = table.slice(0, table.num_rows - 1000)
    pq.write_table(moved, folder / "run.parquet")
    runs = [folder / "run.parquet", folder / "lacking.parquet"]
    given = ("--out", folder / "out", "--quiet")
    assert opamc("model", "fit", *runs, *given) == ExitCode.PARTIAL
    error = capsys.readouterr().err
    assert "lacking.parquet: has no axis 2, which another run has" in error
    assert opamc("model", "fit", *runs, *given, "--axis", "1") == ExitCode.DONE
    assert not capsys.readouterr().err


def test_a_neighbour_whose_position_is_lost_is_said(folder, capsys):
    table = pq.read_table(folder / "run.parquet")
    lost = pa.array(np.full(table.num_rows, np.nan))
    pq.write_table(table.append_column("axis3_position", lost), folder / "run.parquet")
    given = ("--out", folder / "out", "--axis", "1", "--quiet")
    assert opamc("model", "fit", folder / "run.parquet", *given) == ExitCode.PARTIAL
    assert "what axis 3 asks of axis 1 is not looked for" in capsys.readouterr().err


@pytest.mark.long
def test_a_current_of_the_opposite_sign_is_said_and_closed_alike(folder, capsys):
    assert close(folder, "--axis", "1") == 0
    (straight,) = json.loads((folder / "out" / "loop.json").read_text())["axes"]
    assert straight["notes"] == []
    table = pq.read_table(folder / "run.parquet")
    negative = pa.array(-table.column("axis1_current").to_numpy())
    pq.write_table(table.set_column(0, "axis1_current", negative), folder / "run.parquet")
    capsys.readouterr()
    assert close(folder, "--axis", "1") == 0
    assert "its current has the opposite sign of its motion" in capsys.readouterr().err
    (opposed,) = json.loads((folder / "out" / "loop.json").read_text())["axes"]
    assert {**opposed, "notes": []} == straight
    closed = folder / "out" / "model.yaml"
    out = folder / "evaluated"
    run = folder / "run.parquet"
    evaluate = ("model", "evaluate", run, "--model", closed, "--axis", 1, "--out", out, "--quiet")
    assert opamc(*evaluate) == 0
    (entry,) = json.loads((out / "evaluation.json").read_text())["axes"]
    assert entry["r2"] > 0.9
    assert (entry["notes"], entry["opposite_sign"]) == ([], [])
    assert capsys.readouterr() == ("", "")
    # A model holds for the sign that it was closed on, whatever a run alone would say.
    pq.write_table(table, run)
    assert opamc(*evaluate) == 5
    (entry,) = json.loads((out / "evaluation.json").read_text())["axes"]
    assert entry["r2"] < 0
    assert entry["opposite_sign"] == ["run"]
    said = (
        "axis 1: the current of run has the opposite sign of the one that the model was closed on"
    )
    assert said in capsys.readouterr().err


def test_motion_where_a_model_was_not_closed_is_said_also_if_quiet(tmp_path, capsys):
    time = np.arange(0, 24, 0.01)
    draw = np.random.default_rng(7)

    def run_of(name, middle, travel):
        angle = middle + travel * np.sin(2 * time) + 0.3 * travel * np.sin(5 * time)
        speed, acceleration = np.gradient(angle, time), np.gradient(np.gradient(angle, time), time)
        current = 0.4 * acceleration + 2 * np.sin(angle) + 0.2 * np.sign(speed) + 0.3 * speed
        current += 0.02 * draw.normal(size=time.size)
        path = tmp_path / f"{name}.parquet"
        return write_run(path, 100.0, axis1_current=current, axis1_position=angle)

    # Over a tenth of a radian the sine of gravity and its cosine are next to one.
    run_of("run", 0.6, 0.1)
    assert close(tmp_path, "--axis", "1", model=MODEL) == 0
    capsys.readouterr()
    for name, middle, travel, code in (("same", 0.6, 0.1, 0), ("elsewhere", 1.6, 0.5, 5)):
        run = run_of(name, middle, travel)
        model, out = tmp_path / "out" / "model.yaml", tmp_path / name
        told = opamc("model", "evaluate", run, "--model", model, "--out", out, "--quiet")
        assert told == code
        (entry,) = json.loads((out / "evaluation.json").read_text())["axes"]
        assert (entry["familiar"]["share"] > 0.98) == (code == 0)
        assert (entry["familiar"]["share"] < 0.1) == (code == 5)
        assert (entry["familiar"]["rmse_a"] is None) == (entry["familiar"]["share"] == 0)
        said = capsys.readouterr().err
        assert ("of the motion lies where the model was not closed" in said) == (code == 5)
        assert entry["r2"] > 0.9 or code == 5
        assert entry["notes"] == []
    older = yaml.safe_load(model.read_text())
    del older["closed"]["regressors"]
    model.write_text(yaml.safe_dump(older))
    assert opamc("model", "evaluate", run, "--model", model, "--out", out) == 0
    (entry,) = json.loads((out / "evaluation.json").read_text())["axes"]
    assert entry["familiar"] is None
    assert "does not tell on what motion it was closed" in capsys.readouterr().err


def test_a_channel_that_is_mostly_gaps_is_refused_also_if_quiet(folder, capsys):
    with_gaps(folder, 0.6)
    assert close(folder, "--axis", "1", "--quiet") == 3
    assert "column axis1_current holds no number in 60% of its samples" in capsys.readouterr().err
    assert not (folder / "out" / "loop.json").exists()


def test_a_position_whose_values_are_held_is_not_said_to_rest(folder, capsys):
    """Its travel of a radian was told beside."""
    made = simulate(3, (), 0.0, rate=250.0, cycles=6)
    held = np.repeat(made.position[::25], 25)[: made.position.size]
    write_run(folder / "run.parquet", 250.0, axis1_current=made.current, axis1_position=held)
    assert close(folder, "--axis", "1") == 5
    said = capsys.readouterr().err
    assert "changes in 7% of the samples alone and stands still between" in said
    assert "does not move" not in said


def test_phases_without_current_for_seconds_are_said_to_tell_no_motion():
    """It was too little motion, and more of it was asked for."""
    made = simulate(3, (), 0.0, rate=250.0, cycles=6)
    one = Recording("run", 250.0, current_a=made.current, position_rad=made.position)
    track, _ = grouped_track([one], Joint())
    lost = replace(track, moving=np.zeros_like(track.moving), guessed_s=(0.1, 2.37))
    said = str(too_little_motion(lost, 1, "run", 50))
    assert "for 2.4 s at a time there is too little current to see it" in said
    assert "log the position" in said
    assert "record at least" not in said
    assert "record at least" in str(too_little_motion(replace(lost, guessed_s=()), 1, "run", 50))


@pytest.mark.parametrize("samples", [150, 75])
def test_too_little_motion_to_seal_anything_off(samples, folder, capsys):
    """Of 75 fewer count than are a motion, and that was called rest."""
    made = simulate(3, (), 0.0, rate=250.0, cycles=6)
    write_run(
        folder / "run.parquet",
        250.0,
        axis1_current=made.current[:samples],
        axis1_position=made.position[:samples],
    )
    assert close(folder, "--axis", "1") == 5
    said = capsys.readouterr().err
    assert "too few: record at least 240" in said
    assert "does not move" not in said


@pytest.mark.parametrize(
    ("place", "speed", "words"),
    [
        (1.0, 180 / np.pi, "axis1_velocity seems to be in deg/s"),
        (1.0, 30 / np.pi, "axis1_velocity seems to be in rpm"),
        (1.0, 0.5 / np.pi, "axis1_velocity seems to be in rev/s"),
        (180 / np.pi, 1.0, "axis1_position seems to be in deg"),
        (0.5 / np.pi, 1.0, "axis1_position seems to be in rev"),
        (
            1.0,
            -1.0,
            "-1 times the rate of change of axis1_position: one of them has the wrong sign",
        ),
    ],
)
def test_position_and_speed_in_different_units_are_refused(folder, capsys, place, speed, words):
    made = simulate(3, (), 0.0, rate=250.0, cycles=6)
    write_run(
        folder / "run.parquet",
        250.0,
        axis1_current=made.current,
        axis1_position=place * made.position,
        axis1_velocity=speed * made.velocity,
    )
    assert close(folder, "--axis", "1") == 3
    assert words in capsys.readouterr().err


@pytest.mark.long
def test_a_joint_that_may_ask_for_another_is_told_of_where_none_is_logged(tmp_path, capsys):
    made = simulate(3, (), rate=100.0, cycles=5)
    hump = np.exp(-(((made.position - np.median(made.position)) / 0.1) ** 2))
    current = made.current + 20 * made.noise_rms * np.sign(made.velocity) * hump
    still = np.zeros_like(current)
    columns = {"axis1_current": current, "axis1_position": made.position}
    for beside in ({}, {"axis2_position": made.position[::-1].copy(), "axis2_current": still}):
        write_run(tmp_path / "run.parquet", 100.0, **columns, **beside)
        close(tmp_path, "--axis", "1", model=MODEL)
        said = "and the library lacks, would look like position_drag"
        assert (said in capsys.readouterr().err) == (not beside)


def test_a_users_effect_is_used_by_name(folder):
    (folder / "mine.py").write_text(
        "import numpy as np\n"
        "from opamc_cli.joint.effects.base import Effect, stack\n"
        "class Knee(Effect):\n"
        "    name = 'knee'\n"
        "    domain = 'velocity'\n"
        "    meaning = 'mine'\n"
        "    def columns(self, track, parameters):\n"
        "        return stack(track.direction * np.exp(-np.abs(track.velocity)))\n"
    )
    model = "effects: [inertia, gravity, coulomb, viscous, knee]\nlibrary: [mine.py]\n"
    assert close(folder, "--axis", "1", model=model) == 0
    loop = json.loads((folder / "out" / "loop.json").read_text())["axes"][0]
    assert loop["declared"][-1] == "knee"


@pytest.mark.long
def test_a_joint_that_moves_beside_is_read_named_and_applied_elsewhere(tmp_path, capsys):
    t = np.arange(6000) / 250.0
    q = 0.8 * np.sin(1.3 * t) + 0.4 * np.sin(2.9 * t + 1)
    beside = 0.7 * np.sin(1.9 * t + 2) + 0.3 * np.sin(3.7 * t)
    current = 0.5 * np.sin(q) + 0.4 * np.sign(np.gradient(q)) + 0.8 * np.cos(q + beside)
    current += 0.2 * np.gradient(np.gradient(q)) * 250**2
    current += 0.02 * np.random.default_rng(1).normal(size=t.size)
    columns = {"axis1_current": current, "axis1_position": q, "axis3_current": current * 0.1}
    write_run(tmp_path / "run.parquet", 250.0, **columns, axis3_position=beside)
    assert close(tmp_path, "--axis", "1", model=MODEL) == 0
    (step,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"][0]["steps"]
    assert (step["effect"], step["parameters"]) == ("coupling", {"axis": 3.0})
    write_run(tmp_path / "still.parquet", 250.0, **columns, axis3_position=np.zeros(t.size))
    for run, lacking in (("run", []), ("still", ["coupling"])):
        assert opamc(
            "model", "evaluate", tmp_path / f"{run}.parquet", "--axis", 1,
            "--model", tmp_path / "out" / "model.yaml", "--out", tmp_path / run, "--quiet",
        ) == (5 if lacking else 0)  # fmt: skip
        assert ("axis 1: not applied coupling: no other joint" in capsys.readouterr().err) == (
            bool(lacking)
        )
        said = json.loads((tmp_path / run / "evaluation.json").read_text())["axes"][0]
        assert [one["effect"] for one in said["not_applied"]] == lacking
        assert (said["rmse_a"] < 0.05) == (not lacking)
    wrong = MODEL.replace("viscous]", "viscous, {effect: coupling, parameters: {axis: 7}}]")
    capsys.readouterr()
    assert close(tmp_path, "--axis", "1", model=wrong) == 2
    assert "asks for the position of axis 7" in capsys.readouterr().err


@pytest.mark.parametrize("everywhere", [True, False])
def test_names_that_the_sealed_data_do_not_miss_are_doubted(everywhere, tmp_path, capsys):
    """A name whose error the others made up for stood beside them without a word."""
    made = simulate(3, ("quadratic_friction",), 5.0, rate=250.0, cycles=8)
    recording = Recording("run", 250.0, made.current, position_rad=made.position)
    _, grouping = grouped_track([recording], Joint())
    shown = everywhere | ~np.isin(grouping.group, grouping.sealed)
    current = made.current + 2 * made.noise_rms * shown * np.sin(41 * made.position)
    write_run(tmp_path / "run.parquet", 250.0, axis1_current=current, axis1_position=made.position)
    assert close(tmp_path, "--quiet", model=MODEL) == 0
    (entry,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    assert {"quadratic_friction", "ripple"} <= {step["effect"] for step in entry["steps"]}
    said = capsys.readouterr().err
    assert ("the sealed data do not miss ripple of order 41: a guess" in said) == (not everywhere)
    assert ("quadratic_friction" in said) is False


@pytest.mark.parametrize("power", [1, 3])
def test_a_spring_that_nearly_cancels_gravity_is_doubted(power, tmp_path, capsys):
    """Over a short travel both made up what a stop at its end asks, and the spring had a name."""
    made = simulate(3, (), 5.0, rate=250.0, cycles=8)
    way = made.position / np.abs(made.position).max()
    current = made.current + 3 * np.std(made.current) * way**power
    write_run(tmp_path / "run.parquet", 250.0, axis1_current=current, axis1_position=0.3 * way)
    model = MODEL.replace("viscous]", "viscous, offset]")
    assert close(tmp_path, "--quiet", model=model) in (0, 5)
    said = capsys.readouterr().err
    assert ("gravity and spring nearly cancel, each 3 times" in said) == (power == 3)


def test_a_model_is_evaluated_on_the_joint_that_it_was_closed_on(tmp_path, capsys):
    """It was applied to every axis of a run, and one had r2 -61078 without a word."""
    made = [simulate(seed, (), rate=250.0, cycles=6) for seed in (3, 4)]
    columns = {}
    for n, one in zip((2, 5), made, strict=True):
        columns |= {f"axis{n}_current": one.current, f"axis{n}_position": one.position}
    size = min(values.size for values in columns.values())
    columns = {name: values[:size] for name, values in columns.items()}
    run = write_run(tmp_path / "run.parquet", 250.0, **columns)
    assert close(tmp_path, "--axis", "5", model=MODEL) == 0
    model = tmp_path / "out" / "model.yaml"
    evaluate = ("model", "evaluate", run, "--model", model, "--out", tmp_path / "e", "--quiet")
    capsys.readouterr()
    for more, axis, said in (
        ((), 5, ""),
        (("--axis", 2), 2, "axis 2: the model was closed on axis 5, and says little of another"),
    ):
        assert opamc(*evaluate, *more) == (5 if said else 0)
        (entry,) = json.loads((tmp_path / "e" / "evaluation.json").read_text())["axes"]
        assert (entry["axis"], entry["closed"]["axis"]) == (axis, 5)
        assert said in capsys.readouterr().err
    older = yaml.safe_load(model.read_text())
    del older["closed"]["axis"]
    model.write_text(yaml.safe_dump(older))
    opamc(*evaluate)
    entries = json.loads((tmp_path / "e" / "evaluation.json").read_text())["axes"]
    assert [entry["axis"] for entry in entries] == [2, 5]


@pytest.mark.parametrize(("error", "another"), [(0.19, False), (0.21, True)])
def test_a_joint_is_another_one_by_an_error_of_twice_the_models_own(error, another):
    """A measured arm's joint hardly moved where the model knew it: r2 was -201 of a small error."""
    result = {
        "opposite_sign": [],
        "not_applied": [],
        "axis": 4,
        "closed": {"axis": 4, "rmse_a": 0.1, "r2": 0.96},
        "familiar": {"share": 0.6, "rmse_a": error, "r2": -201.0},
    }
    assert any("is another one" in said for said in _unjudged(result)) == another


def test_a_model_that_predicts_no_better_than_the_mean_is_said_also_if_quiet(tmp_path, capsys):
    made = simulate(3, (), rate=250.0, cycles=6)
    run = tmp_path / "run.parquet"
    write_run(run, 250.0, axis1_current=made.current, axis1_position=made.position)
    assert close(tmp_path, "--axis", "1", model=MODEL) == 0
    capsys.readouterr()
    model, out = tmp_path / "out" / "model.yaml", tmp_path / "e"
    write_run(run, 250.0, axis1_current=0.3 * made.current, axis1_position=made.position)
    code = opamc("model", "evaluate", run, "--model", model, "--out", out, "--quiet")
    (entry,) = json.loads((out / "evaluation.json").read_text())["axes"]
    assert entry["familiar"]["r2"] < 0
    assert code == 5
    assert "predicts no better than the current's mean" in capsys.readouterr().err
    # what is not applied does not hide it
    closed = yaml.safe_load(model.read_text())
    hum = {"effect": "mains_hum", "parameters": {"frequency_hz": 50.0}, "coefficients": [0.1, 0.1]}
    closed["effects"].append(hum)
    model.write_text(yaml.safe_dump(closed))
    opamc("model", "evaluate", run, "--model", model, "--out", out, "--quiet")
    said = capsys.readouterr().err
    assert "not applied mains_hum" in said
    assert "unit is another one, or what is not applied was most of it" in said


@pytest.mark.long
@pytest.mark.parametrize("repeats", [True, False])
def test_which_joint_it_is_is_doubted_where_the_program_repeats_itself(repeats, tmp_path, capsys):
    """Of a stranger's six such programs three named a joint that asks nothing."""
    t = np.arange(6000) / 250.0
    q = 0.8 * np.sin(1.3 * t) + 0.4 * np.sin((2.6 if repeats else 2.9) * t + 1)
    beside = 0.7 * np.sin((1.3 if repeats else 1.9) * t + 2) + 0.3 * np.sin(3.9 * t)
    current = 0.5 * np.sin(q) + 0.4 * np.sign(np.gradient(q)) + 0.8 * np.cos(q + beside)
    current += 0.2 * np.gradient(np.gradient(q)) * 250**2
    current += 0.02 * np.random.default_rng(1).normal(size=t.size)
    columns = {"axis1_current": current, "axis1_position": q, "axis3_position": beside}
    write_run(tmp_path / "run.parquet", 250.0, **columns)
    assert close(tmp_path, "--axis", "1", "--quiet", model=MODEL) == 0
    said = "which of the other joints load it" in capsys.readouterr().err
    assert said == repeats
    # what is declared takes up as much, and is nobody's name
    declared = MODEL.replace("viscous]", "viscous, {effect: coupling, parameters: {axis: 3}}]")
    assert close(tmp_path, "--axis", "1", model=declared) == 0
    (entry,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    assert any("which of the other joints load it" in note for note in entry["notes"])
    assert entry["doubts"] == []


@pytest.mark.long
@pytest.mark.parametrize("dry", [0.15, 0.0])
def test_the_opposite_sign_of_a_heavy_joint_shows_beside_what_the_others_ask(tmp_path, capsys, dry):
    t = np.arange(6000) / 250.0
    q = 0.8 * np.sin(1.3 * t) + 0.4 * np.sin(2.9 * t + 1)
    beside = 0.7 * np.sin(1.9 * t + 2) + 0.3 * np.sin(3.7 * t)
    current = 0.5 * np.sin(q) + dry * np.sign(np.gradient(q)) + 4 * np.cos(q + beside)
    current += 0.2 * np.gradient(np.gradient(q)) * 250**2
    current += 0.02 * np.random.default_rng(1).normal(size=t.size)
    pairs = [(-current, q)]
    assert not friction_drives(pairs, 250.0)
    entries = []
    for sign in (1, -1):
        columns = {"axis1_current": sign * current, "axis1_position": q, "axis3_position": beside}
        write_run(tmp_path / "run.parquet", 250.0, **columns)
        assert close(tmp_path, "--axis", "1", model=MODEL) == 0
        assert ("the opposite sign of its motion" in capsys.readouterr().err) == (sign < 0)
        entries += json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    straight, opposed = entries
    (note,) = straight["notes"]
    assert "which of the other joints load it" in note
    assert {**opposed, "notes": [note]} == straight
    closed = yaml.safe_load((tmp_path / "out" / "model.yaml").read_text())["closed"]
    assert closed["opposite_sign"] is True


def test_of_a_negative_that_is_driven_as_well_the_sign_is_not_turned(tmp_path, monkeypatch, capsys):
    """One arm's friction resisted by 109 errors beside an inertia below 0, and drove by 44."""
    t = np.arange(3000) / 125.0
    q, beside = 0.8 * np.sin(1.3 * t) + 0.4 * np.sin(2.9 * t + 1), 0.7 * np.sin(1.9 * t + 2)
    current = 0.5 * np.sin(q) + 0.2 * np.sign(np.gradient(q)) + 4 * np.cos(q + beside)
    current += 0.02 * np.random.default_rng(1).normal(size=t.size)
    for sign, driven, said in ((1, (True, True), False), (-1, (True, False), True)):
        columns = {"axis1_position": q, "axis3_position": beside}
        write_run(tmp_path / "run.parquet", 125.0, axis1_current=sign * current, **columns)
        answers = iter(driven)
        monkeypatch.setattr(stage, "_drives", lambda fit, answers=answers: next(answers))
        assert close(tmp_path, "--axis", "1", model=MODEL) == 0
        assert ("the opposite sign of its motion" in capsys.readouterr().err) == said
        closed = yaml.safe_load((tmp_path / "out" / "model.yaml").read_text())["closed"]
        assert bool(closed.get("opposite_sign")) == said


def closed_beside(tmp_path, capsys, inertia, viscous=0.0, coulomb=0.0):
    """Close a joint beside another that loads it; what is said of it."""
    t = np.arange(3000) / 125.0
    q, beside = 0.8 * np.sin(1.3 * t) + 0.4 * np.sin(2.9 * t + 1), 0.7 * np.sin(1.9 * t + 2)
    speed = np.gradient(q) * 125
    current = 0.5 * np.sin(q) + coulomb * np.sign(speed) + 4 * np.cos(q + beside)
    current += viscous * speed + inertia * np.gradient(speed) * 125
    current += 0.02 * np.random.default_rng(1).normal(size=t.size)
    columns = {"axis1_current": current, "axis1_position": q, "axis3_position": beside}
    write_run(tmp_path / "run.parquet", 125.0, **columns)
    assert close(tmp_path, "--axis", "1", model=MODEL) == 0
    return capsys.readouterr().err


@pytest.mark.long
def test_of_a_joint_whose_dry_friction_resists_the_sign_is_not_turned(tmp_path, capsys):
    """A measured arm's fourth joint moved in step with what the others asked of it."""
    said = closed_beside(tmp_path, capsys, inertia=-0.2, viscous=-0.4, coulomb=0.2)
    assert "the opposite sign of its motion" not in said
    assert "the declared viscous drives the joint instead of resisting" in said


@pytest.mark.long
def test_by_an_inertia_just_below_0_the_sign_is_not_turned(tmp_path, capsys):
    """A measured arm's sixth joint had one, and friction that told nothing."""
    said = closed_beside(tmp_path, capsys, inertia=-0.002)
    assert "friction would drive the joint" not in said
    assert "axis 1: the declared inertia is below 0" in said


@pytest.mark.long
def test_workers_do_not_change_the_bytes(folder, capsys):
    made = {
        axis: simulate(2 + axis, (effect,), 0.8, rate=100.0, cycles=4)
        for axis, effect in ((1, "stribeck"), (3, "offset"))
    }
    n = min(one.current.size for one in made.values())
    noise = np.random.default_rng(0).normal(size=n).astype("f4")
    columns = {"axis2_current": noise, "axis2_position": np.zeros(n)}
    for axis, one in made.items():
        columns[f"axis{axis}_current"] = one.current[:n].astype("f4")
        columns[f"axis{axis}_position"] = one.position[:n]
    write_run(folder / "run.parquet", 100.0, **columns)
    written = []
    for jobs in ("1", "2"):
        with threadpool_limits(2):  # of this process: those that it starts have one thread
            assert close(folder, "--jobs", jobs) == 4  # axis 2 does not move
        assert "axis 2 does not move" in capsys.readouterr().err
        files = sorted(path for path in (folder / "out").iterdir() if path.is_file())
        written.append({path.name: path.read_bytes() for path in files})
    assert {"model_axis1.yaml", "model_axis3.yaml"} < written[0].keys()
    assert written[0] == written[1]


def test_a_mistake_in_a_users_effect_is_told_with_file_and_line(folder, capsys):
    (folder / "mine.py").write_text(
        "from opamc_cli.joint.effects.base import Effect\n"
        "class Knee(Effect):\n"
        "    name = 'knee'\n"
        "    domain = 'velocity'\n"
        "    def columns(self, track, parameters):\n"
        "        return track.velocty\n"
    )
    (folder / "model.yaml").write_text("effects: [coulomb, knee]\nlibrary: [mine.py]\n")
    run, model = folder / "run.parquet", folder / "model.yaml"
    assert opamc("model", "fit", run, "--model", model, "--axis", 1, "--out", folder / "o") == 2
    told = capsys.readouterr().err
    assert f"{folder / 'mine.py'}:6: this effect cannot be used (AttributeError" in told
    assert "a bug" not in told


@pytest.mark.parametrize(
    ("method", "answer", "said"),
    [
        ("columns(self, track, parameters)", "track.velocity", "shape (1"),
        ("columns(self, track, parameters)", "[1.0]", "returns list; ("),
        ("columns(self, track, parameters)", "stack(track.velocity / 0)", "not finite"),
        ("columns(self, track, parameters)", "stack(track.velocity[:9])", "shape (9, 1)"),
        ("guesses(self, track, residual)", "{}", "a list of mappings"),
        ("limits(self, track)", "{'x': 3}", "(lowest, highest)"),
        ("untestable(self, track)", "7", "a text or None"),
    ],
)
def test_what_a_users_effect_returns_is_checked(folder, capsys, method, answer, said):
    (folder / "mine.py").write_text(
        "from opamc_cli.joint.effects.base import Effect, stack\n"
        "class Knee(Effect):\n"
        "    name = 'knee'\n"
        "    domain = 'velocity'\n"
        "    def columns(self, track, parameters):\n"
        "        return stack(track.velocity)\n"
        f"    def {method}:\n"
        f"        return {answer}\n"
    )
    (folder / "model.yaml").write_text("effects: [coulomb, knee]\nlibrary: [mine.py]\n")
    run, model = folder / "run.parquet", folder / "model.yaml"
    with np.errstate(all="ignore"):
        code = opamc("model", "fit", run, "--model", model, "--axis", 1, "--out", folder / "o")
    assert code == 2
    told = capsys.readouterr().err
    assert f"{folder / 'mine.py'}:7: " in told
    assert said in told


def test_an_unknown_effect_is_told_with_its_line(folder, capsys):
    (folder / "model.yaml").write_text("effects:\n- inertia\n- grvity\n")
    run, model = folder / "run.parquet", folder / "model.yaml"
    assert opamc("model", "fit", run, "--model", model, "--axis", 1, "--out", folder / "o") == 2
    assert f"{model}:3: Unknown effect 'grvity'" in capsys.readouterr().err


def test_effects_are_listed_and_shown(capsys):
    assert opamc("model", "effects", "--json") == 0
    listed = {effect["name"]: effect for effect in json.loads(capsys.readouterr().out)["effects"]}
    assert listed.keys() == {*built_in_library(), "arm"}
    assert all(effect["domain"] and effect["text"] for effect in listed.values())
    assert opamc("model", "effects", "stribeck") == 0
    shown = capsys.readouterr().out
    assert "exp(-(v / v_s)^2)" in shown
    assert "mixed lubrication" in shown
    assert opamc("model", "effects", "stribec") == 2
    assert "did you mean stribeck" in capsys.readouterr().err


@pytest.mark.long
def test_phase_currents_have_no_opposite_sign(tmp_path, monkeypatch, capsys):
    made = simulate(6, (), 1.0, rate=500.0, cycles=2)
    phases = {f"axis1_{p}": made.phases[:, k] for k, p in enumerate("abc")}
    beside = np.sin(0.01 * np.arange(len(made.position)))
    columns = {**phases, "axis1_position": made.position, "axis2_position": beside}
    write_run(tmp_path / "run.parquet", 500.0, **columns)
    monkeypatch.setattr("opamc_cli.stages.model.model.drag_t", lambda _: -99.0)
    assert close(tmp_path, "--axis", "1", "--jobs", "1", model=MODEL) == 0
    assert "opposite sign" not in capsys.readouterr().err


DATA = Path(__file__).parents[3] / "shared" / "data" / "kinova_gen3"


@pytest.mark.long
@pytest.mark.measured
@pytest.mark.skipif(not DATA.is_dir(), reason="measured recordings are not at ../shared/data")
def test_a_measured_arm_s_ripple_is_found_without_its_gear_ratio(tmp_path):
    joint, after = 6, 0.032  # joint 5 is README's
    path = DATA / f"joint_{joint}_trapez.csv"
    with path.open() as file:
        names = file.readline().strip().split(",")
    values = np.genfromtxt(path, delimiter=",", skip_header=1)

    def column(name):
        return values[:, names.index(f"{name}{joint}")]

    write_run(
        tmp_path / "run.parquet",
        1000.0,
        axis1_current=column("Cur"),
        axis1_position=np.unwrap(column("Position")),
        axis1_velocity=column("Velocity"),
        axis1_temperature=column("Temp"),
    )
    model = "effects: [inertia, gravity, offset, coulomb, viscous]\n"
    assert close(tmp_path, model=model) == 0
    loop = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"][0]
    assert loop["after"]["rmse_a"] <= after < loop["before"]["rmse_a"]
    assert "ripple" in {step["effect"] for step in loop["steps"]}


@pytest.mark.parametrize("every", [1, 40])
def test_names_of_a_cycle_of_few_samples_are_doubted(every, tmp_path, capsys):
    """Five names for 17 samples of a screw's step held on sealed steps, copies of the others."""
    made = simulate(3, ("quadratic_friction",), 15.0, rate=250.0, cycles=12)
    rows = slice(0, made.current.size // every * every)
    kept = {
        name: values[rows].reshape(-1, every).mean(1)
        for name, values in (("current", made.current), ("position", made.position))
    }
    columns = {f"axis1_{name}": values for name, values in kept.items()}
    write_run(tmp_path / "run.parquet", 250.0 / every, **columns)
    assert close(tmp_path, "--quiet", model=MODEL) in (0, 5)
    (entry,) = json.loads((tmp_path / "out" / "loop.json").read_text())["axes"]
    assert "quadratic_friction" in {step["effect"] for step in entry["steps"]}
    said = capsys.readouterr().err
    assert ("are copies, which refute no name (quadratic_friction" in said) == (every == 40)


@pytest.mark.parametrize("begins", ["second", "nowhere"])
def test_a_payload_since_a_recording_is_told_as_what_differs_there(begins, tmp_path, capsys):
    """Two controllers of a screw: payload_change, since_s 5.33, where the second file begins."""
    made = simulate(3, (), rate=250.0, cycles=8)
    cut = made.current.size // 2
    made.current[cut:] += np.std(made.current) * np.sin(made.position[cut:])
    halves = (("first", slice(0, cut)), ("second", slice(cut, None)))
    for name, rows in halves if begins == "second" else (("both", slice(None)),):
        columns = {"axis1_current": made.current[rows], "axis1_position": made.position[rows]}
        write_run(tmp_path / f"{name}.parquet", 250.0, **columns)
    (tmp_path / "model.yaml").write_text(MODEL)
    runs = sorted(tmp_path.glob("*.parquet"))
    out = tmp_path / "out"
    assert opamc("model", "close", *runs, "--model", tmp_path / "model.yaml", "--out", out) == 0
    (entry,) = json.loads((out / "loop.json").read_text())["axes"]
    assert "payload_change" in {step["effect"] for step in entry["steps"]}
    said = "axis 1: payload_change is what differs from recording "
    assert (said in capsys.readouterr().err) == (begins == "second")
