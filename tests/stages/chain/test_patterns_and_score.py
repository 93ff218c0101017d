"""Stages score and verdict on pattern tables with known answers."""

import json
import math

import numpy as np
import pyarrow as pa
import pytest

from opamc_cli.config import load_config
from opamc_cli.decision.divergence.jensen_shannon import jensen_shannon
from opamc_cli.errors import ExitCode, InputError
from opamc_cli.stages.chain import score
from opamc_cli.stages.chain.compared import discriminants
from opamc_cli.stages.chain.compared.pattern_rows import group_patterns
from opamc_cli.stages.chain.compared.side import Sides, read_side
from opamc_cli.stages.verdict import verdict
from opamc_cli.stages.verdict.decision import decide
from opamc_cli.stages.verdict.findings import Findings
from opamc_cli.storage.sources import read_sources, sources_record
from opamc_cli.storage.tables import read_table, write_table
from tests.decision.fleet import Fleet
from tests.decision.tables import write_patterns

CONFIG = load_config()


def diagnose(folder, plan, seed=0, config=CONFIG, causes=None, **info):
    baseline, target = write_patterns(folder, plan, seed, **info)
    sides = Sides(read_side(baseline), read_side(target))
    scored = score.compare_sides(sides, config, folder)
    found = Findings(causes or {})
    return verdict.write(decide(sides, config), scored, config, folder, found)


def strings(value):
    if isinstance(value, dict):
        return [s for each in value.values() for s in strings(each)]
    if isinstance(value, list):
        return [s for each in value for s in strings(each)]
    return [value] if isinstance(value, str) else []


def test_baseline_leaves_its_session_out_and_target_meets_the_whole_pool(tmp_path):
    baseline, target = write_patterns(tmp_path, Fleet(n_axes=1, n_motions=1, n_baseline=3), 0)
    outcome = score.run(baseline, target, CONFIG, tmp_path)
    rows = outcome.scores.to_pylist()
    counts = {
        (role, row["run"], row["cycle"]): np.array(row["counts"])
        for role, path in (("baseline", baseline), ("target", target))
        for row in read_table(path, "patterns").to_pylist()
    }
    for row in rows:
        others = [
            value
            for (role, run, _), value in counts.items()
            if role == "baseline" and (row["role"] == "target" or run != row["run"])
        ]
        expected = jensen_shannon(counts[row["role"], row["run"], row["cycle"]], sum(others))
        assert row["jsd"] == pytest.approx(expected)
        assert row["n_pool"] == sum(int(o.sum()) for o in others)
        assert row["excess"] == pytest.approx(row["jsd"] - row["chance"])
    assert {row["left_out"] for row in rows} == {"session", "none"}
    assert len(rows) == 16


def test_a_single_session_leaves_its_own_cycle_out(tmp_path):
    plan = Fleet(n_axes=1, n_motions=1, n_baseline=1, n_cycles=3)
    baseline, target = write_patterns(tmp_path, plan, 0)
    outcome = score.run(baseline, target, CONFIG, tmp_path)
    counts = [np.array(row["counts"]) for row in read_table(baseline, "patterns").to_pylist()]
    for row in outcome.scores.to_pylist()[:3]:
        own = counts[row["cycle"]]
        assert row["jsd"] == pytest.approx(jensen_shannon(own, sum(counts) - own))
        assert row["left_out"] == "cycle"


def test_features_are_those_of_the_scores(tmp_path):
    baseline, target = write_patterns(tmp_path, Fleet(severity=1.0), 0)
    outcome = score.run(baseline, target, CONFIG, tmp_path)
    rows = outcome.scores.to_pylist()
    for row in outcome.features.to_pylist():
        jsd = {
            role: [
                s["jsd"]
                for s in rows
                if s["role"] == role
                and s["axis"] == row["axis"]
                and row["motion"] in (-1, s["motion"])
            ]
            for role in ("baseline", "target")
        }
        assert row["delta_mu"] == pytest.approx(np.mean(jsd["target"]) - np.mean(jsd["baseline"]))
        assert (row["n_baseline"], row["n_target"]) == (len(jsd["baseline"]), len(jsd["target"]))
        assert row["lda"] is None
    pooled = {r["axis"]: r for r in outcome.features.to_pylist() if r["motion"] == -1}
    assert pooled[3]["ks"] == 1.0


def test_the_same_tables_give_the_same_bytes(tmp_path):
    baseline, target = write_patterns(tmp_path, Fleet(), 0)
    first = score.run(baseline, target, CONFIG, tmp_path)
    before = first.scores_path.read_bytes(), first.features_path.read_bytes()
    score.run(baseline, target, CONFIG, tmp_path)
    assert before == (first.scores_path.read_bytes(), first.features_path.read_bytes())


def test_the_verdict_names_the_faulty_joint_and_says_why(tmp_path):
    outcome = diagnose(tmp_path, Fleet(severity=1.0))
    content = json.loads(outcome.path.read_text())
    assert content == outcome.verdict
    assert outcome.exit_code == ExitCode.UNHEALTHY
    assert content["config_hash"] == CONFIG.digest()
    by_axis = {axis["axis"]: axis for axis in content["axes"]}
    assert by_axis[3]["state"] == "fault"
    assert {by_axis[a]["state"] for a in by_axis if a != 3} == {"healthy"}
    assert by_axis[3]["health_index"] == max(a["health_index"] for a in content["axes"])
    assert set(by_axis[3]["features"]) == {"delta_mu", "delta_var", "ks"}
    assert len(by_axis[3]["motions"]) == 3
    assert len(by_axis[3]["motions"][0]["jsd_baseline"]) == 24
    assert len(by_axis[3]["motions"][0]["jsd_target"]) == 4
    text = " ".join(by_axis[3]["reasons"])
    for part in (
        "motion",
        "probability",
        "6 baseline sessions",
        "24 cycles",
        "2026-01-01",
        "nspect",
    ):
        assert part in text
    assert "nan" not in " ".join(strings(content)).lower()


def test_a_healthy_robot_ends_with_zero(tmp_path):
    outcome = diagnose(tmp_path, Fleet())
    assert outcome.exit_code == ExitCode.DONE
    assert all(axis["reasons"] for axis in outcome.verdict["axes"])


def test_too_little_data_is_said_in_numbers_that_json_knows(tmp_path):
    outcome = diagnose(tmp_path, Fleet(n_baseline=1, n_cycles=1))
    assert outcome.exit_code == ExitCode.NOT_ENOUGH_DATA
    for axis in outcome.verdict["axes"]:
        assert axis["state"] == "insufficient-data"
        assert axis["p_value"] is None
        assert axis["health_index"] is None
        assert "too few" in axis["reasons"][0]


def test_one_baseline_session_is_said_to_be_one(tmp_path):
    outcome = diagnose(tmp_path, Fleet(n_baseline=1))
    assert "variation between sessions is unknown" in " ".join(
        outcome.verdict["axes"][0]["reasons"]
    )


def test_few_patterns_are_warned_of(tmp_path):
    baseline, target = write_patterns(tmp_path, Fleet(independent=2, overlap=8), 0)
    notes = score.run(baseline, target, CONFIG, tmp_path).notes
    assert any("16 patterns for 24 possible ones" in note for note in notes)
    outcome = diagnose(tmp_path, Fleet(independent=2, overlap=8))
    assert "Order 4 has 24 patterns" in " ".join(outcome.verdict["axes"][0]["reasons"])


@pytest.mark.parametrize(
    ("cause", "state", "said"),
    [
        ({"harmless": True, "share": 0.9, "interpretation": "a heavier payload"}, "changed", True),
        ({"harmless": True, "share": 0.2, "interpretation": "a heavier payload"}, "fault", True),
        ({"harmless": False, "share": 0.9, "interpretation": "tooth damage"}, "fault", False),
        (None, "fault", False),
    ],
)
def test_a_harmless_cause_makes_a_fault_a_change(tmp_path, cause, state, said):
    causes = {3: {"effect": "some", **cause}} if cause else None
    outcome = diagnose(tmp_path, Fleet(severity=1.0), causes=causes)
    axis = next(a for a in outcome.verdict["axes"] if a["axis"] == 3)
    assert axis["state"] == state
    assert (axis["cause"] is None) == (cause is None)
    assert (
        any(
            "is a heavier payload" in reason or "like a heavier payload" in reason
            for reason in axis["reasons"]
        )
        == said
    )


def test_a_cause_does_not_make_a_healthy_joint_ill(tmp_path):
    outcome = diagnose(tmp_path, Fleet(), causes={3: {"effect": "ripple"}})
    assert {a["state"] for a in outcome.verdict["axes"]} == {"healthy"}


def test_other_rates_and_programs_are_refused(tmp_path):
    baseline, target = write_patterns(tmp_path, Fleet(), 0, sampling_rate_hz=1024.0)
    with pytest.raises(InputError, match="sampling_rate_hz"):
        score.run(baseline, target, CONFIG, tmp_path)


def test_rates_of_one_clock_are_compared(tmp_path):
    baseline, target = write_patterns(tmp_path, Fleet(), 0, sampling_rate_hz=2048.02)
    assert score.run(baseline, target, CONFIG, tmp_path).notes == ()


def test_tables_without_anything_in_common_are_refused(tmp_path):
    baseline, _ = write_patterns(tmp_path / "a", Fleet(n_axes=1), 0)
    _, target = write_patterns(tmp_path / "b", Fleet(n_axes=1), 0)
    table = read_table(target, "patterns")
    later = pa.array([9] * len(table), pa.int32())
    changed = table.set_column(table.column_names.index("tau"), "tau", later)
    write_table(
        target,
        changed,
        stage="patterns",
        config={},
        inputs=[],
        extra=sources_record(read_sources(target), target.parent),
    )
    with pytest.raises(InputError, match="in common"):
        score.run(baseline, target, CONFIG, tmp_path)


def test_the_base_scales_divergences_and_leaves_the_decision(tmp_path):
    bits = diagnose(tmp_path / "bits", Fleet(severity=0.5))
    nats = diagnose(
        tmp_path / "nats", Fleet(severity=0.5), config=load_config(None, ["score.base=2.718281828"])
    )
    for a, b in zip(bits.verdict["axes"], nats.verdict["axes"], strict=True):
        assert a["p_value"] == b["p_value"]
        ratio = b["motions"][0]["jsd_target"][0] / a["motions"][0]["jsd_target"][0]
        assert ratio == pytest.approx(math.log(2), rel=1e-6)
    assert nats.verdict["base"] == pytest.approx(math.e)


def test_a_discriminant_is_learned_kept_and_refused_outside_its_conditions(tmp_path):
    path = tmp_path / "lda.json"
    for seed in range(3):
        folder = tmp_path / str(seed)
        baseline, target = write_patterns(folder, Fleet(severity=1.0), seed)
        outcome = score.run(baseline, target, CONFIG, folder)
        models = discriminants.learn(path, outcome.features, [3], (baseline, target))
        models.write()
    again = discriminants.learn(path, outcome.features, [3], (baseline, target))
    assert len(again.rows) == len(models.rows) == 18
    models = discriminants.read_models(path)
    assert models.by_order[4].n_fault == 3
    baseline, target = write_patterns(tmp_path / "new", Fleet(severity=1.0), 7)
    outcome = score.run(baseline, target, CONFIG, tmp_path / "new", models=models)
    lda = {r["axis"]: r["lda"] for r in outcome.features.to_pylist() if r["motion"] == -1}
    assert lda[3] == max(lda.values()) > 0
    assert all(value < 0 for axis, value in lda.items() if axis != 3)
    fast = group_patterns(read_side(target).patterns)
    for part in fast.values():
        part.rows["f_max_hz"][:] = 600.0
    with pytest.raises(InputError, match="f_max_hz = 600"):
        score.feature_table(outcome.scores, fast, 2.0, models)


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"kind": "opamc latent axis", "version": 2}'])
def test_what_is_no_model_file_is_refused(tmp_path, content):
    path = tmp_path / "lda.json"
    path.write_text(content)
    with pytest.raises(InputError, match=r"lda\.json"):
        discriminants.read_models(path)
