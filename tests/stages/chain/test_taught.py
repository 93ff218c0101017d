"""Points of a program that were taught anew: all joints lead elsewhere by a little, and know it."""

import numpy as np
import pytest

from opamc_cli.config import load_config
from opamc_cli.stages import diagnose
from opamc_cli.stages.chain.cycles.taught import taught_anew
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run

RATE_HZ = 250.0
POINTS = np.array([[0.0, 0.2, -0.3], [0.9, -0.5, 0.4], [-0.4, 0.6, 0.8], [0.5, 0.1, -0.6]])
"""Places that three joints move to in turn, rad."""
TOUCHED_UP = np.array([[5, -4, 6], [-5, 4, 5], [6, 5, -4], [4, -6, 5]]) * 1e-3
"""How far away points lie that were taught anew, rad."""
ORDER = 200
"""Of the gear's ripple, per turn of the joint: a few mrad of place are much of its phase."""


def save(path, seed, moved=0.0, rubs=1.0):
    """Five cycles of a robot whose first gear ripples; `rubs`: friction of the second joint."""
    rng = np.random.default_rng(seed)
    places = np.vstack([POINTS + moved] * 5)
    columns = {}
    for joint in range(3):
        way = [np.full(100, places[0, joint])]
        for at, to in zip(places[:-1, joint], places[1:, joint], strict=True):
            time = np.arange(300) / 300
            way += [at + (to - at) * (0.5 - 0.5 * np.cos(np.pi * time)), np.full(100, to)]
        position = np.concatenate(way)
        speed = np.gradient(position) * RATE_HZ
        resists = rubs if joint == 1 else 1.0
        current = resists * np.tanh(speed / 0.02) + 0.3 * speed
        current += (
            (0.3, 0.03, 0.03)[joint] * np.sin(ORDER * position) * np.tanh(np.abs(speed) / 0.02)
        )
        current *= 1 + 0.01 * rng.normal()
        current += 0.02 * rng.normal(size=speed.size)
        columns[f"axis{joint + 1}_current"] = current
        columns[f"axis{joint + 1}_position"] = position + 2e-5 * rng.normal(size=speed.size)
    info = RunInfo(sampling_rate_hz=RATE_HZ, session=f"night {seed}")
    save_run(path, info, columns)


@pytest.fixture(scope="module")
def baseline(tmp_path_factory):
    folder = tmp_path_factory.mktemp("baseline")
    for seed in range(5):
        save(folder / f"{seed}.parquet", seed)
    return folder


def anew(tmp_path, baseline, **how):
    save(tmp_path / "target" / "t.parquet", 9, **how)
    own = run_chain([baseline], load_config(), tmp_path / "b")
    other = run_chain([tmp_path / "target"], load_config(), tmp_path / "t", reference=own.motions)
    return taught_anew(own.motions, other.motions)


def test_points_that_were_taught_anew_are_told_by_all_joints(tmp_path, baseline):
    found = anew(tmp_path, baseline, moved=TOUCHED_UP)
    assert found == pytest.approx({1: 6e-3, 2: 6e-3, 3: 6e-3}, rel=0.05)


@pytest.mark.parametrize("moved", [0.0, [0.0, 5e-3, 0.0], 3e-4])
def test_one_joint_that_ends_elsewhere_is_none_of_the_program_s(tmp_path, baseline, moved):
    """A brake that drags, or an encoder that slipped; and nobody teaches 0.3 mrad."""
    assert anew(tmp_path, baseline, moved=moved) == {}


def test_a_joint_on_another_path_is_no_fault_but_one_with_more_friction_is(tmp_path, baseline):
    """Of five healthy robots with points 4 mrad away five had a joint at fault."""
    causes = {}
    for rubs in (1.0, 1.6):
        target = tmp_path / f"{rubs}" / "t.parquet"
        save(target, 9, moved=TOUCHED_UP, rubs=rubs)
        out = tmp_path / f"out {rubs}"
        done = diagnose.run([baseline], [target.parent], load_config(), out)
        assert any("points were taught anew: axes 1-3 lead" in note for note in done.notes)
        axes = {one["axis"]: one for one in done.verdict["axes"]}
        states = {axis: one["state"] for axis, one in axes.items()}
        assert states[1] != "fault"
        causes[rubs] = {axis: (one["cause"] or {}).get("effect") for axis, one in axes.items()}
        if rubs > 1.0:
            assert states[2] == "fault"
    assert causes[1.0][1] == "taught_points"
    assert causes[1.6][2] == "coulomb"
