"""What names of channels mean, over names that loggers write."""

import pytest

from opamc_cli.storage.ingest.guess.names import Meant, meanings
from opamc_cli.storage.ingest.source import Listed

KNOWN = {
    "current": "i1 cur_1 curr_1 current_1 motor_currents_1 Iq1 amp_1 amps_1 ampere_1 A1_Strom_1 "
    "Stromistwert_1",
    "torque": "torque_1 torques_1 effort_1 tau_1 moment_1 JointTrq1",
    "position": "pos_1 ActualPosition1 positions_1 angle_1 angles_1 q_1 phi_1 theta_1 enc_1 "
    "Lage_1 IstWinkel_1",
    "velocity": "vel_1 velocity_1 velocities_1 speed_1 speeds_1 qd_1 dq_1 omega_1 qdot_1 "
    "Drehzahl_1",
    "temperature": "motor_temp_1 temps_1 temperature_1 temperatures_1 Temperatur_1",
    "time": "time timestamp timestamps stamp t clock Zeit ts epoch epoch_ms",
}
WANTED = (
    "target command commanded cmd cmptd computed desired des setpoint ref reference limit error "
    "sm model std planned nominal set soll sollwert"
)
ELSEWHERE = "mm tcp tool gripper base cartesian flange io voltage"


def only(name, **listed):
    (found,) = meanings([Listed(name, **listed)])
    return found


@pytest.mark.parametrize(
    ("quantity", "name"), [(q, name) for q, names in KNOWN.items() for name in names.split()]
)
def test_names_of_a_quantity(quantity, name):
    found = only(name)
    assert (found.quantity, found.measured) == (quantity, True)
    assert found.number == (None if quantity == "time" else 1)


def test_an_angle_by_the_unit_at_the_end_of_its_name():
    found = only("J1_act_deg")
    assert (found.quantity, found.number, found.unit) == ("position", 1, "deg")
    assert only("J1_vel_rad").quantity == "velocity"
    assert meanings([Listed("deg"), Listed("_deg"), Listed("J1_tcp_deg")]) == []


def test_what_a_controller_wanted_is_not_measured():
    assert [w for w in WANTED.split() if only(f"{w}_q_1").measured] == []
    assert [w for w in ELSEWHERE.split() if meanings([Listed(f"{w}_q_1")])] == []
    assert meanings([Listed("runtime_state"), Listed("q_«n»"), Listed(3)]) == []


@pytest.mark.parametrize(
    ("name", "phase"),
    [
        ("I_u", "a"),
        ("i2_v", "b"),
        ("Current W", "c"),
        ("axis1_current_a", "a"),
        ("Phase-B", "b"),
        ("ph.c", "c"),
        ("cur_a", "a"),
        ("drive ia_b", "b"),
        ("joint 3 is_c", "c"),
    ],
)
def test_phases_by_their_letter_where_all_three_are_there(name, phase):
    others = [Listed(f"{name[:-1]}{letter}") for letter in ("abc" if phase in "abc" else "uvw")]
    assert phase in {found.quantity for found in meanings([Listed(name), *others])}
    # alone it is a unit: ampere
    assert only(name).quantity == "current"


def test_the_last_number_counts_axes_unless_names_are_joints():
    assert only("robot2_q_13_rad") == Meant(
        "position", 13, "robot2_q_#_rad", "robot2_q_13_rad", None, True, "rad"
    )
    (joint,) = meanings([Listed("wrist_1/effort", unit="Nm")], counted=False)
    assert joint == Meant("torque", None, "wrist_1/effort", "wrist_1/effort", None, True, "Nm")


def test_columns_of_one_channel_are_axes_and_dates_are_time():
    found = meanings([Listed("target_q", width=2, unit="deg"), Listed("when", dates=True)])
    assert found == [
        Meant("position", 0, "target_q", "target_q", 0, False, "deg"),
        Meant("position", 1, "target_q", "target_q", 1, False, "deg"),
        Meant("time", None, "when", "when", None, True, None),
    ]
    assert meanings([Listed("time", width=2), Listed("tcp_pose", width=6)]) == []


def test_a_unit_in_brackets_at_the_end_of_a_name_is_its_unit_and_no_word_of_it():
    found = [only(n) for n in ("J1 Current [mA]", "q_1 (°)", "A1 Strom (A)", "time [ms]")]
    assert [(each.quantity, each.number, each.unit) for each in found] == [
        ("current", 1, "mA"),
        ("position", 1, "°"),
        ("current", 1, "A"),
        ("time", None, "ms"),
    ]
    assert only("current [1]").unit is None


def test_a_unit_that_is_counted_in_has_a_scale():
    names = ("motor_pos [0.1 deg]", "J1 current (1e-3 A)", "speed [1/min]")
    found = meanings([Listed(name) for name in names])
    assert [(one.quantity, one.unit, one.scale) for one in found] == [
        ("position", "deg", 0.1),
        ("current", "A", 1e-3),
        ("velocity", "1/min", 1.0),
    ]


def test_a_name_without_a_word_means_what_its_unit_is_one_of():
    found = [only(n) for n in ("A1.I_eff [A]", "A1 Ieff (mA)", "J2 Winkel [deg]", "n_3 [1/min]")]
    assert [(each.quantity, each.number) for each in found] == [
        ("current", 1),
        ("current", 1),
        ("position", 2),
        ("velocity", 3),
    ]
    # neither a torque nor a time is told by its unit: it may be of anything
    assert meanings([Listed("M_1 [Nm]"), Listed("x_1 [s]"), Listed("tool 1 [A]")]) == []


def test_a_drives_parameter_is_no_axis_and_a_setpoint_not_measured():
    names = ("r0078 Stromistwert momentenbildend [Aeff]", "r0062 Drehzahlsollwert [1/min]",
             "r2521 Lageistwert [LU]")  # fmt: skip
    found = meanings([Listed(name) for name in names])
    assert [(m.quantity, m.number, m.measured) for m in found] == [
        ("current", None, True),
        ("velocity", None, False),
        ("position", None, True),
    ]
    # of several alike the numbers count
    assert [m.number for m in meanings([Listed("cur_101"), Listed("cur_102")])] == [101, 102]


def test_per_cent_are_of_a_current_or_torque_and_no_motion():
    names = ("J1 Torque %", "A1 Strom [%]", "torque_pct_2", "CurrentPercent3", "J1 Torque [Nm] %")
    assert [only(name).unit for name in names] == ["%"] * 5
    assert only("current_1", unit="%").unit == "%"
    # a unit that the file declares is believed
    assert only("torque_percent_1", unit="Nm").unit == "Nm"
    assert meanings([Listed("speed_percent"), Listed("Override %"), Listed("J1 Pos %")]) == []


def test_an_odrive_counts_in_turns_unless_the_file_says_otherwise():
    names = ("ODrive 0 Position", "ODrive 0 Velocity", "odrv0.axis1.pos_estimate", "vel_estimate")
    assert [only(name).unit for name in names] == ["rev", "rev/s", "rev", "rev/s"]
    assert only("ODrive 0 Current").unit is None
    assert only("ODrive 0 Position [rad]").unit == "rad"
    assert only("Drive 0 Position").unit is None


def test_kukas_angles_are_degrees_and_its_currents_per_cent():
    found = only("$AXIS_ACT.A1")
    assert (found.quantity, found.number, found.unit) == ("position", 1, "deg")
    assert only("$TORQUE_AXIS_ACT[1]").quantity == "torque"
    assert only("$CURR_ACT[1]").unit == "%"
    assert meanings([Listed("$AXIS_ACT.E1"), Listed("$OV_PRO")]) == []  # an outer axis may be in mm
