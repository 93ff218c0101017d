"""Which periodic effect grew: over the angle, over time, or in the frame of the phases."""

from dataclasses import replace

import numpy as np
import pytest
from sessions import units_of

from opamc_cli.joint.change.periodic import find_periodic

SIZE = 0.1
RATIO, POLES = 50.0, 4


@pytest.fixture(scope="module")
def units():
    return units_of(before=3, after=2, rate=500.0)


def residuals(units, wave):
    rng = np.random.default_rng(0)
    return [
        np.where(
            unit.fine_rows,
            0.02 * rng.normal(size=unit.fine.size) + unit.after * SIZE * wave(unit.fine),
            0.0,
        )
        for unit in units
    ]


def found(units, wave, between=0.0):
    return find_periodic(units, residuals(units, wave), between)


def test_noise_and_what_the_baseline_has_as_well_are_nothing(units):
    assert found(units, lambda track: 0.0) is None
    both = [np.where(unit.fine_rows, np.cos(3 * unit.fine.machine_angle_rad), 0) for unit in units]
    noise = residuals(units, lambda track: 0.0)
    assert find_periodic(units, [a + b for a, b in zip(both, noise, strict=True)]) is None


def test_a_tooth_of_the_flexspline_is_a_ripple_of_its_power(units):
    order = 2 * (RATIO + 1) / RATIO
    periodic = found(units, lambda track: np.cos(order * track.machine_angle_rad))
    assert periodic.reading.effect == "ripple"
    assert periodic.reading.mesh
    assert periodic.power == pytest.approx(SIZE**2 / 2, rel=0.15)
    # With an allowance for what sessions differ by it is there, too, if it is large.
    assert found(units, lambda track: np.cos(order * track.machine_angle_rad), 0.09) is not None


def test_a_line_that_no_part_has_is_a_ripple_without_a_meaning(units):
    periodic = found(units, lambda track: np.cos(3.37 * track.machine_angle_rad))
    assert (periodic.reading.effect, periodic.reading.known) == ("ripple", False)
    assert periodic.reading.parameters["order"] == pytest.approx(3.37, abs=0.05)
    assert periodic.power == pytest.approx(SIZE**2 / 2, rel=0.15)


@pytest.mark.parametrize(
    "mains_hz",
    [
        pytest.param(
            50.0,
            marks=pytest.mark.xfail(
                reason="at the speeds of this program it is at 4 per turn, as the mesh's line"
            ),
        ),
        60.0,
    ],
)
def test_a_line_that_keeps_its_frequency_is_hum(units, mains_hz):
    periodic = found(units, lambda track: np.cos(2 * np.pi * mains_hz * track.run_time_s))
    assert periodic.reading.effect == "mains_hum"
    assert periodic.reading.parameters == {"frequency_hz": mains_hz}
    assert periodic.power == pytest.approx(SIZE**2 / 2, rel=0.15)


def test_any_other_frequency_is_nobody_s(units):
    assert found(units, lambda track: np.cos(2 * np.pi * 72.0 * track.run_time_s)) is None


def from_phases(units):
    made = []
    for unit in units:
        field = POLES * RATIO * unit.fine.position_rad
        channels = unit.fine.channels | {"phases"}
        made.append(replace(unit, fine=replace(unit.fine, electrical_rad=field, channels=channels)))
    return made


def test_hum_of_one_phase_stands_still_in_the_phases_frame(units):
    def picked_up(track):
        field = POLES * RATIO * track.position_rad
        return np.cos(2 * np.pi * 50.0 * track.run_time_s) * np.cos(field)

    periodic = found(from_phases(units), picked_up)
    assert periodic.reading.effect == "mains_hum"
    assert periodic.reading.parameters == {"frequency_hz": 50.0}
    # Half of the square of one cosine, and half of the other's.
    assert periodic.power == pytest.approx(SIZE**2 / 4, rel=0.3)
    # Where the phases are not logged, nobody can turn it back.
    alone = found(units, picked_up)
    assert alone is None or alone.reading.effect != "mains_hum"


def test_a_ripple_is_no_hum_in_the_phases_frame(units):
    order = 2 * (RATIO + 1) / RATIO
    wave = lambda track: np.cos(order * track.machine_angle_rad)  # noqa: E731
    assert found(from_phases(units), wave).reading.effect == "ripple"


def test_strokes_that_are_too_short_tell_nothing(units):
    short = [
        replace(
            unit,
            fine=replace(unit.fine, machine_angle_rad=0.01 * unit.fine.machine_angle_rad),
        )
        for unit in units
    ]
    assert found(short, lambda track: np.cos(3 * track.machine_angle_rad)) is None


def test_another_frequency_of_one_phase_is_no_hum(units):
    def picked_up(track):
        field = POLES * RATIO * track.position_rad
        return np.cos(2 * np.pi * 72.0 * track.run_time_s) * np.cos(field)

    other = found(from_phases(units), picked_up)
    assert other is None or other.reading.effect != "mains_hum"


def test_hum_that_is_weaker_than_a_ripple_is_not_named_first(units):
    def both(track):
        field = POLES * RATIO * track.position_rad
        hum = np.cos(2 * np.pi * 50.0 * track.run_time_s) * np.cos(field)
        return 0.3 * hum + np.cos(2.04 * track.machine_angle_rad)

    assert found(from_phases(units), both).reading.effect == "ripple"
