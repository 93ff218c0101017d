"""Which periodic effect grew: over the angle, over time, or in the frame of the phases."""

import numpy as np
import pytest
from sessions import units_of, with_track

from opamc_cli.joint.change.lines import grown_lines, order_spectra
from opamc_cli.joint.change.periodic import find_periodic
from opamc_cli.joint.motion.track import Joint

SIZE = 0.1
RATIO, POLES = 50.0, 4


@pytest.fixture(scope="module")
def units():
    return units_of(before=3, after=2, rate=500.0)


ENDS = 40.0
"""Times a faint wave: a step as friction leaves where a stroke begins and ends."""


def residual(units, wave, everywhere=False):
    track = units.track
    noise = 0.02 * np.random.default_rng(0).normal(size=track.size)
    new = np.append(units.after | everywhere, False)[track.group]
    return np.where(units.dataset.fine.fit, noise + new * SIZE * wave(track), 0.0)


def found(units, wave, between=0.0, everywhere=False):
    readings = find_periodic(units, residual(units, wave, everywhere), between)
    return readings[0] if readings else None


def test_noise_and_what_the_baseline_has_as_well_are_nothing(units):
    assert found(units, lambda track: 0.0) is None
    assert found(units, lambda track: np.cos(3 * track.machine_angle_rad), 0.0, True) is None


def test_a_tooth_of_the_flexspline_is_a_ripple_of_its_power(units):
    order = 2 * (RATIO + 1) / RATIO
    one = found(units, lambda track: np.cos(order * track.machine_angle_rad))
    assert one.effect == "ripple"
    assert one.kind == "mesh"
    assert one.power == pytest.approx(SIZE**2 / 2, rel=0.15)
    # With an allowance for what sessions differ by it is there, too, if it is large.
    assert found(units, lambda track: np.cos(order * track.machine_angle_rad), 0.09) is not None


def test_a_line_that_no_part_has_is_a_ripple_without_a_meaning(units):
    one = found(units, lambda track: np.cos(3.37 * track.machine_angle_rad))
    assert (one.effect, one.kind) == ("ripple", "unknown")
    assert one.parameters["order"] == pytest.approx(3.37, abs=0.05)
    assert one.power == pytest.approx(SIZE**2 / 2, rel=0.15)


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
    one = found(units, lambda track: np.cos(2 * np.pi * mains_hz * track.run_time_s))
    assert one.effect == "mains_hum"
    assert one.parameters == {"frequency_hz": mains_hz}
    assert one.power == pytest.approx(SIZE**2 / 2, rel=0.15)


def test_any_other_frequency_is_nobody_s(units):
    assert found(units, lambda track: np.cos(2 * np.pi * 72.0 * track.run_time_s)) is None


def from_phases(units):
    track = units.track
    field = POLES * RATIO * track.position_rad
    return with_track(units, electrical_rad=field, channels=track.channels | {"phases"})


def test_hum_of_one_phase_stands_still_in_the_phases_frame(units):
    def picked_up(track):
        field = POLES * RATIO * track.position_rad
        return np.cos(2 * np.pi * 50.0 * track.run_time_s) * np.cos(field)

    one = found(from_phases(units), picked_up)
    assert one.effect == "mains_hum"
    assert one.parameters == {"frequency_hz": 50.0}
    # Half of the square of one cosine, and half of the other's.
    assert one.power == pytest.approx(SIZE**2 / 4, rel=0.3)
    # Where the phases are not logged, nobody can turn it back.
    alone = found(units, picked_up)
    assert alone is None or alone.effect != "mains_hum"


def test_a_ripple_is_no_hum_in_the_phases_frame(units):
    order = 2 * (RATIO + 1) / RATIO
    wave = lambda track: np.cos(order * track.machine_angle_rad)  # noqa: E731
    assert found(from_phases(units), wave).effect == "ripple"


def test_strokes_that_are_too_short_tell_nothing(units):
    short = with_track(units, machine_angle_rad=0.01 * units.track.machine_angle_rad)
    assert found(short, lambda track: np.cos(3 * track.machine_angle_rad)) is None


def test_another_frequency_of_one_phase_is_no_hum(units):
    def picked_up(track):
        field = POLES * RATIO * track.position_rad
        return np.cos(2 * np.pi * 72.0 * track.run_time_s) * np.cos(field)

    other = found(from_phases(units), picked_up)
    assert other is None or other.effect != "mains_hum"


def test_hum_that_is_weaker_than_a_ripple_is_not_named_first(units):
    def both(track):
        field = POLES * RATIO * track.position_rad
        hum = np.cos(2 * np.pi * 50.0 * track.run_time_s) * np.cos(field)
        return 0.3 * hum + np.cos(2.04 * track.machine_angle_rad)

    assert found(from_phases(units), both).effect == "ripple"


def faint(units, order):
    """Read a wave of the target that whole strokes do not show beside the steps at their ends."""
    track = units.track
    wave = residual(units, lambda track: np.cos(order * track.machine_angle_rad))
    ends = np.where(units.dataset.fine.fit, ENDS * SIZE * track.direction, 0.0)
    alone, hidden = (
        grown_lines(order_spectra(units, wave)),
        grown_lines(order_spectra(units, wave + ends)),
    )
    assert alone[0].order == pytest.approx(order, abs=0.02)
    assert not any(abs(line.order - order) < 0.1 for line in hidden)
    seen = grown_lines(order_spectra(units, wave + ends, tapered=True))
    assert seen[0].order == pytest.approx(order, abs=0.05)
    return find_periodic(units, wave + ends)


def test_a_tooth_may_be_as_faint_as_tapered_strokes_show_it(units):
    readings = faint(units, 4 * (RATIO + 1) / RATIO)
    assert [(one.effect, one.kind) for one in readings] == [("ripple", "mesh")]


def test_what_whole_strokes_show_is_read_from_both(units):
    wave = lambda track: np.cos(2 * (RATIO + 1) / RATIO * track.machine_angle_rad)  # noqa: E731
    readings = find_periodic(units, residual(units, wave))
    assert [one.kind for one in readings] == ["mesh", "mesh"]
    assert readings[0].evidence["power_ratio"] > 10


@pytest.mark.parametrize("poles", [5, 7])
def test_what_excuses_a_joint_has_to_stand_out_of_whole_strokes(units, poles):
    """In a worn joint's first night of `make demo-nightly` a sensor's zero was seen so faintly.

    It had grown 21 times, with p of 0.003, and made of a fault a change that nobody looks at.
    """
    field = poles * RATIO * units.track.position_rad
    channels = units.track.channels | {"phases"}
    joint = Joint(RATIO, poles)
    phases = with_track(units, electrical_rad=field, channels=channels, joint=joint)
    assert faint(phases, poles) == []
    alone = find_periodic(
        phases, residual(phases, lambda track: np.cos(poles * track.machine_angle_rad))
    )
    assert [one.effect for one in alone] == ["sensor_offset"]


def test_where_whole_strokes_show_nothing_a_faint_line_without_a_meaning_is_none(units):
    assert faint(units, 6.63) == []
