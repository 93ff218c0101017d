"""The motion in a baseline's recordings, kept: the same to the last digit, and followed once."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from opamc_cli.joint.change import units
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Joint
from opamc_cli.stages.model import kept_tracks
from opamc_cli.stages.processes.kept import KeptResults
from opamc_cli.stages.recordings.axis_recording import read_recording
from opamc_cli.storage.runs.run import Run

SAMPLE = Path(__file__).parents[3] / "data" / "samples" / "normal" / "session-000.parquet"


@pytest.fixture(scope="module")
def phases() -> Recording:
    with Run(SAMPLE, "session-000") as run:
        return read_recording(run, 2, 0, run.n_samples)


def same(one: object, other: object) -> bool:
    for field in fields(one):
        mine, kept = getattr(one, field.name), getattr(other, field.name)
        if isinstance(mine, np.ndarray):
            alike = mine.dtype == kept.dtype and mine.strides == kept.strides
            if not (alike and np.array_equal(mine, kept) and kept.flags.writeable):
                return False
        elif mine != kept or type(mine) is not type(kept):
            return False
    return True


@pytest.mark.parametrize("joint", [Joint(100.0, 5), Joint(None, 5), Joint()])
def test_what_is_kept_is_the_same_to_the_last_digit(phases, joint, tmp_path, monkeypatch):
    plain = units.follow(phases, joint)
    follow = kept_tracks.following(KeptResults(tmp_path))
    first = follow(phases, joint)
    monkeypatch.setattr(kept_tracks, "follow", lambda *_: pytest.fail("followed again"))
    again = follow(replace(phases, started_s=7.0), joint)
    for found in (first, again):
        assert all(same(one, other) for one, other in zip(plain, found, strict=True))


def test_a_logged_motion_is_kept_as_well_and_rest_is_no_track(phases, tmp_path, monkeypatch):
    turning = np.sin(np.arange(4000) / 100.0)
    logged = Recording("logged", 500.0, current_a=turning + 0.1, position_rad=turning)
    resting = replace(logged, name="resting", position_rad=0 * turning)
    follow = kept_tracks.following(KeptResults(tmp_path))
    for recording in (logged, resting):
        follow(recording, Joint())
    monkeypatch.setattr(kept_tracks, "follow", lambda *_: pytest.fail("followed again"))
    plain = units.follow(logged, Joint())
    assert all(map(same, plain, follow(logged, Joint())))
    assert follow(resting, Joint()) is None


def test_another_joint_or_recording_is_another_track(phases, tmp_path):
    kept = KeptResults(tmp_path)
    follow = kept_tracks.following(kept)
    follow(phases, Joint(100.0, 5))
    follow(phases, Joint(50.0, 5))
    follow(replace(phases, phases_a=phases.phases_a * 2), Joint(100.0, 5))
    assert sum(path.is_file() for path in tmp_path.rglob("*")) == 3


def test_without_a_folder_nothing_is_kept():
    assert kept_tracks.following(None) is units.follow
