"""An axis of the baseline that cannot be judged is said to be one, with the true reason."""

import json

import numpy as np
import pytest
import recordings
from recordings import RATE_HZ, record

from opamc_cli.errors import ExitCode
from tests.marks import long

pytestmark = pytest.mark.usefixtures("undrawn")


def gone(columns):
    for name in "abc":
        columns.pop(f"axis2_{name}")


def dead(columns):
    for name in "abc":
        noise = np.random.default_rng(0).normal(size=len(columns["axis2_a"]))
        columns[f"axis2_{name}"] = (0.01 * noise).astype(np.float32)


def exchanged(columns):
    columns["axis2_a"], columns["axis2_b"] = columns["axis2_b"], columns["axis2_a"]


def one_phase(columns):
    columns.pop("axis2_b")
    columns.pop("axis2_c")


def hundredfold(columns):
    for name in "abc":
        columns[f"axis2_{name}"] *= np.float32(100)


def milliampere(columns):
    """Set more than any robot's joint takes: its motions are not even looked for."""
    for name in "abc":
        columns[f"axis2_{name}"] *= np.float32(1000)


def frozen(columns):
    half = len(columns["axis2_b"]) // 2
    columns["axis2_b"][half:] = columns["axis2_b"][half]


def inverted(columns):
    columns["axis2_c"] *= -1


def clipped(columns):
    for name in "abc":
        columns[f"axis2_{name}"] = np.clip(columns[f"axis2_{name}"], -2.5, 2.5)


def incomplete(columns):
    columns["axis2_b"][::10] = np.nan


def held(columns):
    for name in "abc":
        whole = columns[f"axis2_{name}"]
        columns[f"axis2_{name}"] = np.repeat(whole[::5], 5)[: whole.size]


def other_program(columns):
    for name in "abc":
        columns[f"axis2_{name}"] = np.roll(columns[f"axis1_{name}"], int(0.1 * RATE_HZ))


def faster(columns):
    """Run the whole program three per cent faster."""
    for name, values in columns.items():
        at = np.arange(0, values.size - 1, 1.03)
        columns[name] = np.interp(at, np.arange(values.size), values).astype(np.float32)


REASONS = {
    gone: "The target: it has no current of axis 2.",
    dead: "its sensor is dead",
    exchanged: "are two of its phases exchanged?",
    one_phase: "axis 2 is recorded as axis2_a, the baseline has axis2_a, axis2_b, axis2_c",
    hundredfold: "another unit (mA for A)?",
    milliampere: "another unit (mA for A)?",
    frozen: "axis2_b keeps one value from",
    inverted: "do not add up to zero",
    clipped: "is clipped in",
    incomplete: "axis2_b holds no number in 10% of the motion",
    held: "in other steps, or each value several times?",
    other_program: "fit no motion of the baseline's cycle",
}


def diagnose(opamc, baseline, target, out, *more):
    quickly = ("--set", "joint.explain=false")
    return opamc(
        "diagnose", "--baseline", baseline, "--target", target, "--out", out, *quickly, *more
    )


QUICK = (gone, dead, exchanged)
"""Of the rest `make test-all` has as much to say."""


@pytest.mark.parametrize(
    "wrong",
    [one if one in QUICK else long(one) for one in REASONS],
    ids=lambda wrong: wrong.__name__,
)
def test_a_joint_that_cannot_be_judged_is_never_passed_over(opamc, baseline, tmp_path, wrong):
    target = record(tmp_path / "tonight.parquet", 9, wrong)
    ended = diagnose(opamc, baseline, target, tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.NOT_ENOUGH_DATA
    assert "xis 2 not judged" in ended.out
    first, second = json.loads((tmp_path / "out" / "verdict.json").read_text())["axes"]
    assert first["state"] == "healthy"
    assert second["state"] == "insufficient-data"
    assert second["health_index"] is None
    assert REASONS[wrong] in " ".join(second["reasons"])


def one_infinite(columns):
    columns["axis2_b"][4321] = np.inf


def torn(columns):
    """Axis 2 alone has another temperature, as a sensor that is torn off tells it."""
    temperatures(columns)
    columns["axis2_temperature"][:] = -40.0


def temperatures(columns):
    for axis, warm in ((1, 31.0), (2, 35.0)):
        columns[f"axis{axis}_temperature"] = np.full_like(columns["axis1_a"], warm)


@pytest.mark.parametrize(
    ("wrong", "usual", "said"),
    [
        (one_infinite, lambda _: None, "1 sample of axis 2 is lost (no number"),
        (torn, temperatures, "the temperature of axis 2 has moved by -75 °C, the others by +0"),
    ],
)
def test_what_a_joint_is_judged_without_is_said_though_it_is_healthy(
    opamc, tmp_path, wrong, usual, said
):
    """One sample that is infinite and a broken thermistor passed without a word."""
    for seed in range(4):
        record(tmp_path / "normal" / f"{seed}.parquet", seed, usual)
    target = record(tmp_path / "tonight.parquet", 9, wrong)
    ended = diagnose(opamc, tmp_path / "normal", target, tmp_path / "out", "--quiet")
    assert (ended.code, said in ended.err) == (ExitCode.PARTIAL, True)
    target = record(tmp_path / "healthy.parquet", 9, usual)
    ended = diagnose(opamc, tmp_path / "normal", target, tmp_path / "again", "--quiet")
    assert (ended.code, ended.err) == (ExitCode.DONE, "")


def test_a_night_at_another_speed_is_not_judged(opamc, baseline, tmp_path):
    """Of virtual joints three per cent made a fault with p = 1e-224."""
    target = record(tmp_path / "tonight.parquet", 9, faster)
    ended = diagnose(opamc, baseline, target, tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.NOT_ENOUGH_DATA
    (sentence,) = ended.sentences
    assert "its motions last 0.97 times as long as the baseline's" in sentence
    assert "of another speed, or a clock or lost samples" in sentence


@pytest.mark.parametrize(
    "wrong", [long(hundredfold), frozen, long(one_phase)], ids=lambda w: w.__name__
)
def test_one_baseline_run_that_is_wrong_is_left_out_aloud(
    opamc, baseline, tonight, tmp_path, wrong
):
    odd = record(tmp_path / "odd.parquet", 5, wrong)
    ended = diagnose(opamc, baseline, tonight, tmp_path / "out", "--baseline", odd, "--quiet")
    assert ended.code == ExitCode.PARTIAL
    (sentence,) = ended.sentences
    assert sentence.startswith(f"opamc: {odd}: ")
    assert sentence.endswith(" Only axis 2 of this recording is left out")
    axes = json.loads((tmp_path / "out" / "verdict.json").read_text())["axes"]
    assert [axis["state"] for axis in axes] == ["healthy", "healthy"]
    assert [axis.get("not_compared") for axis in axes] == [None, {"baseline": ["odd"]}]


@pytest.mark.long
def test_one_baseline_run_at_another_speed_is_left_out_in_one_sentence(
    opamc, baseline, tonight, tmp_path
):
    odd = record(tmp_path / "odd.parquet", 5, faster)
    ended = diagnose(opamc, baseline, tonight, tmp_path / "out", "--baseline", odd, "--quiet")
    assert ended.code == ExitCode.PARTIAL
    (sentence,) = ended.sentences
    assert sentence.startswith(f"opamc: {odd}: its motions last 0.97 times as long")
    notes = json.loads((tmp_path / "out" / "verdict.json").read_text())["notes"]
    assert "of another speed, or a clock or lost samples, and left out: odd" in notes


def test_the_stage_alone_says_which_run_is_of_another_speed(opamc, baseline, tmp_path):
    odd = record(tmp_path / "odd.parquet", 5, faster)
    assert opamc("segment", baseline, odd, "--out", tmp_path / "out", "--quiet").code == 0
    ended = opamc("identify", "--out", tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.PARTIAL
    (sentence,) = ended.sentences
    assert sentence.startswith("opamc: odd: its motions last 0.97 times as long")


@pytest.mark.long
def test_a_recording_of_which_two_axes_are_wrong_is_not_said_to_lack_one_alone(
    opamc, baseline, tonight, tmp_path
):
    def both(columns):
        frozen(columns)
        columns["axis1_c"] *= -1

    odd = record(tmp_path / "odd.parquet", 5, both)
    ended = diagnose(opamc, baseline, tonight, tmp_path / "out", "--baseline", odd, "--quiet")
    assert ended.code == ExitCode.PARTIAL
    left_out = [f" Axis {axis} of this recording is left out" for axis in (1, 2)]
    assert [s.endswith(end) for s, end in zip(ended.sentences, left_out, strict=True)] == [True] * 2


@pytest.mark.long
def test_a_joint_is_missed_by_however_many_others(opamc, tmp_path, monkeypatch):
    """Three joints have siblings to be held against, two have not."""
    monkeypatch.setitem(recordings.MOTIONS, 3, ((48.0, 1.1, 1), (70.0, 1.2, -1)))
    for seed in range(3):
        record(tmp_path / "baseline" / f"{seed}.parquet", seed)
    target = record(tmp_path / "tonight.parquet", 9, gone)
    ended = diagnose(opamc, tmp_path / "baseline", target, tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.NOT_ENOUGH_DATA, ended.err
    assert "xis 2 not judged" in ended.out


@pytest.mark.long
def test_one_recording_of_another_program_is_not_the_reference_of_all_others(
    opamc, tmp_path, monkeypatch
):
    """It repeats its own cycle more often than the others do theirs."""
    for seed in range(4):
        record(tmp_path / "baseline" / f"{seed}.parquet", seed)
    target = record(tmp_path / "tonight.parquet", 9)
    another = {axis: ((30.0 + axis, 0.7, 1), (60.0, 0.5, 1)) for axis in (1, 2)}
    monkeypatch.setattr(recordings, "MOTIONS", another)
    stray = tmp_path / "baseline" / "stray.parquet"
    record(stray, 3, made=lambda seed: recordings.columns(seed, cycles=8), robot="R2")
    ended = diagnose(opamc, tmp_path / "baseline", target, tmp_path / "out")
    assert ended.code == ExitCode.PARTIAL, ended.err
    assert "Axes 1 and 2 healthy" in ended.out
    assert "robot differs: 0 has 'R1', stray 'R2'" in ended.err
    assert f"{stray}: all" in ended.err


# -- what a drive reports ----------------------------------------------------------------------


def grinding(columns):
    backwards = columns["axis2_velocity"] < 0
    columns["axis2_current"][backwards] += np.random.default_rng(0).normal(0, 8, backwards.sum())


@pytest.mark.long
def test_a_fault_that_leaves_nothing_of_the_usual_current_is_one(opamc, tmp_path):
    for seed in range(4):
        record(tmp_path / "baseline" / f"{seed}.parquet", seed, made=recordings.reported)
    target = record(tmp_path / "tonight.parquet", 9, grinding, made=recordings.reported)
    ended = diagnose(opamc, tmp_path / "baseline", target, tmp_path / "out")
    assert ended.code == ExitCode.UNHEALTHY, ended.err
    assert "Axis 2 at fault" in ended.out
    assert "axis 2: its currents are like the reference cycle's by 0." in ended.err
    assert "told by duration, speed and direction" in ended.err
    for side in (tmp_path / "baseline", target):
        assert opamc("segment", side, "--out", tmp_path / f"of {side.name}").code == 0
    before, after = tmp_path / "of baseline", tmp_path / f"of {target.name}"
    assert opamc("identify", "--out", before).err == ""
    alone = opamc("identify", "--out", after, "--reference", before / "motions.parquet")
    assert "told by duration, speed and direction" in alone.err


def half(columns):
    return len(columns["axis2_current"]) // 2


def turned(columns):
    columns["axis2_current"] *= -1


def signless(columns):
    columns["axis2_current"] = np.abs(columns["axis2_current"])


def current_stands(columns):
    columns["axis2_current"][half(columns) :] = columns["axis2_current"][half(columns)]


def position_stands(columns):
    columns["axis2_position"][half(columns) :] = columns["axis2_position"][half(columns)]


def position_missing(columns):
    columns["axis2_position"] *= np.nan


def position_constant(columns):
    columns["axis2_position"][:] = 1.0


REPORTED = {
    turned: "is the sign of the current or of the position inverted?",
    signless: "the current of axis 2 has lost its sign",
    current_stands: "axis2_current keeps one value from",
    position_stands: "axis2_position keeps one value from",
    position_missing: "the position of axis 2 never changes or is missing",
    position_constant: "axis2_position keeps one value from 0 s",
}


@pytest.mark.parametrize(
    "wrong",
    [one if one in (turned, position_stands) else long(one) for one in REPORTED],
    ids=lambda wrong: wrong.__name__,
)
def test_a_reported_joint_that_cannot_be_judged(opamc, tmp_path, wrong):
    for seed in range(3):
        record(tmp_path / "baseline" / f"{seed}.parquet", seed, made=recordings.reported)
    target = record(tmp_path / "tonight.parquet", 9, wrong, made=recordings.reported)
    ended = diagnose(opamc, tmp_path / "baseline", target, tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.NOT_ENOUGH_DATA, ended.err
    first, second = json.loads((tmp_path / "out" / "verdict.json").read_text())["axes"]
    assert first["state"] == "healthy"
    assert second["state"] == "insufficient-data"
    assert REPORTED[wrong] in " ".join(second["reasons"])


def test_a_load_that_takes_one_sign_of_the_current_away_is_judged(opamc, tmp_path):
    def loaded(columns):
        columns["axis2_current"] += 1.1 * np.abs(columns["axis2_current"]).max()

    for seed in range(3):
        record(tmp_path / "baseline" / f"{seed}.parquet", seed, made=recordings.reported)
    target = record(tmp_path / "tonight.parquet", 9, loaded, made=recordings.reported)
    ended = diagnose(opamc, tmp_path / "baseline", target, tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.UNHEALTHY
    assert "Axis 2" in ended.out
    assert "sign" not in ended.out


def test_reported_joints_that_are_healthy(opamc, tmp_path):
    for seed in range(3):
        record(tmp_path / "baseline" / f"{seed}.parquet", seed, made=recordings.reported)
    target = record(tmp_path / "tonight.parquet", 9, made=recordings.reported)
    ended = diagnose(opamc, tmp_path / "baseline", target, tmp_path / "out", "--quiet")
    assert (ended.code, ended.out, ended.err) == (ExitCode.DONE, "", "")


def test_a_target_of_which_nothing_can_be_judged(opamc, baseline, tmp_path):
    def every_axis(columns):
        for name in columns:
            columns[name] *= np.float32(100)

    target = record(tmp_path / "tonight.parquet", 9, every_axis)
    ended = diagnose(opamc, baseline, target, tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.NOT_ENOUGH_DATA
    assert "another unit (mA for A)?" in ended.sentences[0]


def test_a_baseline_in_another_unit_does_not_make_all_healthy(opamc, tonight, tmp_path):
    def every_axis(columns):
        for name in columns:
            columns[name] *= np.float32(100)

    for seed in range(3):
        record(tmp_path / "baseline" / f"{seed}.parquet", seed, every_axis)
    ended = diagnose(opamc, tmp_path / "baseline", tonight, tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.NOT_ENOUGH_DATA
    assert "another unit" in ended.sentences[0]


@pytest.mark.long
def test_what_all_joints_have_in_common_is_not_therefore_healthy(opamc, tmp_path, monkeypatch):
    """Four joints, each current about twice as large: no fault of one joint, but no health.

    One factor for all, noise too, would be another unit.
    """
    times = {"axis1": 1.6, "axis2": 1.8, "axis3": 1.9, "axis4": 2.1}

    monkeypatch.setitem(recordings.MOTIONS, 3, ((48.0, 1.1, 1), (70.0, 1.2, -1)))
    monkeypatch.setitem(recordings.MOTIONS, 4, ((62.0, 1.3, -1), (85.0, 1.0, 1)))

    def amplify(columns):
        for name in columns:
            columns[name] *= np.float32(times[name[:5]])

    for seed in range(4):
        record(tmp_path / "baseline" / f"{seed}.parquet", seed)
    target = record(tmp_path / "tonight.parquet", 9, amplify)
    ended = diagnose(opamc, tmp_path / "baseline", target, tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.NOT_ENOUGH_DATA
    axes = json.loads((tmp_path / "out" / "verdict.json").read_text())["axes"]
    assert [axis["state"] for axis in axes] == ["insufficient-data"] * 4
    assert all("other joints lie as far" in " ".join(axis["reasons"]) for axis in axes)


@pytest.mark.long
def test_a_cause_that_explains_nothing_never_leads(opamc, baseline, tmp_path, monkeypatch):
    """Whatever the search names: below a twentieth of the change it is not the cause.

    But a fault is told beside what explains the rest, or that would be lost with it.
    """
    from opamc_cli.stages.verdict import cause

    def louder(columns):
        for name in "abc":
            columns[f"axis2_{name}"] *= np.float32(4)

    named = {
        **{"effect": "ripple", "domain": "motor-angle", "parameters": {"order": 2.02}},
        **{"interpretation": "flexspline tooth damage: inspect the flexspline", "p_value": 1e-6},
        **{"ties": [], "harmless": False, "origin": "joint", "clear": True, "evidence": {}},
        **{"why": ["It explains next to nothing."], "others": []},
    }
    colder = {
        **{"effect": "thermal_viscous", "parameters": {}, "share": 0.94},
        **{"interpretation": "colder grease", "origin": "environment"},
    }
    target = record(tmp_path / "tonight.parquet", 9, louder)
    for share, others, told in (
        *((0.0, [], False), (0.04, [], False), (0.9, [], True)),
        (0.04, [colder], True),
    ):
        explained = share + sum(one["share"] for one in others)
        found = {**named, "share": share, "explained": explained, "others": others}
        monkeypatch.setattr(cause, "explain", lambda *_, found=found: found)
        arguments = ("--baseline", baseline, "--target", target, "--out", tmp_path / "out")
        ended = opamc("diagnose", *arguments)
        assert ended.code == ExitCode.UNHEALTHY
        _, axis = json.loads((tmp_path / "out" / "verdict.json").read_text())["axes"]
        assert (axis["cause"] is not None) == told
        assert ("flexspline" in ended.out) == told


def test_healthy_joints_are_judged_without_a_word(opamc, baseline, tonight, tmp_path):
    ended = diagnose(opamc, baseline, tonight, tmp_path / "out", "--quiet")
    assert (ended.code, ended.out, ended.err) == (ExitCode.DONE, "", "")


def test_joints_exchanged_with_one_another_fit_nothing(opamc, baseline, tmp_path):
    def exchange(columns):
        for name in "abc":
            one, other = f"axis1_{name}", f"axis2_{name}"
            columns[one], columns[other] = columns[other], columns[one]

    target = record(tmp_path / "tonight.parquet", 9, exchange)
    ended = diagnose(opamc, baseline, target, tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.NOT_ENOUGH_DATA
    assert "no axis can be judged" in ended.sentences[0]


@pytest.mark.long
@pytest.mark.parametrize("made", [recordings.columns, recordings.reported])
def test_joints_in_step_that_are_exchanged_are_known_by_their_size(
    opamc, tmp_path, monkeypatch, made
):
    """Both make the same motions, so that each fits the other's; one draws twice the current."""
    monkeypatch.setitem(recordings.MOTIONS, 2, recordings.MOTIONS[1])

    def as_recorded(columns):
        for name in columns:
            if name.startswith("axis2") and not name.endswith(("position", "velocity")):
                columns[name] *= np.float32(2)

    def exchange(columns):
        as_recorded(columns)
        ours = {name: columns[name] for name in columns if name.startswith("axis1")}
        for name, values in ours.items():
            other = name.replace("axis1", "axis2")
            columns[name], columns[other] = columns[other], values

    for seed in range(3):
        record(tmp_path / "baseline" / f"{seed}.parquet", seed, as_recorded, made)
    arguments = (tmp_path / "baseline", tmp_path / "tonight.parquet", tmp_path / "out", "--quiet")
    record(tmp_path / "tonight.parquet", 9, as_recorded, made)
    assert diagnose(opamc, *arguments).code == ExitCode.DONE
    record(tmp_path / "tonight.parquet", 9, exchange, made)
    ended = diagnose(opamc, *arguments)
    assert ended.code == ExitCode.NOT_ENOUGH_DATA
    assert "are the two exchanged?" in ended.err


def test_currents_exchanged_beside_their_own_positions_are_known(opamc, tmp_path, monkeypatch):
    monkeypatch.setitem(recordings.MOTIONS, 2, recordings.MOTIONS[1])

    def doubled(columns):
        for name in columns:
            if name.startswith("axis2"):
                columns[name] *= 2

    def exchange(columns):
        doubled(columns)
        one, other = "axis1_current", "axis2_current"
        columns[one], columns[other] = columns[other], columns[one]

    for seed in range(3):
        record(tmp_path / "baseline" / f"{seed}.parquet", seed, doubled, recordings.reported)
    target = record(tmp_path / "tonight.parquet", 9, exchange, recordings.reported)
    ended = diagnose(opamc, tmp_path / "baseline", target, tmp_path / "out", "--quiet")
    assert ended.code == ExitCode.NOT_ENOUGH_DATA
    assert "the currents of axes 1 and 2 each look like the other" in ended.err


@pytest.mark.long
def test_a_gain_of_ten_per_cent_is_a_change_without_its_name(opamc, tmp_path):
    """A limit: the current alone does not tell a sensor's gain from a load.

    Three sessions say too little of how far healthy ones differ to be sure of a tenth.
    """
    baseline = tmp_path / "baseline"
    for seed in range(6):
        record(baseline / f"{seed}.parquet", seed)

    def amplify(columns):
        for name in columns:
            columns[name] *= np.float32(1.1)

    target = record(tmp_path / "tonight.parquet", 9, amplify)
    ended = diagnose(opamc, baseline, target, tmp_path / "out")
    assert ended.code == ExitCode.UNHEALTHY
    axes = json.loads((tmp_path / "out" / "verdict.json").read_text())["axes"]
    assert {axis["state"] for axis in axes} == {"changed"}


@pytest.mark.long
@pytest.mark.parametrize("wrong", [gone, dead], ids=lambda w: w.__name__)
def test_a_joint_that_one_night_of_several_lacks_is_said(opamc, baseline, tmp_path, wrong):
    week = [record(tmp_path / f"{k}.parquet", k, wrong if k == 10 else bool) for k in (9, 10)]
    named = [part for run in week for part in ("--target", run)]
    ended = opamc(
        *("diagnose", "--baseline", baseline, *named, "--out", tmp_path / "out", "--quiet"),
        *("--set", "joint.explain=false"),
    )
    assert ended.code == ExitCode.PARTIAL, ended
    (sentence,) = ended.sentences
    assert "10.parquet: " in sentence
    assert "axis 2" in sentence
