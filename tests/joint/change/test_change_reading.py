"""What lines over the motor angle and over time mean."""

from types import SimpleNamespace

import numpy as np
import pytest

from opamc_cli.joint.change.lines import Line
from opamc_cli.joint.change.reading import read_frequency, read_lines
from opamc_cli.joint.motion.track import Joint


def track_of(kind="motor", ratio=100.0, poles=5, *channels):
    return SimpleNamespace(
        angle_kind=kind,
        joint=Joint(ratio, poles),
        order_resolution=2 * np.pi / 400.0,
        channels=frozenset(channels),
    )


MOTOR = track_of()


def line(order, error=0.001, growth=40.0, new=True):
    return Line(order, error, new, growth, excess=1.0, p_value=1e-6)


@pytest.mark.parametrize(
    ("found", "resolution", "order", "says", "ties"),
    [
        ([line(2.021)], 0.02, 2.02, "inspect the flexspline", 0),
        ([line(2.021)], 0.08, 2.02, "inspect the flexspline", 1),
        ([line(2.0)], 0.02, 2.0, "kinematic error", 1),
        ([line(3.3), line(4.04), line(6.06), line(8.08)], 0.03, 2.02, "flexspline", 0),
        ([line(3.3)], 0.03, 3.3, "unknown periodic source", 0),
        # The third harmonic alone, which turns with the flexspline; and a whole order like it.
        ([line(6.06)], 0.04, 2.02, "inspect the flexspline", 1),
        ([line(6.0)], 0.04, 6.0, "unknown periodic source", 0),
        ([line(7.0)], 0.03, 7.0, "unknown periodic source", 0),
    ],
)
def test_lines_are_read_in_the_frame_that_they_can_be_told_to_turn_in(
    found, resolution, order, says, ties
):
    reading = read_lines(found, MOTOR, resolution)
    assert reading.effect == "ripple"
    assert reading.parameters["order"] == pytest.approx(order)
    assert says in reading.interpretation
    assert len(reading.ties) == ties
    assert reading.kind in ("mesh", "unknown")


def test_a_planetary_gear_has_no_flexspline():
    reading = read_lines([line(2.0), line(4.0), line(6.0)], track_of(ratio=9.0), 0.02)
    assert reading.kind == "unknown"
    assert "flexspline" not in reading.interpretation


def test_what_was_measured_is_told_with_its_error():
    strong, harmonic = line(2.02, 0.003, 9.0), line(4.04, growth=30.0)
    reading = read_lines([strong, harmonic, line(3.3)], MOTOR, 0.02)
    assert reading.lines == (strong, harmonic)
    assert reading.evidence == {
        "measured_order": pytest.approx(2.02),
        "order_error": pytest.approx(np.sqrt(0.003**2 + 0.005**2)),
        "order_resolution": 0.02,
        "power_ratio": 30.0,
    }
    assert reading.fundamental == reading.parameters["order"]
    alone = read_lines([line(3.3, 0.004)], MOTOR, 0.03)
    assert alone.evidence["measured_order"] == 3.3
    assert alone.evidence["order_error"] == pytest.approx(np.sqrt(0.004**2 + 0.0075**2))
    assert (alone.fundamental, alone.kind) == (3.3, "unknown")


def test_without_a_gear_ratio_the_order_is_as_measured():
    reading = read_lines([line(2.021)], track_of(ratio=None), 0.02)
    assert reading.kind == "mesh"
    assert reading.parameters["order"] == pytest.approx(2.021)
    # What only a ratio would tell from the motor's own orders is not the mesh's.
    assert read_lines([line(6.06)], track_of(ratio=None), 0.04).kind != "mesh"
    # Up to the smallest gear ratio, 30, a line may be twice per turn: and at a side of it.
    assert read_lines([line(2.06)], track_of(ratio=None), 0.01).kind == "mesh"
    assert read_lines([line(2.2)], track_of(ratio=None), 0.01).kind != "mesh"


def test_lines_beside_the_passage_belong_to_it_within_four_resolutions():
    near, far = line(2.05), line(2.08)
    reading = read_lines([line(2.02), near, far, line(4.2)], MOTOR, 0.01)
    assert reading.lines == (line(2.02), near)


def test_a_weaker_passage_needs_a_comb():
    strange = line(3.3)
    assert read_lines([strange, line(2.02)], MOTOR, 0.03).kind != "mesh"
    assert read_lines([strange, line(2.02), line(4.04)], MOTOR, 0.03).kind != "mesh"
    assert read_lines([strange, line(2.02), line(4.04), line(6.06)], MOTOR, 0.03).kind == "mesh"
    # Odd multiples are the motor's as well: they are no passage, but in the comb.
    assert read_lines([strange, line(3.0), line(5.0), line(7.0)], MOTOR, 0.03).kind != "mesh"


@pytest.mark.parametrize("poles", [2, 4, 12])
def test_over_the_electrical_angle_pole_pairs_are_tried(poles):
    reading = read_lines([line(2.02 / poles)], track_of("electrical", poles=None), 0.02 / poles)
    assert reading.kind == "mesh"
    assert f"if it has {poles} pole pairs" in reading.interpretation
    assert reading.parameters["order"] == pytest.approx(2.02 / poles)
    assert reading.evidence["measured_order"] == pytest.approx(2.02 / poles)


def test_over_the_joint_angle_or_far_from_two_per_turn_no_mesh_is_told():
    assert read_lines([line(2.02)], track_of("joint"), 0.02).kind != "mesh"
    # 1.9 and 2.1 per turn are too far from 2 for every number of pole pairs.
    for order in (0.13, 1.9 / 2, 2.1 / 2):
        assert read_lines([line(order)], track_of("electrical", poles=None), 0.02).kind != "mesh"


@pytest.mark.parametrize(
    ("order", "effect"),
    [(5.0, "sensor_offset"), (10.0, "sensor_gain"), (30.0, "dead_time"), (30.02, "dead_time")],
)
def test_an_electrical_order_of_phases_is_the_current_measurement_s(order, effect):
    reading = read_lines([line(order), line(2.02)], track_of("motor", 100.0, 5, "phases"), 0.04)
    assert (reading.effect, reading.ties) == (effect, ("ripple",))
    assert reading.kind != "mesh"
    assert "not the gear" in reading.interpretation
    assert reading.parameters == {"order": order}
    # Of a signed current it is a ripple, and no other effect's.
    alone = read_lines([line(order), line(2.02)], MOTOR, 0.04)
    assert (alone.effect, alone.ties) == ("ripple", ())
    assert alone.kind != "mesh"
    assert "electrical," in alone.interpretation


@pytest.mark.parametrize(
    ("hz", "named"), [(50.4, 50.0), (49.6, 50.0), (60.2, 60.0), (100.0, 100.0), (359.8, 360.0)]
)
def test_a_frequency_within_a_resolution_of_the_mains_is_hum(hz, named):
    reading = read_frequency(line(hz, growth=7.0), 0.5)
    assert (reading.effect, reading.kind) == ("mains_hum", "mains")
    assert reading.parameters == {"frequency_hz": named}
    assert reading.fundamental == hz
    assert reading.evidence == {
        "measured_frequency_hz": hz,
        "frequency_resolution_hz": 0.5,
        "power_ratio": 7.0,
    }


def test_any_other_frequency_is_nobody_s():
    assert read_frequency(line(50.6), 0.5) is None
    assert read_frequency(line(49.4), 0.5) is None
    assert read_frequency(line(420.0), 0.5) is None


@pytest.mark.parametrize(
    ("order", "says"),
    [
        (10.02, "electrical, 2p"),
        (9.98, "electrical, 2p"),
        (10.035, "unknown"),  # farther than three quarters of a resolution
    ],
)
def test_an_order_is_read_as_the_nearest_that_has_a_meaning(order, says):
    reading = read_lines([line(order)], track_of(ratio=None), 0.04)
    assert says in reading.interpretation
    assert reading.parameters == {"order": order}


@pytest.mark.parametrize(
    ("poles", "twice", "multiples", "says"),
    [
        (5, 2.02, (2, 3, 4, 5), "inspect the flexspline (order 2.02 per motor turn if it has 5"),
        (6, 2.0125, (4, 5, 6, 7, 8), "2.013 per motor turn if it has 6 pole pairs"),
        (5, 2.0, (3, 4, 5), "(order 2 per motor turn if it has 5 pole pairs)"),
    ],
)
def test_over_the_electrical_angle_a_comb_need_not_show_its_first_line(
    poles, twice, multiples, says
):
    found = [line(k * twice / poles) for k in multiples]
    reading = read_lines([*found, line(0.13)], track_of("electrical", poles=None), 0.02)
    assert (reading.kind, len(reading.lines)) == ("mesh", len(multiples))
    assert says in reading.interpretation
    assert reading.evidence["measured_order"] == pytest.approx(twice / poles, rel=1e-3)


@pytest.mark.parametrize(
    "orders", [(0.8, 1.2), (0.8, 1.6, 2.4), (2.08, 4.16, 0.09), (0.8, 1.3, 1.7)]
)
def test_two_lines_even_multiples_or_a_bearing_s_are_no_comb(orders):
    found = [line(order) for order in orders]
    assert read_lines(found, track_of("electrical", poles=None), 0.02).kind != "mesh"


def test_a_joint_s_or_an_electrical_order_is_told_as_it_is():
    text = read_lines([line(2.02)], track_of("joint"), 0.02).interpretation
    assert "order 2.02 per joint" in text
    text = read_lines([line(0.13)], track_of("electrical", poles=None), 0.02).interpretation
    assert "order 0.13 per electrical" in text


def test_a_bearing_of_the_wave_generator_has_odd_lines_two_apart():
    found = [line(4.0, new=False), line(9.62), line(11.61), line(7.6)]
    reading = read_lines(found, MOTOR, 0.1)
    assert reading.kind == "bearing"
    assert "9.62 rolling elements" in reading.interpretation
    assert reading.parameters["order"] == 9.62
    # Not where the baseline has the stronger one, nor by another angle than the motor's.
    assert read_lines([line(9.62, new=False), line(11.61)], MOTOR, 0.1).kind == "unknown"
    assert read_lines([line(9.62), line(11.61)], track_of("joint"), 0.1).kind == "unknown"


def test_what_the_phases_sensors_have_is_no_passage_of_the_mesh():
    found = [line(1.0), line(4.0)]
    assert read_lines(found[1:], track_of("motor", None, 4, "phases"), 0.1).kind != "mesh"
    assert read_lines(found[1:], track_of("motor", None, 5, "phases"), 0.1).kind == "mesh"
    assert read_lines([line(2.0)], track_of("motor", None, 2, "phases"), 0.1).kind == "mesh"
