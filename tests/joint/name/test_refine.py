"""Parameters that are a fifth off are found again."""

import numpy as np
import pytest
from closing import fit_declared, joint_of

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.name.candidates import Beside
from opamc_cli.joint.name.chain import chain_of
from opamc_cli.joint.name.refine import refined
from opamc_cli.signal.transform.filters import answers

LIBRARY = built_in_library()


@pytest.mark.parametrize("off", [0.8, 1.2])
def test_a_stribeck_speed_a_fifth_off_is_found_again_without_noise(off):
    recording = joint_of("cyclic", stribeck, strength=1e6, noise_a=1e-8, rate=100.0)
    chain = chain_of(fit_declared([recording]), 0)
    start = Term(LIBRARY["stribeck"], {"stribeck_speed": 0.15 * off, "exponent": 2.0})
    found = refined(start, Beside(chain, False))
    assert found.parameters["stribeck_speed"] == pytest.approx(0.15, rel=0.05)
    assert found.parameters["exponent"] == 2.0


def test_place_and_width_of_a_dragging_place_are_found_together():
    recording = joint_of("cyclic", drag, strength=1e6, noise_a=1e-8, rate=100.0)
    chain = chain_of(fit_declared([recording]), 0)
    start = {"place_rad": 0.34, "width_rad": 0.12, "flatness": 2.0}
    beside = Beside(chain, False)
    found = refined(Term(LIBRARY["position_drag"], start), beside)
    assert found.parameters["place_rad"] == pytest.approx(0.3, abs=0.01)
    assert found.parameters["width_rad"] == pytest.approx(0.1, rel=0.1)


@pytest.mark.parametrize("damping", [0.02, 0.05])
@pytest.mark.parametrize("resonance_hz", [4.7, 7.9, 11.5, 16.3])
def test_a_ringing_that_is_damped_little_is_found_wherever_it_is(resonance_hz, damping):
    def ringing(q, v, a, t):
        return answers([a], 2 * np.pi * resonance_hz, damping, 250.0, ((0, a.size),))[0] - a

    chain = chain_of(fit_declared([joint_of("cyclic", ringing)]), 0)
    beside, effect = Beside(chain, False), LIBRARY["elasticity"]
    track = beside.dataset.coarse.track
    guesses = [Term(effect, one) for one in effect.guesses(track, np.zeros(track.size))]
    best = max(map(beside.candidate, guesses), key=lambda one: one.gain)
    found = refined(best.term, beside).parameters
    assert found["resonance_hz"] == pytest.approx(resonance_hz, rel=0.02)
    assert found["damping"] == pytest.approx(damping, rel=0.3)


def test_an_effect_without_parameters_stays_as_it_is():
    chain = chain_of(fit_declared([joint_of("cyclic", stribeck, rate=100.0)]), 0)
    term = Term(LIBRARY["quadratic_friction"], {})
    assert refined(term, Beside(chain, False)) is term


def stribeck(q, v, a, t):
    return np.sign(v) * np.exp(-((v / 0.15) ** 2))


def drag(q, v, a, t):
    return np.sign(v) * np.exp(-0.5 * ((q - 0.3) / 0.1) ** 2)
