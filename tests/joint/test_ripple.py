"""One ripple stays one, however the drive answers it."""

from dataclasses import replace

import numpy as np
import pytest
from closing import close_recording
from scipy.signal import bilinear, lfilter
from simulator import simulate

from opamc_cli.joint.effects.ripple import Ripple
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.recordings import build_track
from opamc_cli.joint.motion.track import Joint
from tests.marks import long

EVERYTHING = {"order": 2.0, "speed": 1.0, "direction": 1.0, "load": 1.0, "current": 1.0}
ANSWERED = EVERYTHING | {"answer": 2.0, "top_hz": 60.0}


@pytest.fixture(scope="module")
def track():
    made = simulate(3, rate=500.0, cycles=2, kind="quintic")
    recording = Recording("run", 500.0, current_a=made.current, position_rad=made.position)
    track = build_track([recording], Joint(made.gear_ratio, made.pole_pairs))
    return track.with_model(made.current, made.current, ())


@pytest.mark.parametrize("full", [EVERYTHING, ANSWERED])
def test_smaller_forms_keep_the_columns_that_they_compute(track, full):
    columns = Ripple().columns(track, full)
    forms = Ripple().variants(full)
    assert len({tuple(form.items()) for form, _ in forms}) == len(forms)
    for form, keep in forms:
        np.testing.assert_array_equal(Ripple().columns(track, form), columns[:, keep])


def resonant(wave, rate_hz, resonance_hz=12.0, damping=0.2):
    """A velocity loop that overshoots."""
    w = 2 * np.pi * resonance_hz
    return lfilter(*bilinear((2 * damping * w, w * w), (1, 2 * damping * w, w * w), rate_hz), wave)


@pytest.mark.parametrize("seed", [long(8)])
def test_a_ripple_that_the_velocity_loop_shapes_is_one_line(seed):
    made = simulate(seed, (), 0.0, rate=500.0, kind="quintic")
    wave = np.cos(2 * made.gear_ratio * made.position + 0.4)
    current = made.current + 8 * made.noise_rms * resonant(wave, made.rate_hz)
    _, loop = close_recording(made, current, seed=seed)
    assert [step.term.effect.name for step in loop.steps] == ["ripple"]
    assert loop.steps[0].term.parameters["order"] == pytest.approx(2.0, abs=1e-6)
    assert loop.verdict == "closed"
    assert loop.rmse_after_a < 1.1 * made.noise_rms


@pytest.mark.long
@pytest.mark.parametrize("seed", [long(4), 8])
def test_a_ripple_in_proportion_to_the_current_is_one_line(seed):
    made = simulate(seed, (), 0.0, rate=500.0)
    made = replace(made, gear_ratio=None, pole_pairs=None)
    current = made.current * (1 + 0.2 * np.cos(160 * made.position + 0.4))
    _, loop = close_recording(made, current, seed=seed)
    assert [step.term.effect.name for step in loop.steps] == ["ripple"]
    assert loop.steps[0].term.parameters["order"] == pytest.approx(160.0, rel=1e-3)
    assert loop.rmse_after_a < 1.1 * made.noise_rms
