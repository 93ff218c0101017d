"""What forbids a comparison, rule by rule."""

from types import SimpleNamespace

import numpy as np
import pytest

from opamc_cli.stages.verdict.agreement.findings import _coarser, _other_steps
from opamc_cli.stages.verdict.agreement.measured import _changing, _steps


@pytest.mark.parametrize(
    ("usual", "tonight", "refused"),
    [(0.9, 0.1, True), (0.9, 0.4, False), (0.3, 0.05, False), (0.15, 0.8, False)],
)
def test_a_current_that_lost_its_steps_is_another_log_and_one_that_gained_some_may_knock(
    usual, tonight, refused
):
    own = SimpleNamespace(axis=2, changing=tonight)
    told = _coarser(own, SimpleNamespace(changing={2: usual}))
    assert (told is not None) == refused
    assert not refused or f"changes from sample to sample in {tonight:.0%} of them" in told


def test_values_that_are_each_logged_twice_change_in_no_two_samples():
    """It was a fault of the gear: they change in half as many samples, which a knock may."""
    noise = np.random.default_rng(3).normal(size=4000)
    assert _changing([noise]) == 1.0
    assert _changing([np.repeat(noise, 2)]) == 0.0
    knocking = np.where(np.random.default_rng(4).random(4000) < 0.5, noise, 0.0).cumsum()
    assert _changing([knocking]) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("usual", "tonight", "said"),
    [
        (0.0, 2.0, "comes in steps of 2, the baseline's in finer ones"),
        (0.5, 0.0, "comes in finer steps than the baseline's of 0.5"),
        (0.5, 0.5, None),
        (0.1, 2.0, "comes in steps of 2, the baseline's in finer ones"),
        (0.0, 0.1, None),
        (0.0, 0.0, None),
    ],
)
def test_a_current_in_other_steps_than_the_baselines_is_another_log(usual, tonight, said):
    def logged(step, seed):
        noise = np.random.default_rng(seed).normal(0, 0.25, 4000) * (1 + 3 * seed)
        return noise if step == 0 else np.round(noise / step) * step

    # what a fault shakes has larger steps, and comes in none
    (before, now) = ([logged(step, seed)] for seed, step in enumerate((usual, tonight)))
    own = SimpleNamespace(axis=2, steps=_steps(now), changing=_changing(now))
    baseline = SimpleNamespace(steps={2: _steps(before)}, changing={2: _changing(before)})
    told = _other_steps(own, baseline)
    assert (said is None) == (told is None)
    assert said is None or said in told
