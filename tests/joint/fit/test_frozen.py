"""A fitted model applied to other recordings as it is."""

from dataclasses import replace

import numpy as np
import pytest
from closing import joint_of, plain_fit, slow_stroke

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.explain.saturated import unnamed_library
from opamc_cli.joint.fit.frozen import Applied, apply_frozen, why_not_applied
from opamc_cli.joint.fit.model import Term, dataset_of, fit_terms
from opamc_cli.joint.motion.recordings import grouped_track
from opamc_cli.joint.motion.track import Joint
from opamc_cli.signal.motion.smoothing import widened

LIBRARY = built_in_library()


def track_of(recording):
    return grouped_track([recording], Joint())[0]


def test_a_model_says_of_its_own_recordings_what_it_said():
    recording = joint_of("cyclic", None)
    fitted = plain_fit(recording)
    applied = apply_frozen(track_of(recording), fitted.terms, fitted.coefficients)
    np.testing.assert_allclose(applied.residual_a, fitted.residual_a, atol=1e-12)


def test_corners_of_the_motion_count_as_in_the_fit():
    fitted = plain_fit(slow_stroke(0.5), ("gravity", "coulomb", "viscous"))
    applied = apply_frozen(track_of(slow_stroke(0.5)), fitted.terms, fitted.coefficients)
    known = fitted.judged
    rows = known.open | known.sealed
    np.testing.assert_array_equal(applied.judged & rows, rows)
    # A fit averages open and sealed samples apart, where nothing is sealed all are alike.
    half = fitted.dataset.fine.track.kernel.size // 2
    rows &= ~(widened(known.open, half) & widened(known.sealed, half))
    assert rows.any()
    np.testing.assert_allclose(applied.residual_a[rows], known.residual_a[rows], atol=1e-12)


def test_nothing_is_estimated():
    recording = joint_of("cyclic", None)
    fitted = plain_fit(recording)
    higher = replace(recording, current_a=recording.current_a + 0.5)
    before, after = (
        apply_frozen(track_of(one), fitted.terms, fitted.coefficients)
        for one in (recording, higher)
    )
    np.testing.assert_allclose(after.residual_a - before.residual_a, 0.5, atol=1e-6)
    assert after.rmse() == pytest.approx(np.hypot(0.5, before.rmse()), rel=0.02)
    assert after.r2() < before.r2() < 1


def test_terms_that_follow_the_load_are_applied_until_that_settles():
    def by_load(q, v, a, t):
        return np.abs(0.2 * a + np.sin(q) + 0.4 * np.cos(q)) * np.sign(v)

    recording = joint_of("cyclic", by_load, strength=15.0)
    track, grouping = grouped_track([recording], Joint())
    names = ("inertia", "gravity", "coulomb", "viscous")
    terms = (*(Term(LIBRARY[name], {}) for name in names),
             Term(LIBRARY["load_friction"], {"inertia_share": 1.0}))  # fmt: skip
    fitted = fit_terms(dataset_of(track, grouping), terms)
    applied = apply_frozen(track, terms, fitted.coefficients)
    rows = applied.judged
    np.testing.assert_allclose(applied.residual_a[rows], fitted.residual_a[rows], atol=2e-3)


def test_a_resonance_above_half_the_rate_is_not_applied():
    # As a filter it is unstable: currents of 1e224 A ended as a bug.
    track = track_of(joint_of("cyclic", None, rate=100.0))
    forms = {"order": 20.0, "direction": 1.0, "answer": 1.0}
    assert why_not_applied(Term(LIBRARY["ripple"], {**forms, "top_hz": 49.0}), track) is None
    said = why_not_applied(Term(LIBRARY["ripple"], {**forms, "top_hz": 125.7}), track)
    assert said == "it reaches up to 125.7 Hz, runs of 100 Hz to half of their rate"
    soft = Term(LIBRARY["elasticity"], {"resonance_hz": 50.0, "damping": 0.1})
    assert "50 Hz" in why_not_applied(soft, track)


def test_errors_are_of_moving_samples_that_are_clear_or_of_some_of_them():
    recording = joint_of("cyclic", None)
    # Over three samples there is nothing to average where the motion is not clear.
    track = replace(track_of(recording), kernel=np.ones(1))
    fitted = plain_fit(recording)
    half = np.arange(track.size) < track.size // 2
    clear = replace(track, clear=half)
    applied = apply_frozen(clear, fitted.terms, fitted.coefficients)
    np.testing.assert_array_equal(applied.judged, track.moving & half)
    few = np.zeros(track.size, dtype=bool)
    few[1000:1010] = True
    rest, current = applied.residual_a[1000:1010], track.current_a[1000:1010]
    assert applied.rmse(few) == pytest.approx(np.sqrt(np.mean(rest**2)))
    assert applied.r2(few) == pytest.approx(1 - np.mean(rest**2) / np.var(current))
    assert (applied.rmse(~half), applied.r2(~half)) == (0.0, 0.0)
    # Where nothing is clear, all that moves is judged.
    none = apply_frozen(replace(track, clear=~track.clear & False), fitted.terms,
                        fitted.coefficients)  # fmt: skip
    np.testing.assert_array_equal(none.judged, track.moving)


def test_nothing_is_explained_of_a_current_that_stays():
    track = track_of(joint_of("cyclic", None))
    steady = replace(track, current_a=np.full(track.size, 2.0))
    applied = Applied(steady, np.ones(track.size), steady.current_a, track.moving)
    assert (applied.rmse(), applied.r2()) == (1.0, 0.0)


def test_some_coefficients_mean_nothing_elsewhere():
    track = track_of(joint_of("cyclic", None))
    from_phases = replace(track, channels=track.channels - {"logged"})
    spring, load = Term(LIBRARY["spring"], {}), Term(LIBRARY["load_friction"], {})
    assert why_not_applied(spring, track) is None
    assert "not where it begins" in str(why_not_applied(spring, from_phases))
    assert why_not_applied(load, track) is None
    speed = Term(unnamed_library()["unnamed_speed"], {"degree": 2.0})
    assert "recordings that it was fitted to" in str(why_not_applied(speed, track))
    warm = Term(LIBRARY["thermal_viscous"], {"rate_per_c": 0.02})
    assert "no temperature" in str(why_not_applied(warm, track))
