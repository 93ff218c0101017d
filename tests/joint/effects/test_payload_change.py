"""Payloads that the runs' metadata tell, from the run files to the model applied elsewhere."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from closing import MODEL, moved

from opamc_cli.__main__ import main

DECLARED = "effects: [inertia, gravity, offset, coulomb, viscous]\n"
NOISE_A, RATE = 0.02, 250.0


def write_run(path, carried_kg, told_kg, seed):
    """Write a run of a joint that carries something at half a metre, as A and A s² per kg."""
    q, v, a = moved("steps of torque", RATE, 20.0, 50 + seed)
    load = (1.0 + 0.3 * carried_kg) * np.cos(q) + (0.2 + 0.04 * carried_kg) * a
    current = load + MODEL["coulomb"] * np.sign(v) + MODEL["viscous"] * v
    noise = np.random.default_rng(seed).normal(0, NOISE_A, q.size)
    table = pa.table({"axis1_current": current + noise, "axis1_position": q})
    record = {"sampling_rate_hz": RATE} | ({} if told_kg is None else {"payload_kg": told_kg})
    pq.write_table(table.replace_schema_metadata({"opamc": json.dumps(record)}), path)
    return path


def opamc(*arguments):
    with pytest.raises(SystemExit) as stopped:
        main([str(argument) for argument in arguments])
    return int(stopped.value.code or 0)


def closed_on(folder, told, payloads=(0.0, 2.5, 1.0, 3.0, 0.5, 2.0)):
    """Close the loop on runs with payloads, by default neither a step in time nor in order."""
    runs = [
        write_run(folder / f"run{k}.parquet", kg, kg if told else None, k)
        for k, kg in enumerate(payloads)
    ]
    (folder / "model.yaml").write_text(DECLARED)
    model = ("--model", folder / "model.yaml")
    opamc("model", "close", *runs, *model, "--out", folder / "out", "--jobs", 1, "--quiet")
    return json.loads((folder / "out" / "loop.json").read_text())["axes"][0]


def test_payloads_that_the_runs_tell_have_a_name_and_hold_elsewhere(tmp_path, capsys):
    """It was "a function of time and load, which no effect of the library describes"."""
    axis = closed_on(tmp_path, told=True)
    assert [step["effect"] for step in axis["steps"]] == ["payload_change"]
    assert axis["verdict"] == "closed"
    assert axis["after"]["rmse_a"] < 1.2 * NOISE_A
    assert not any("payload_change" in note for note in axis["notes"])
    # a payload that no run of the closing had
    other = write_run(tmp_path / "other.parquet", 1.6, 1.6, 9)
    applied = ("--model", tmp_path / "out" / "model.yaml", "--out", tmp_path / "applied")
    assert opamc("model", "evaluate", other, *applied) == 0
    found = json.loads((tmp_path / "applied" / "evaluation.json").read_text())["axes"][0]
    assert found["rmse_a"] < 1.2 * NOISE_A
    # one that does not say what it carries
    capsys.readouterr()
    opamc("model", "evaluate", write_run(tmp_path / "u.parquet", 1.6, None, 9), *applied)
    assert "payload_kg" in "".join(capsys.readouterr())


def test_payloads_that_nobody_tells_are_asked_for(tmp_path):
    axis = closed_on(tmp_path, told=False)
    assert not axis["steps"]
    assert any("payload_kg" in note for note in axis["notes"])


def test_a_step_to_another_told_payload_is_told_by_the_kg(tmp_path):
    axis = closed_on(tmp_path, told=True, payloads=(0.0, 0.0, 0.0, 2.0, 2.0, 2.0))
    (step,) = axis["steps"]
    assert step["parameters"] == {"per_kg": 1.0}


@pytest.mark.parametrize("told_kg", [(None, None), (1.0, None), (1.0, 1.0)])
def test_a_declared_payload_that_the_runs_do_not_tell_is_refused(tmp_path, capsys, told_kg):
    """It was fitted with regressors of nothing, without a word."""
    runs = [write_run(tmp_path / f"run{k}.parquet", 1.0, kg, k) for k, kg in enumerate(told_kg)]
    declared = "{effect: payload_change, parameters: {per_kg: 1}}"
    (tmp_path / "model.yaml").write_text(DECLARED.replace("]", f", {declared}]"))
    model = ("--model", tmp_path / "model.yaml", "--out", tmp_path / "out")
    assert opamc("model", "fit", *runs, *model) == 2
    assert "do not all tell a payload_kg" in capsys.readouterr().err
