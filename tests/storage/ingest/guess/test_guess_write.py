"""Maps that are guessed for recordings, line by line."""

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
import scipy.io
from nptdms import ChannelObject, TdmsWriter

from opamc_cli.__main__ import main
from opamc_cli.errors import ConfigError, InputError
from opamc_cli.stages.recordings import ingest
from opamc_cli.storage.ingest.guess.write import guess_map
from opamc_cli.storage.ingest.map.load import load_map
from opamc_cli.storage.runs.run import Run


def table(path, columns, head="", separator=","):
    """Write columns by their names."""
    rows = np.column_stack(list(columns.values()))
    lines = [separator.join(f"{v:.14g}" for v in row) for row in rows]
    path.write_text(head + "\n".join([separator.join(columns), *lines]) + "\n")
    return path


def lines_of(*paths):
    """Return the lines of a map without its first, which names the file, and without the end."""
    lines = guess_map(list(paths)).splitlines()
    assert lines[0].startswith(f"# Guessed from {paths[0].name}. ")
    end = lines.index("metadata:")
    return [" ".join(line.split()) for line in lines[1:end]], lines[end:]


N = 400
T = np.arange(N) / 100
ANGLE = np.sin(2 * T)
SPEED = 2 * np.cos(2 * T)
METADATA = [
    "metadata:",
    "  robot:    # such as cell 7; runs of different robots are told apart",
    "  program:  # such as pick; runs of different programs are not compared",
]


def test_a_column_of_texts_that_names_the_program(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,prog,cur_1\n" + "".join(f"{t:g},P,{t:g}\n" for t in T))
    why = "its first row's; runs of different programs are not compared"
    assert f"  program: {{source: prog}}  # {why}" in lines_of(path)[1]


def test_columns_that_a_logger_keeps_for_what_it_lacks_are_not_taken(tmp_path):
    """Of a measured bench an empty phase and an empty speed were, beside those with numbers."""
    path = tmp_path / "bench.csv"
    head = "speed_setpoint_rpm,t_ms,rpm,i_dc_a,i_u_a,i_v_a,i_w_a,modbus_rpm\n"
    rows = [f"900,{10 * k},{900 + k % 7},{0.2 + 0.01 * (k % 5):.2f},,,,\n" for k in range(N)]
    path.write_text(head + "".join(rows))
    found = "\n".join(lines_of(path)[0])
    assert "axis1_current: {source: i_dc_a, unit: A}" in found
    assert "axis1_velocity: {source: rpm, unit: rpm} # as the file says" in found
    assert "i_u_a (empty), i_v_a (empty), i_w_a (empty)" in found


def test_one_joint_s_empty_column_stays_in_its_family(tmp_path):
    path = tmp_path / "arm.csv"
    rows = [f"{t:g},{s:g},,{s:g}\n" for t, s in zip(T, SPEED, strict=True)]
    path.write_text("t,cur_1,cur_2,motor_current\n" + "".join(rows))
    assert "  axis{n}_current: {source: cur_{n}, unit: A}" in guess_map([path])


def test_a_table_of_everything(tmp_path):
    columns = {
        "t": T,
        **{f"cur_{k}": 1.5 * SPEED for k in (1, 2)},
        "set_point": ANGLE,
        **{f"target_cur_{k}": SPEED for k in (1, 2)},
        **{f"q_{k}": np.degrees(ANGLE) for k in (1, 2)},
        "qd_1": np.degrees(SPEED),
        "temp_1": 31.4 + 0 * T,
        **{f"mode_{k}": 0 * T for k in range(3)},
    }
    lines, end = lines_of(table(tmp_path / "a.csv", columns, "a log\n", ";"))
    assert lines == [
        "format: csv",
        'separator: ";"',
        "header: true",
        "skip_rows: 1",
        "time: {source: t, unit: s} # steps of 0.01: 100 Hz, even",
        "columns:",
        "axis{n}_current: {source: cur_{n}, unit: A} # largest 3; not target_cur_#",
        "axis{n}_position: {source: q_{n}, unit: deg} "
        "# largest 57.3, by the range alone; its steps agree with the speed",
        "axis1_velocity: {source: qd_1, unit: deg/s} # largest 115; as the position",
        "axis1_temperature: {source: temp_1, unit: degC} # largest 31.4",
        "# not used: set_point, target_cur_#, mode_#",
    ]
    assert end == METADATA


def test_axes_that_no_number_counts_have_lines_of_their_own(tmp_path):
    names = {"t": T, "cur_1": SPEED, "cur_2": SPEED, "ext_cur_3": SPEED, "t2 temp_2": T}
    lines, _ = lines_of(table(tmp_path / "a.csv", names))
    assert lines[4:] == [
        "columns:",
        "axis1_current: {source: cur_1, unit: A} # largest 2",
        "axis2_current: {source: cur_2, unit: A} # largest 2",
        "axis3_current: {source: ext_cur_3, unit: A} # largest 2",
        "axis2_temperature: {source: t2 temp_2, unit: degC} # largest 3.99",
    ]
    names = {"t": T, **{f"cur_{k}": 70 * SPEED for k in (5, 6, 8)}, "ext_cur_7": SPEED}
    lines, _ = lines_of(table(tmp_path / "a.csv", names))
    assert lines[5:] == [
        "axis{n}_current: {source: cur_{n}, unit: mA} # largest 140: too many for amperes",
        "axis7_current: {source: ext_cur_7, unit: mA} # largest 140: too many for amperes",
    ]


def test_a_unit_with_a_stroke_is_no_nested_group(tmp_path):
    names = {"t": T, "IQ [A]": SPEED, "VX [cnt/s]": SPEED, "PX [cnt]": ANGLE}
    lines, _ = lines_of(table(tmp_path / "a.csv", names))
    assert lines[-1] == "# not used: VX [cnt/s], PX [cnt]"


def test_joints_keep_the_numbers_of_their_names_and_what_is_left_is_named(tmp_path):
    names = {"t": T, **{f"J{n}_cur": SPEED for n in (4, 6)}, **{f"q{n}": ANGLE for n in (3, 4)}}
    lines, _ = lines_of(table(tmp_path / "a.csv", names))
    assert lines[5:] == [
        "axis{n}_current: {source: J{n}_cur, unit: A} # largest 2",
        "axis4_position: {source: q4, unit: rad} # largest 1, by the range alone",
        "# not used: q3",
    ]
    # what {n} does not stand for has lines of its own
    lines, _ = lines_of(table(tmp_path / "a.csv", {"t": T, "cur_01": SPEED, "cur_02": SPEED}))
    assert [line.partition(",")[0] for line in lines[5:]] == [
        "axis1_current: {source: cur_01",
        "axis2_current: {source: cur_02",
    ]


def test_columns_of_one_name_and_files_of_one_joint_are_said(tmp_path):
    path = table(tmp_path / "n_axis1.csv", {"t": T, "I": SPEED, "I ": SPEED, "cur_3": SPEED})
    other = table(tmp_path / "n_axis2.csv", {"t": T, "cur_3": SPEED})
    lines, _ = lines_of(path)
    assert lines[5:] == [
        "axis3_current: {source: cur_3, unit: A} # largest 2",
        "# not used, for several columns have the name: I (1), I (2)",
    ]
    joints = "# the files seem to hold one joint each: give each a map with its axis"
    assert lines_of(path, other)[0][-1] == joints
    for name in ("n_axis2_b.csv", "m_axis1.csv", "n_axis1.txt"):
        assert joints not in lines_of(path, table(tmp_path / name, {"t": T, "cur_3": SPEED}))[0]


def test_units_that_a_file_declares_are_believed_and_decimal_commas_read(tmp_path):
    path = tmp_path / "a.csv"
    rows = "".join(
        f"{t:g};{i:.6f};{i:.6f};7\n".replace(".", ",") for t, i in zip(T, SPEED, strict=True)
    )
    path.write_text("t;cur_1;temp_1;q_9\n[ms];(mA);[V];rad\n" + rows, encoding="utf-16")
    lines, _ = lines_of(path)
    assert lines[2:] == [
        'decimal: ","',
        "header: true",
        "units_rows: 1",
        "encoding: utf-16",
        "time: {source: t, unit: ms} # as the file says: 100000 Hz, even",
        "columns:",
        "axis1_current: {source: cur_1, unit: mA} # as the file says; largest 2",
        "axis1_temperature: {source: temp_1, unit: degC} # largest 2",
        "# not used: q_#",
    ]


def test_tenths_of_a_degree_are_scaled(tmp_path):
    time = np.arange(200) / 100
    angle = 300 * np.sin(3 * time)
    rows = [f"{t:.2f},{a:.0f},{t}" for t, a in zip(time, angle, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["time [s],position [0.1 deg],current [A]", *rows]))
    assert "unit: deg, scale: 0.1}  # as the file says" in guess_map([path])


def test_per_cent_of_what_the_file_does_not_tell_is_left_open_and_refused(tmp_path, capsys):
    path = table(tmp_path / "a.csv", {"t": T, "J1 Torque %": SPEED, "J2 Torque %": SPEED})
    (line,) = [one for one in lines_of(path)[0] if "Torque" in one]
    assert line == (
        'axis{n}_current: {source: "J{n} Torque %", unit: "%"} # largest 2; per cent of a rated '
        "torque that the file does not tell: write unit: Nm, scale: rated / 100"
    )
    guessed = tmp_path / "map.yaml"
    guessed.write_text(guess_map([path]))
    with pytest.raises(ConfigError, match=r"unit is '%'; .*for per cent write A or Nm and scale"):
        load_map(guessed)
    guessed.write_text(guess_map([path]).replace('unit: "%"', "unit: A, scale: 0.01"))
    (found,) = ingest.run([path], load_map(guessed), tmp_path / "out").results
    read = Run(found.run).read(["axis2_current"])["axis2_current"]
    assert read == pytest.approx(0.01 * SPEED)


def test_a_temperature_of_no_joint_is_of_no_sensor(tmp_path):
    temperatures = {"temp_1": 31.4 + 0 * T, "temp_2": -3276.8 + 0 * T, "temp_3 [K]": 0 * T - 1}
    columns = {"t": T, **{f"cur_{n}": SPEED for n in (1, 2, 3)}, **temperatures}
    lines, _ = lines_of(table(tmp_path / "a.csv", columns))
    assert lines[-2:] == [
        "axis1_temperature: {source: temp_1, unit: degC} # largest 31.4",
        "# not used: temp_2 (below -60 or above 250 °C: another unit, or no sensor?), "
        "temp_3 [K] (below -60 or above 250 °C: another unit, or no sensor?)",
    ]


def test_dates_are_a_clock_and_a_start(tmp_path):
    path = tmp_path / "a.csv"
    dates = np.datetime64("2026-03-01T08:00:00.000") + (10 * np.arange(N)).astype("m8[ms]")
    rows = "".join(f"{d},{v:.6f}\n" for d, v in zip(dates, SPEED, strict=True))
    path.write_text("when,cur_1\n" + rows)
    lines, end = lines_of(path)
    assert lines[3] == "time: {source: when, unit: iso8601} # dates: 100 Hz, even"
    assert end == [*METADATA, "  started_at: {source: when}"]


@pytest.mark.parametrize(("start", "known"), [(1e8, False), (1.7e9, True)])
def test_seconds_since_1970_tell_the_start(tmp_path, start, known):
    _, end = lines_of(table(tmp_path / "a.csv", {"t": start + T, "cur_1": SPEED}))
    assert end == [*METADATA, *(["  started_at: {source: t}"] if known else [])]


def test_counted_samples_have_the_rate_at_which_angle_and_speed_agree(tmp_path):
    columns = {"t": np.arange(N), "cur_1": SPEED, "q_1": ANGLE, "qd_1": SPEED}
    lines, _ = lines_of(table(tmp_path / "a.csv", columns))
    assert lines[3:5] == [
        "time: {source: t, unit: samples} # counts rows",
        "sampling_rate_hz: 100 # at this rate the positions agree with the speeds",
    ]
    assert "its steps agree with the speed" in lines[7]
    del columns["qd_1"]
    lines, _ = lines_of(table(tmp_path / "a.csv", columns))
    assert lines[4] == "sampling_rate_hz: # write how many samples make a second"
    del columns["t"]
    lines, _ = lines_of(table(tmp_path / "a.csv", columns))
    assert lines[3] == "sampling_rate_hz: # no channel tells it: write the samples per second"


def test_clocks_that_differ_end_at_one_rate_or_are_told(tmp_path):
    def log(name, rate, late=0.0):
        times = (np.arange(N) + late * (np.arange(N) % 2) * (np.arange(N) < N - 1)) / rate
        return table(tmp_path / name, {"t": times, "cur_1": SPEED})

    even = log("even.csv", 100)
    lines, _ = lines_of(even, log("same.csv", 100))
    assert lines[3:5] == ["time: {source: t, unit: s} # steps of 0.01: 100 Hz, even", "columns:"]
    lines, _ = lines_of(even, log("b.csv", 101), log("c.csv", 104))
    assert lines[4] == (
        "resample_hz: 101 # 100 to 104 Hz in 3 recordings; runs of one rate can be compared"
    )
    lines, _ = lines_of(even, log("d.csv", 109.9))
    assert lines[4].startswith("resample_hz: 105 # 100 to 109.9 Hz in 2 recordings")
    lines, _ = lines_of(even, log("e.csv", 110.1))
    assert lines[4] == "# rates differ from 100 to 110.1 Hz: too much for one"
    lines, _ = lines_of(log("late.csv", 100, late=0.3))
    assert lines[3].endswith(": 100 Hz, uneven by up to 3 ms")
    assert lines[4].startswith("resample_hz: 100 # an uneven clock is another one in every rec")


def test_a_map_for_fewer_currents_than_positions_is_one_that_works(tmp_path):
    columns = {
        "t": T,
        **{f"q{k}": k * ANGLE for k in (1, 2, 3)},
        **{f"cur{k}": k * SPEED for k in (1, 2)},
    }
    path = table(tmp_path / "a.csv", columns)
    (tmp_path / "map.yaml").write_text(guess_map([path]))
    with pytest.raises(SystemExit) as stopped:
        main(["ingest", str(path), "--map", str(tmp_path / "map.yaml"), "--out", str(tmp_path)])
    assert not stopped.value.code
    names = set(pq.read_schema(tmp_path / "a.parquet").names)
    assert names == {
        *(f"axis{n}_current" for n in (1, 2)),
        *(f"axis{n}_position" for n in (1, 2, 3)),
    }


def test_three_columns_without_names_are_phases_if_they_behave_so(tmp_path):
    path = tmp_path / "a.csv"
    phases = np.cos(40 * T[:, None] - np.arange(3) * 2 * np.pi / 3)
    np.savetxt(path, phases, delimiter=",")
    lines, _ = lines_of(path)
    assert lines[2:] == [
        "header: false",
        "sampling_rate_hz: # no channel tells it: write the samples per second",
        "columns:",
        *(f"axis1_{p}: {{source: {k}, unit: A}} # largest 1" for k, p in enumerate("abc")),
    ]
    for others in (phases[:, :2], phases[:, [0, 1, 1]], np.column_stack([phases, T])):
        np.savetxt(path, others, delimiter=",")
        with pytest.raises(InputError, match="no channel looks like a motor current"):
            guess_map([path])


@pytest.mark.parametrize("name", ["q_#", "arm/q_#"])
def test_positions_without_a_current_are_answered_with_what_is_there(name, tmp_path):
    columns = {"t": T} | {name.replace("#", k): SPEED for k in "12"}
    with pytest.raises(InputError, match=rf"no channel looks like a motor current .*{name}.*hand"):
        guess_map([table(tmp_path / "a.csv", columns)])


def test_a_motors_own_words_are_known(tmp_path):
    """As of a humanoid's joint."""
    columns = {"t": T, "motor/pos": ANGLE, "motor/vel": SPEED, "motor/tor": 3 * SPEED}
    lines, _ = lines_of(table(tmp_path / "a.csv", columns))
    assert [line.split(",")[0] for line in lines[4:] if "axis1" in line] == [
        "axis1_current: {source: motor/tor",
        "axis1_position: {source: motor/pos",
        "axis1_velocity: {source: motor/vel",
    ]


@pytest.mark.parametrize(("scale", "said"), [(700, False), (725, True), (5440, True)])
def test_a_position_of_many_turns_is_said_to_be_the_motors(tmp_path, scale, said):
    columns = {"t": T, "A1.I_eff [A]": SPEED, "A1.phi_mot [deg]": scale * ANGLE}
    lines, _ = lines_of(table(tmp_path / "a.csv", columns, separator=";"))
    (line,) = [line for line in lines if line.startswith("axis1_position")]
    assert line.endswith(" turns; a motor's needs scale: 1 / gear ratio") is said
    assert "unit: deg" in line


def test_an_encoding_that_is_given_is_taken(tmp_path, capsys):
    path = tmp_path / "a.csv"
    rows = "".join(f"{t:g},{i:.6f}\n" for t, i in zip(T, SPEED, strict=True))
    path.write_text("t,電流1軸[A]\n" + rows + "4.0", encoding="shift_jis")
    with pytest.raises(SystemExit) as stopped:
        main(["ingest", str(path), "--guess", "--set", "encoding=shift_jis"])
    assert not stopped.value.code
    printed = capsys.readouterr().out
    assert "encoding: shift_jis" in printed
    assert 'axis1_current: {source: "電流1軸[A]", unit: A}' in printed
    for wrong in ("encoding=klingon", "separator=;"):
        with pytest.raises(SystemExit) as stopped:
            main(["ingest", str(path), "--guess", "--set", wrong])
        assert stopped.value.code == 2


def test_currents_that_lost_their_sign_get_it_back(tmp_path):
    current = np.round(-3000 * SPEED)
    path = table(tmp_path / "a.csv", {"t": T, "cur_1": np.mod(current, 65536)})
    (line,) = [one for one in lines_of(path)[0] if "cur_1" in one]
    assert "unit: mA, unwrap: 65536}" in line
    assert line.endswith("for amperes; negative numbers are 65536 too large")
    guessed = tmp_path / "map.yaml"
    guessed.write_text(guess_map([path]))
    (found,) = ingest.run([path], load_map(guessed), tmp_path / "out").results
    read = Run(found.run).read(["axis1_current"])["axis1_current"]
    assert read == pytest.approx(current / 1000)


def _with_a_rate(kind, path, rate_hz):
    """Write one current and its position, and beside them how many samples make a second."""
    t = np.arange(4000) / rate_hz
    i, q = 2 * np.sin(7 * t), np.cos(t)
    if kind == "tdms":
        step = {"wf_increment": 1 / rate_hz, "wf_start_offset": 0.0}
        with TdmsWriter(path) as writer:
            named = (("axis1_current", i), ("axis1_position", q))
            writer.write_segment([ChannelObject("drive", name, x, step) for name, x in named])
        return
    if kind == "mat":
        content = {"axis1_current": i, "axis1_position": q, "Fs": rate_hz}
        scipy.io.savemat(path, {"log": content})
        return
    with h5py.File(path, "w") as file:
        file["drive/axis1_current"], file["drive/axis1_position"] = i, q
        if kind == "attribute":
            file["drive"].attrs["Sample rate [Hz]"] = rate_hz
        else:
            file["sampling_rate"] = rate_hz


@pytest.mark.parametrize("kind", ["tdms", "mat", "attribute", "dataset"])
def test_a_rate_that_the_file_declares_is_pointed_to_and_each_file_tells_its_own(kind, tmp_path):
    ending = kind if kind in ("tdms", "mat") else "h5"
    paths = [tmp_path / f"{name}.{ending}" for name in ("one", "two")]
    for path, rate_hz in zip(paths, (500.0, 1000.0), strict=True):
        _with_a_rate(kind, path, rate_hz)
    guessed = tmp_path / "map.yaml"
    guessed.write_text(guess_map(paths))
    assert "# 500 Hz in one" in guessed.read_text()
    found = ingest.run(paths, load_map(guessed), tmp_path / "out")
    assert not found.errors
    assert [one.sampling_rate_hz for one in found.results] == pytest.approx([500.0, 1000.0])


def test_channels_of_two_rates_have_none_that_could_be_pointed_to(tmp_path):
    path = tmp_path / "r.tdms"
    x = np.sin(np.arange(4000) / 9)
    named = (("axis1_current", 1e-3), ("axis1_position", 2e-3))
    with TdmsWriter(path) as writer:
        writer.write_segment(
            [ChannelObject("drive", name, x, {"wf_increment": step}) for name, step in named]
        )
    assert "sampling_rate_hz:  #" in guess_map([path])


@pytest.mark.parametrize(
    ("columns", "line"),
    [
        # a servo's snapshots, `host_ms`: "no channel tells it: write the samples per second"
        (
            {"host_ms": 10 * T * 100},
            "time: {source: host_ms, unit: ms} # steps of 10: 100 Hz, even",
        ),
        # another that only its unit tells, and how long a loop took
        (
            {"loop_us": 900 + 50 * ANGLE, "t": T},
            "time: {source: t, unit: s} # steps of 0.01: 100 Hz, even",
        ),
        (
            {"loop_us": 900 + 50 * ANGLE},
            "sampling_rate_hz: # no channel tells it: write the samples per second",
        ),
    ],
)
def test_a_clock_whose_unit_alone_tells_that_it_is_one(tmp_path, columns, line):
    path = table(tmp_path / "a.csv", {**columns, "pos": ANGLE, "cur": SPEED})
    assert line in lines_of(path)[0]
