"""What changed between a baseline and a target, on the tests' own simulator."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from sessions import recordings
from simulator import simulate

from opamc_cli.joint.change import explain
from opamc_cli.joint.change.explain import explain_change, friction_change
from opamc_cli.joint.change.reading import Reading
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Joint
from tests.marks import long

BASELINE, TARGET = 4, 3


def knocking(a, time):
    """Swing at 20 Hz for a while where the torque turns over, as a loose joint does."""
    after = np.zeros_like(time)
    turned = np.flatnonzero(np.diff(np.sign(a)) != 0)
    for at in turned:
        since = time[at:] - time[at]
        after[at:] += np.exp(-since / 0.08) * np.sin(2 * np.pi * 20 * since)
    return after


def change_of(kind, seed=1, colder=0.0, sessions=True, known=True, wander=0.0, own=0.0):
    """Sessions of two cycles each, whose friction differs by 5 %; the target's has an effect.

    What the declared effects do not hold may `wander` from session to session, too; `own` is the
    size of the healthy gear's kinematic error, in units of the noise.
    """
    count = BASELINE + TARGET
    made = simulate(seed, (), 0.0, cycles=2 * count, rate=250.0)
    rng = np.random.default_rng(seed)
    q, v, a, noise = made.position, made.velocity, made.acceleration, made.noise_rms
    top = np.quantile(np.abs(v), 0.95)
    tooth = 2 * (made.gear_ratio + 1)
    shape = {
        "nothing": np.zeros_like(v),
        "tooth": 1.5 * noise * np.cos(tooth * q),
        "payload": 0.3 * np.std(made.current) * (np.sin(q + 0.3) + 0.3 * a / a.std()),
        "friction": 0.5 * v / top,
        "tooth and payload": 1.5 * noise * np.cos(tooth * q)
        + 1.5 * np.std(made.current) * (np.sin(q + 0.3) + 0.3 * a / a.std()),
        "friction and knocks": 0.5 * v / top + 20 * noise * knocking(a, made.time),
        "hum": 1.5 * noise * np.cos(2 * np.pi * 50.0 * made.time),
    }[kind]
    edges = np.linspace(0, v.size, count + 1).astype(int)
    if not sessions:
        edges = edges[[0, BASELINE, count]]
    recordings = []
    for k, (start, stop) in enumerate(pairwise(edges)):
        rows = slice(start, stop)
        new = k >= (BASELINE if sessions else 1)
        current = made.current[rows] + new * shape[rows]
        current += 0.05 * (rng.normal() * np.sign(v[rows]) + rng.normal() * v[rows] / top)
        current += own * noise * np.cos(2 * made.gear_ratio * q[rows])
        if wander:
            current += wander * rng.normal() * np.sin(5 * q[rows])
        recordings.append(
            Recording(
                f"session-{k}",
                made.rate_hz,
                current_a=current,
                position_rad=q[rows],
                temperature_c=25.0 + rng.normal() - new * colder + 0.0 * q[rows],
            )
        )
    first = BASELINE if sessions else 1
    joint = Joint(made.gear_ratio, made.pole_pairs) if known else Joint()
    return explain_change(recordings[:first], recordings[first:], joint)


@pytest.mark.parametrize("sessions", [True, False])
@pytest.mark.parametrize("seed", [1, long(2), long(3)])
def test_sessions_that_differ_by_their_friction_have_no_cause(seed, sessions):
    change = change_of("nothing", seed, sessions=sessions)
    assert change.causes == ()
    assert not change.harmless


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
def test_friction_is_found_however_much_sessions_differ_in_what_it_is_not(seed):
    cause = change_of("friction", seed, wander=0.3).causes[0]
    assert "viscous" in (cause.effect, *cause.ties)
    assert change_of("nothing", seed, wander=0.3).causes == ()


def test_friction_that_the_mean_square_does_not_show_is_measured_by_its_own(monkeypatch):
    monkeypatch.setattr(explain, "left_by", lambda compared, *given: np.ones(compared.after.size))
    causes = change_of("friction").causes
    assert sum(cause.share for cause in causes) == pytest.approx(1.0, abs=0.05)


def test_a_current_that_is_always_zero_has_no_cause():
    made = simulate(1, (), 0.0, cycles=2, rate=250.0)
    dead = Recording("0", 250.0, current_a=np.zeros(made.time.size), position_rad=made.position)
    assert explain_change([dead] * BASELINE, [dead] * TARGET, Joint()).causes == ()


@pytest.mark.parametrize("sessions", [True, long(False)])
@pytest.mark.parametrize("seed", [1, long(4)])
def test_tooth_damage_is_a_ripple_and_a_fault(seed, sessions):
    change = change_of("tooth", seed, sessions=sessions)
    cause = change.causes[0]
    assert cause.effect == "ripple"
    assert cause.share > 0.7
    assert "inspect the flexspline" in cause.interpretation
    assert cause.parameters["order"] == pytest.approx(2.02, abs=0.02)
    # An order that a stroke cannot tell from 2 is not sold as one that it can.
    if cause.evidence["order_resolution"] > 0.05:
        assert "kinematic error" in cause.ties[0]
    assert not change.harmless


def reading(kind="mesh", ratio=3.0, power=0.01):
    """Read a line whose power, in A^2, is as large as that of the changes of `change_of`."""
    return Reading(
        effect="ripple",
        parameters={"order": 2.0},
        interpretation=f"{kind}, {power}",
        p_value=0.001,
        ties=(),
        evidence={"power_ratio": ratio},
        lines=(),
        fundamental=2.0,
        kind=kind,
        power=power,
    )


def change_with(monkeypatch, kind, *readings, **options):
    monkeypatch.setattr(explain, "find_periodic", lambda *given: list(readings))
    return change_of(kind, **options)


@pytest.mark.parametrize(("of", "colder"), [("tooth", 0.0), long("friction", 15.0)])
@pytest.mark.parametrize(("kind", "ratio"), [("unknown", 3.0), ("mesh", 20.0)])
def test_of_two_readings_the_first_names_and_neither_makes_it_less(
    monkeypatch, kind, ratio, of, colder
):
    """What whole strokes show is no less a fault, and excuses no more, for a better name."""
    plain = reading(kind=kind, ratio=ratio)
    faint = reading(ratio=1.0, power=0.002)
    alone, both = (
        change_with(monkeypatch, of, *readings, colder=colder)
        for readings in ([plain], [faint, plain])
    )
    (one,) = (cause for cause in alone.causes if cause.effect == "ripple")
    (other,) = (cause for cause in both.causes if cause.effect == "ripple")
    assert other.interpretation == faint.interpretation
    assert (other.share, other.serious, other.clear) == (one.share, one.serious, one.clear)
    assert (both.harmless, both.explained_share) == (alone.harmless, alone.explained_share)


@pytest.mark.long
def test_tooth_damage_is_a_fault_even_where_a_payload_hides_it():
    change = change_of("tooth and payload")
    assert change.causes[0].effect == "ripple"
    assert change.causes[1].effect == "payload_change"
    assert change.causes[1].share > 0.7
    assert not change.harmless


def test_a_line_that_keeps_its_frequency_is_no_ripple():
    change = change_of("hum")
    assert change.causes[0].effect == "mains_hum"
    assert change.causes[0].parameters == {"frequency_hz": 50.0}
    assert change.harmless


def test_unknown_gear_ratio_leaves_the_order_per_joint_revolution():
    cause = change_of("tooth", known=False).causes[0]
    assert cause.effect == "ripple"
    assert "gear ratio unknown" in cause.interpretation


@pytest.mark.parametrize(
    ("kind", "colder", "effect"),
    [("payload", 0.0, "payload_change"), ("friction", 15.0, "thermal_viscous")],
)
@pytest.mark.parametrize("seed", [1, long(2)])
def test_payload_and_cold_grease_are_no_faults(kind, colder, effect, seed):
    change = change_of(kind, seed, colder)
    assert change.causes[0].effect == effect
    assert change.harmless


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
def test_cold_grease_is_no_excuse_for_a_joint_that_knocks(seed):
    change = change_of("friction and knocks", seed, colder=15.0)
    assert not change.harmless
    assert "thermal_viscous" not in {cause.effect for cause in change.causes}


@pytest.mark.parametrize(
    ("kind", "effect", "harmless"),
    [
        long("hum of a phase", "mains_hum", True),
        long("gain of a phase", "sensor_gain", True),
        ("order 7", "ripple", False),
    ],
)
def test_what_phases_pick_up_is_told_from_a_ripple(kind, effect, harmless):
    rng = np.random.default_rng(5)
    made = simulate(5, (), 0.0, cycles=2 * (BASELINE + TARGET), rate=1000.0)
    joint = Joint(gear_ratio=50.0, pole_pairs=4)  # a carrier well below half the rate
    edges = np.linspace(0, made.current.size, BASELINE + TARGET + 1).astype(int)
    recordings = []
    for k, (start, stop) in enumerate(pairwise(edges)):
        q, current = made.position[start:stop], made.current[start:stop]
        new = k >= BASELINE
        if new and kind == "order 7":
            current = current + 3 * made.noise_rms * np.cos(7 * 50 * q)
        field = 4 * 50 * q + rng.uniform(0, 2 * np.pi)
        phases = current[:, None] * np.cos(field[:, None] - np.arange(3) * 2 * np.pi / 3)
        phases += 0.3 * made.noise_rms * rng.normal(size=phases.shape)
        if new and kind == "hum of a phase":
            phases[:, 0] += 3 * made.noise_rms * np.sin(100 * np.pi * made.time[start:stop])
        if new and kind == "gain of a phase":
            phases[:, 1] *= 1.3
        recordings.append(Recording(f"{k}", 1000.0, phases_a=phases, position_rad=q))
    change = explain_change(recordings[:BASELINE], recordings[BASELINE:], joint)
    assert change.causes[0].effect == effect
    assert change.causes[0].share > 0.6
    assert change.harmless == harmless


@pytest.mark.long
def test_more_friction_at_the_same_temperature_is_not_harmless():
    change = change_of("friction")
    assert "viscous" in {change.causes[0].effect, *change.causes[0].ties}
    assert not change.harmless


@pytest.mark.parametrize("moved", ["target", "baseline"])
def test_a_recording_whose_strokes_no_other_has_hides_no_cause(moved):
    """Of a short one nothing may be left once what all have alike is taken out."""
    before = recordings(5, seed=1)
    after = recordings(4, lambda q, v, a, t: 0.3 * np.sign(v), seed=2)
    side = before if moved == "baseline" else after
    side[1] = replace(side[1], position_rad=side[1].position_rad + 6.0)
    change = explain_change(before, after, Joint())
    assert change.causes[0].effect == "coulomb"
    assert change.units == ((4, 4) if moved == "baseline" else (5, 3))


@pytest.mark.parametrize("own", [0.0, 0.6])
def test_the_baselines_own_line_tells_the_gear_that_nobody_has(own):
    change = change_of("tooth", known=False, own=own)
    first = change.causes[0]
    assert first.effect == "ripple"
    assert ("flexspline tooth damage" in first.interpretation) == bool(own)
    assert change.angle == ("motor" if own else "joint")
    assert (change.told is not None) == bool(own)
    if own:
        assert change.told.gear_ratio == pytest.approx(101.0, abs=1.0)


def test_friction_is_told_by_how_much_unless_healthy_sessions_differ_as_much():
    count = BASELINE + TARGET
    made = simulate(1, (), 0.0, cycles=2 * count, rate=250.0)
    # Most of the friction that there is.
    own = 5 * np.std(made.current) * np.sign(made.velocity)
    edges = np.linspace(0, own.size, count + 1).astype(int)
    for spread, told in ((0.03, pytest.approx(0.37, abs=0.04)), (0.25, None)):
        moved = [1 + spread * (-1) ** k for k in range(BASELINE)] + [1.4] * TARGET
        recordings = [
            Recording(
                f"s{k}",
                made.rate_hz,
                current_a=made.current[start:stop] + moved[k] * own[start:stop],
                position_rad=made.position[start:stop],
            )
            for k, (start, stop) in enumerate(pairwise(edges))
        ]
        change = friction_change(recordings[:BASELINE], recordings[BASELINE:], Joint())
        assert change == told
