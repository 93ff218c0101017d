from dataclasses import replace

import numpy as np

from opamc_cli.joint.fit.model import dataset_of
from opamc_cli.joint.motion.kinematics import Recording, Smoothing, build_track, smoothings
from opamc_cli.joint.motion.recordings import grouped_track
from opamc_cli.joint.motion.track import Joint


def test_a_motion_of_a_third_of_a_second_has_samples_to_fit_after_a_long_window_too():
    rate = 2000.0
    time = np.arange(round(1.35 * rate)) / rate
    place = 2 * np.clip(time - 0.5, 0.0, 0.35)
    noise = np.random.default_rng(0).normal(size=time.size)
    current = np.sign(np.gradient(place)) + 0.01 * noise
    recording = Recording("run", rate, current_a=current, position_rad=place)
    track, grouping = grouped_track([recording], Joint())
    other = build_track([recording], Joint(), Smoothing(0.12, from_velocity=False))
    dataset = dataset_of(replace(other, moving=track.moving, clear=track.clear), grouping)
    # Its moving average carries every open block's samples into sealed ones.
    assert other.kernel.size > 200
    fine, coarse = dataset.parts
    assert coarse.rows.size == fine.rows.size > 0


def test_no_window_is_longer_than_the_shortest_recording():
    place = np.sin(np.arange(400) / 50)
    recordings = [
        Recording(name, 4000.0, current_a=place[:size], position_rad=place[:size])
        for name, size in (("long", 400), ("short", 300))
    ]
    assert [one.window_s for one in smoothings(recordings)] == [0.01, 0.02, 0.05]
    for smoothing in smoothings(recordings):
        assert build_track(recordings, Joint(), smoothing).size == 700
