"""Which of a recording's channels a map takes for which axis."""

from opamc_cli.storage.ingest.guess.channels import choose, time_channel
from opamc_cli.storage.ingest.guess.names import meanings
from opamc_cli.storage.ingest.source import Listed


def chosen(*names, counted=True, **wide):
    """Return {kind: {axis: channel}} and {kind: what was passed over}."""
    listed = [*map(Listed, names), *(Listed(name, width) for name, width in wide.items())]
    choices = choose(meanings(listed, counted))
    axes = {
        kind: {
            axis: c.source if c.index is None else (c.source, c.index)
            for axis, c in choice.by_axis.items()
        }
        for kind, choice in choices.items()
    }
    return axes, {kind: choice.passed_over for kind, choice in choices.items()}


def test_joints_keep_their_number_but_those_from_0_and_beyond_any_arms():
    for first, axis in ((0, 1), (1, 1), (4, 4), (30, 30), (31, 1)):
        numbers = range(first, first + 3)
        axes, _ = chosen(*(f"i_cur_{n}" for n in numbers), *(f"q_{n}" for n in numbers), "q_50")
        assert axes["current"] == {axis + k: f"i_cur_{n}" for k, n in enumerate(numbers)}
        # a position of no axis with a current is left out
        assert axes["position"] == {axis + k: f"q_{n}" for k, n in enumerate(numbers)}


def test_a_drives_parameters_are_channels_of_one_axis():
    names = "r0063 Drehzahlistwert", "r0078 Stromistwert", "r2521 Lageistwert"
    axes, _ = chosen(*names)
    assert axes == {"velocity": {1: names[0]}, "current": {1: names[1]}, "position": {1: names[2]}}


def test_the_measured_family_with_most_axes_wins():
    axes, over = chosen("target_cur_1", "target_cur_2", "cur_1", "mean_cur_1", "mean_cur_2")
    assert axes["current"] == {1: "mean_cur_1", 2: "mean_cur_2"}
    # what was wanted comes last, whatever it holds
    assert over["current"] == ("cur_#", "target_cur_#")
    # what says that it is actual goes first, then the shorter name
    axes, over = chosen("cur_1", "cur_2", "ActualCur_1", "CurMean_1")
    assert axes["current"] == {1: "ActualCur_1"}
    assert over["current"] == ("cur_#", "CurMean_#")
    assert chosen("cur_mean_1", "cur_1")[0]["current"] == {1: "cur_1"}


def test_axes_of_another_name_are_added():
    axes, over = chosen("cur_1", "cur_2", "ext_cur_3", "ext2_cur_2", "target_cur_4")
    assert axes["current"] == {1: "cur_1", 2: "cur_2", 3: "ext_cur_3"}
    assert over["current"] == ("ext2_cur_#", "target_cur_#")
    axes, over = chosen("cur_2", "cur_3", "ext_cur_1")
    assert axes["current"] == {1: "ext_cur_1", 2: "cur_2", 3: "cur_3"}
    # below the first there is no axis
    axes, over = chosen("cur_40", "cur_41", "ext_cur_2")
    assert axes["current"] == {1: "cur_40", 2: "cur_41"}
    assert over["current"] == ("ext_cur_#",)


def test_what_was_goes_before_what_was_wanted_and_other_names():
    for actual, other in (("act", "set"), ("ist", "soll"), ("fbk", "cmd"), ("meas", "raw")):
        for names in ((actual, other), (other, actual)):
            kinds = {"current": "Iq", "position": "pos", "velocity": "vel"}
            axes, _ = chosen(*(f"{k}_{w}_{n}" for k in kinds.values() for n in "12" for w in names))
            assert axes == {
                kind: {n: f"{short}_{actual}_{n}" for n in (1, 2)} for kind, short in kinds.items()
            }


def test_a_torque_stands_for_a_current_that_was_not_measured():
    assert chosen("tau_1", "target_cur_1")[0]["current"] == {1: "tau_1"}
    assert chosen("tau_1", "cur_1")[0]["current"] == {1: "cur_1"}
    assert "current" not in chosen("tau_1", "i_a", "i_b", "i_c")[0]


def test_a_motors_temperature_goes_before_a_drives():
    for name, other in (("MOTOR_TEMPERATURE", "TEMPERATURE"), ("temperature", "drive_temp")):
        axes, over = chosen("cur_1", other, name)
        assert (axes["temperature"], over["temperature"]) == ({1: name}, (other,))


def test_columns_of_a_wide_channel_are_axes_from_its_first():
    axes, _ = chosen("temp_1", "temp_2", motor_cur=2, q=3)
    assert axes["current"] == {1: ("motor_cur", 0), 2: ("motor_cur", 1)}
    # a joint beside, whose current was not logged
    assert axes["position"] == {k + 1: ("q", k) for k in range(3)}
    # where no current has a number in its name, others tell the lowest
    assert axes["temperature"] == {1: "temp_1", 2: "temp_2"}


def test_joints_without_numbers_are_axes_in_their_order_by_topic():
    joints = [f"/states/{joint}/effort" for joint in ("pan", "lift")]
    axes, over = chosen(*joints, "/more/states/pan/effort", counted=False)
    assert axes["current"] == {1: joints[0], 2: joints[1]}
    assert over["current"] == ("/more/states/pan/effort",)


def test_time_is_the_first_that_was_measured():
    meant = meanings([Listed("target_time"), Listed("cur_1"), Listed("t"), Listed("stamp")])
    assert time_channel(meant).source == "t"
    assert time_channel(meant[:2]) is None
