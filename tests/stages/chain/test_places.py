"""Strokes that are alike but for where they lead: a pallet's, and those that a camera guides."""

from itertools import pairwise

import numpy as np
import pyarrow.parquet as pq
import pytest

from opamc_cli.config import load_config
from opamc_cli.stages.chain.cycles.places import mixes
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run

PICK = 0.7
PALLET = (-0.61, -0.65, -0.70)
"""Places to which the joint moves in turn, and from each back, rad."""
PLACES = (-0.6, 0.0, 0.3)
"""As a pallet's, but that no stroke is like another."""
ELECTRICAL = 200
"""Turns of the current vector per turn of the joint."""


def save(path, places, seed, first=0, moved=0.0, phases=False, swings=0.0, late=0):
    """Strokes from the pick to one place after another and back, from a stroke on; their ends.

    A reported current with the position, or phase currents alone. A swinging joint is the faster.
    """
    rng = np.random.default_rng(seed)
    stops = [stop for place in places for stop in (place, PICK)]
    stops = [stop + moved for stop in (PICK, *stops)][first:]
    scale = 4 if phases else 1
    rate_hz = 250.0 * scale
    pieces = [np.full(150 * scale, stops[0])]
    for at, to in pairwise(stops):
        n = round(100 + 250 * abs(to - at)) * scale
        time = np.arange(n) / n
        way = 0.5 - 0.5 * np.cos(np.pi * time)
        way += swings * np.sin(np.pi * time) ** 2 * np.sin(4 * np.pi * time)
        pieces += [at + (to - at) * way]
        if late and to == PLACES[0]:
            pieces[-1] -= 0.05 * (to - at) * np.arange(n) / n
            pieces += [to - 0.05 * (to - at) * (1 - np.arange(late) / late)]
        pieces += [np.full(rng.integers(60, 140) * scale, to)]
    position = np.concatenate(pieces)
    speed = np.gradient(position) * rate_hz
    current = np.tanh(speed / 0.02) + 0.5 * speed + 0.01 * rng.normal(size=speed.size)
    if phases:
        angle = ELECTRICAL * position[:, np.newaxis] - 2 * np.pi / 3 * np.arange(3)
        vector = current[:, np.newaxis] * np.cos(angle) + 0.01 * rng.normal(size=angle.shape)
        columns = {f"axis1_{phase}": vector[:, k] for k, phase in enumerate("abc")}
    else:
        logged = position + 1e-5 * rng.normal(size=speed.size)
        columns = {"axis1_current": current, "axis1_position": logged}
    save_run(path, RunInfo(sampling_rate_hz=rate_hz), columns)
    return position


def identified(tmp_path, baseline, target, phases=False, swings=0.0):
    """Motions of a target by the baseline's cycle, with where each leads, by the truth."""
    for number, places in enumerate(baseline):
        save(tmp_path / "base" / f"{number}.parquet", places, seed=number, phases=phases)
    position = save(tmp_path / "target" / "t.parquet", *target, phases=phases, swings=swings)
    chain = [load_config(), tmp_path / "out"]
    done = run_chain([tmp_path / "base"], *chain)
    done = run_chain([tmp_path / "target"], chain[0], tmp_path / "t", reference=done.motions)
    moved = [error.axes for error in done.errors if "has another zero" in str(error)]
    assert moved == ([(1,)] if len(target) > 3 else [])
    rows = pq.read_table(done.motions).to_pylist()
    return [(row["motion"], position[row["start"]], position[row["stop"] - 1]) for row in rows]


@pytest.mark.parametrize("phases", [False, True])
@pytest.mark.parametrize("first", range(6))
def test_the_strokes_of_a_pallet_are_told_by_where_they_lead(tmp_path, first, phases):
    """More cycles would fit where each stroke is taken for that of the next place."""
    found = identified(tmp_path, [PALLET * 5] * 2, (PALLET * 5, 7, first), phases)
    led = {}
    for motion, start, stop in found:
        led.setdefault(motion, []).append((start, stop))
    assert len(led.keys() - {-1}) == 6
    assert len(led.get(-1, ())) < (1 if phases else 6)
    for motion, ends in led.items():
        if motion >= 0:
            assert np.ptp(ends, axis=0) == pytest.approx([0, 0], abs=0.01)


def test_a_joint_with_another_zero_is_told_all_the_same(tmp_path):
    found = identified(tmp_path, [PALLET * 5] * 2, (PALLET * 5, 7, 0, 0.2))
    assert [motion for motion, *_ in found] == [0, 1, 2, 3, 4, 5] * 5


def test_motions_that_lead_elsewhere_are_not_compared_and_said(tmp_path):
    """One place of an edited program: a gear was called faulty by the strokes to and from it."""
    for number in range(2):
        save(tmp_path / "base" / f"{number}.parquet", PLACES * 5, seed=number)
    save(tmp_path / "target" / "t.parquet", (-0.6, -0.1, 0.3) * 5, 7, moved=0.3)
    chain = [load_config(), tmp_path / "out"]
    done = run_chain([tmp_path / "base"], *chain)
    done = run_chain([tmp_path / "target"], chain[0], tmp_path / "t", reference=done.motions)
    motions = pq.read_table(done.motions)["motion"].to_pylist()
    assert motions == [0, 1, -1, -1, 4, 5] * 5
    zero, edited = done.errors
    assert "axis 1 has another zero" in str(zero)
    assert "10 of 30 motions of axis 1 lead elsewhere" in str(edited)


def test_a_stroke_that_ends_late_is_told_and_said_unless_the_baseline_knows_it(tmp_path):
    """What follows its usual end is not compared, so that nothing would tell of it."""
    for number, late in enumerate((0, 0, 150)):
        save(tmp_path / f"{number}.parquet", PLACES * 5, seed=number, late=late)
    one, other, creeps = (tmp_path / f"{number}.parquet" for number in range(3))
    for baseline, said in (([one, other], 1), ([one, other, creeps], 0)):
        out = tmp_path / str(said)
        done = run_chain(baseline, load_config(), out / "b")
        target = run_chain([creeps], load_config(), out / "t", reference=done.motions)
        assert sum("5 motions of axis 1 end late" in str(one) for one in target.errors) == said
        assert not done.errors
        motions = pq.read_table(target.motions)["motion"].to_pylist()
        assert motions == [0, 1, 2, 3, 4, 5] * 5


@pytest.mark.parametrize("phases", [False, True])
def test_what_a_camera_guides_is_told_wherever_it_leads(tmp_path, phases):
    rng = np.random.default_rng(1)
    guided = [tuple(rng.uniform(-0.8, -0.5, 12)) for _ in range(3)]
    found = identified(tmp_path, guided[:2], (guided[2], 7), phases)
    assert [motion for motion, *_ in found] == [0, 1] * 12


def test_a_joint_that_does_not_follow_its_speed_is_told_by_its_places(tmp_path):
    """The grosser a fault is, the less it must be left unjudged: 1.4 times the highest speed."""
    found = identified(tmp_path, [PALLET * 5] * 2, (PALLET * 5, 7), swings=0.05)
    assert [motion for motion, *_ in found] == [0, 1, 2, 3, 4, 5] * 5


@pytest.mark.parametrize("seed", range(20))
def test_turns_that_scatter_are_no_other_motions(seed):
    """A recording told as one cycle of sixteen motions, or four, where noise hides the current."""
    rng = np.random.default_rng(seed)
    scattered = np.tile([119.0, -175.0, 143.0, -87.0], 8) + 2 * rng.normal(size=32)
    told, once, again = np.tile(range(4), 8), np.arange(32), np.tile(range(16), 2)
    assert not mixes(scattered, told, once)
    assert not mixes(scattered, told, again)
    pallet = np.tile([32.0, -32.0, 33.0, -33.0, 34.0, -34.0], 4) + 0.1 * rng.normal(size=24)
    assert mixes(pallet, np.tile(range(2), 12), np.tile(range(6), 4))
    assert not mixes(pallet, np.full(24, -1), np.tile(range(6), 4))
