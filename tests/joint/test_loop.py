"""The loop on the tests' own simulator: what it adds, what it names, and when it keeps quiet."""

import numpy as np
import pytest
from closing import close_on, close_recording
from simulator import DECLARED, simulate

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.gate import Gate
from opamc_cli.joint.model import fit_terms
from opamc_cli.joint.retraction import confirmed
from opamc_cli.joint.steps import Progress, Step
from opamc_cli.joint.trace import trace_residual

LIBRARY = built_in_library()
FINDABLE = (
    "stribeck",
    "ripple",
    "offset",
    "quadratic_friction",
    "sublinear_friction",
    "asymmetric_friction",
    "load_friction",
    "thermal_viscous",
    "warmup",
    "spring",
    "payload_change",
    "position_drag",
    "hysteresis",
    "elasticity",
    "time_delay",
    "mains_hum",
    *DECLARED,
)


def names_of(loop):
    return [{step.term.effect.name, *step.ties} for step in loop.steps]


@pytest.mark.parametrize("effect", FINDABLE)
def test_a_missing_effect_is_found_named_and_removed(effect):
    made, loop = close_on(1, (effect,), rate=250.0 if effect != "ripple" else 1000.0)
    assert any(effect in names for names in names_of(loop))
    assert loop.verdict == "closed"
    gone = loop.rmse_before_a**2 - loop.rmse_after_a**2
    assert gone > 0.8 * (loop.rmse_before_a**2 - made.noise_rms**2)


# About one null run in fifty gets an addition (benchmarks/loop.py); none of these does.
@pytest.mark.parametrize("seed", [4, 7, 9, 21, 40])
@pytest.mark.parametrize("quantum", [None, 1e-5])
def test_nothing_is_added_where_nothing_is_missing(seed, quantum):
    _, loop = close_on(seed, (), quantum=quantum, rate=500.0)
    assert loop.steps == ()
    assert loop.verdict == "nothing-missing"
    assert loop.explained_share == 1.0
    assert loop.rmse_after_a == loop.rmse_before_a


@pytest.mark.parametrize("pair", [("stribeck", "ripple"), ("position_drag", "warmup")])
def test_two_missing_effects_are_both_found(pair):
    _, loop = close_on(5, pair, rate=500.0)
    for effect in pair:
        assert any(effect in names for names in names_of(loop))


@pytest.mark.parametrize(
    ("effect", "domain"), [("ripple", "motor-angle"), ("mains_hum", "frequency")]
)
def test_an_effect_outside_the_library_is_not_given_another_name(effect, domain):
    _, loop = close_on(5, (effect,), without=(effect,), rate=500.0)
    assert loop.steps == ()
    assert loop.verdict == "not-in-library"
    assert loop.explained_share == 0.0
    assert loop.remaining_domain == domain


def test_two_runs_of_the_loop_are_equal():
    _, first = close_on(2, ("stribeck",), rate=250.0)
    _, second = close_on(2, ("stribeck",), rate=250.0)
    assert first.rmse_after_a == second.rmse_after_a
    assert [s.p_value for s in first.steps] == [s.p_value for s in second.steps]


def test_a_payload_that_changes_in_the_last_open_cycle_is_found():
    # Of five cycles the last is sealed, and the fourth alone knows the new payload.
    made = simulate(3, (), rate=250.0, cycles=5)
    changed = made.current.copy()
    start = round(0.6 * changed.size)
    changed[start:] += 8 * made.noise_rms * np.sin(made.position[start:] + 0.5)
    _, loop = close_recording(made, changed)
    assert [step.term.effect.name for step in loop.steps] == ["payload_change"]
    found = loop.steps[0].term.parameters["since_s"]
    # A twentieth of a cycle: the refinement ends where a slow stretch tells little.
    assert abs(found - start / made.rate_hz) < 0.05 * 7.3
    assert loop.rmse_after_a < 1.1 * made.noise_rms


def test_what_begins_in_the_sealed_cycle_is_noticed():
    made = simulate(3, (), rate=250.0, cycles=5)
    changed = made.current.copy()
    start = round(0.85 * changed.size)
    changed[start:] += 8 * made.noise_rms * np.sin(made.position[start:] + 0.5)
    _, loop = close_recording(made, changed)
    assert (loop.verdict, loop.remaining_domain) == ("not-in-library", "time")


def test_what_the_sealed_data_do_not_bear_out_is_taken_back():
    # Slow noise that looks like warm-up in the open cycles, and like nothing in the sealed ones.
    _, loop = close_on(18, (), quantum=5e-4)
    assert loop.steps == ()
    assert loop.rmse_after_a == loop.rmse_before_a
    before = loop.before
    found = {found.term.effect.name: found for found in trace_residual(before, LIBRARY).candidates}
    term = found["warmup"].term
    fitted = fit_terms(before.session, (*before.terms, term))
    open_error, closed_error = before.rmse(sealed=False), fitted.rmse(sealed=False)
    assert closed_error < open_error
    step = Step(term, "", 0.1, 1e-4, 0.0, 3.0, 1.0, (), None, open_error, closed_error)
    progress = Progress(steps=[step])
    after, steps, _ = confirmed(before, fitted, [step], [], progress, Gate())
    assert steps == []
    assert after is before
    assert progress.rejected["warmup"].why == "does not hold on the sealed data"


@pytest.mark.parametrize(("seed", "quantum"), [(8, 5e-4), (32, 1e-4), (53, 5e-4)])
def test_what_smoothing_rounds_off_in_every_cycle_is_not_called_missing(seed, quantum):
    _, loop = close_on(seed, (), quantum=quantum)
    assert loop.verdict == "nothing-missing"
    assert loop.explained_share == 1.0


@pytest.mark.parametrize("effect", ["thermal_viscous", "warmup"])
def test_friction_that_changes_from_cycle_to_cycle_is_noticed_without_its_name(effect):
    removed = ("thermal_viscous", "warmup")
    _, loop = close_on(63, (effect,), ratio=0.6, without=removed)
    assert not loop.steps
    assert loop.verdict == "not-in-library"
    assert loop.remaining_domain in ("temperature", "time")


def test_the_filter_of_a_drive_s_current_is_found_as_a_filter():
    _, loop = close_on(29, (), ratio=0.0, current_filter_hz=148.0, current_quantum=8e-3)
    (step,) = loop.steps
    assert step.term.effect.name == "time_delay"
    assert step.term.parameters["delay_s"] == pytest.approx(1 / (2 * np.pi * 148.0), rel=0.3)
    assert "through a filter" in step.interpretation
