"""The plain rival of the loop is no straw man: it finds what is large."""

from pathlib import Path

import numpy as np
import plain
import pytest

from tests.marks import long

KINOVA = Path(__file__).parents[3] / "shared" / "data" / "kinova_gen3"


def joint(effect: float) -> plain.Signals:
    rng = np.random.default_rng(40)
    t = np.arange(0, 30, 1 / 250)
    q = 0.8 * np.sin(1.3 * t) + 0.4 * np.sin(2.6 * t + 1)
    v = np.gradient(q, t)
    a = np.gradient(v, t)
    current = 0.2 * a + np.sin(q + 0.4) + 0.5 * np.sign(v) + 0.3 * v
    current += effect * np.sign(v) * np.exp(-((v / 0.15) ** 2))
    return plain.Signals(250.0, current + 0.02 * rng.normal(size=t.size), q)


@pytest.mark.parametrize("search", ["stepwise", long("beam")])
def test_finds_a_planted_stribeck_curve(search):
    declared = ("inertia", "gravity", "coulomb", "viscous")
    result = plain.close([joint(0.2)], declared, search=search)
    assert result.names[0] == "stribeck"
    assert result.after < 1.1 * 0.02 < result.before
    assert plain.close([joint(0.0)], declared, search=search).names == []


@pytest.mark.long
@pytest.mark.measured
@pytest.mark.skipif(not KINOVA.is_dir(), reason="measured data are not here")
@pytest.mark.parametrize("search", ["stepwise", "beam"])
def test_nearly_halves_the_error_of_a_measured_joint(search):
    table = np.genfromtxt(KINOVA / "joint_5_trapez.csv", delimiter=",", names=True)
    recording = plain.Signals(1000.0, table["Cur5"], np.unwrap(table["Position5"]))
    result = plain.close([recording], search=search)
    assert result.after < 0.6 * result.before
    assert "ripple" in result.names
