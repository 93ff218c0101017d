"""The cause of a change in the shipped samples: phases alone, axis 3 has a ground flexspline."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from opamc_cli.config import load_config
from opamc_cli.config.models import JointConfig
from opamc_cli.decision.measurement.at_rest import Growth
from opamc_cli.errors import ConfigError, InputError
from opamc_cli.joint.change.explain import Change
from opamc_cli.joint.change.reading import FLEXSPLINE, Cause
from opamc_cli.joint.change.search import LESS_FRICTION
from opamc_cli.joint.motion.track import Joint
from opamc_cli.stages import diagnose
from opamc_cli.stages.verdict import cause
from opamc_cli.stages.verdict.wording import causes
from opamc_cli.storage.runs.finding import find_runs
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.storage.sources import RunSource

SAMPLES = Path(__file__).parents[3] / "data" / "samples"
KNOWN = JointConfig(gear_ratio={1: 100, 2: 100, 3: 100}, pole_pairs=5)


def sources(side):
    found = []
    for name, path in find_runs([SAMPLES / side]):
        with Run(path, name) as run:
            found.append(RunSource(name, path, "", run.n_samples, run.info))
    return found


def test_a_ground_flexspline_is_a_ripple_near_its_passage():
    found = cause.explain(3, sources("normal"), sources("fault"), KNOWN)
    assert found["effect"] == "ripple"
    assert found["parameters"]["order"] == pytest.approx(2.02)
    assert "inspect the flexspline" in found["interpretation"]
    assert found["share"] > 0.6
    assert found["p_value"] < 1e-4
    assert not found["harmless"]
    # Measured at 2.02 and not put there: the line of the healthy gear lies at 2.
    assert found["evidence"]["measured_order"] == pytest.approx(2.018, abs=0.006)
    # The longest stroke is 2.2 rad, 35 turns of the motor; less of it carries a current. Order 2 is
    # not excluded.
    assert found["evidence"]["order_resolution"] > 1 / 35
    assert found["evidence"]["order_resolution"] > found["evidence"]["measured_order"] - 2
    assert any("kinematic error" in tie for tie in found["ties"])
    said = " ".join(found["why"])
    assert "8 sessions against 3" in said
    assert "cannot tell it from" in said


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (0.5, "meaning; the joint's friction has grown by 50%"),
        (-0.3, "meaning; the joint's friction has fallen by 30%"),
        (30.0, "meaning; the joint's friction has grown much"),
        (None, "meaning"),
    ],
)
def test_of_friction_it_is_said_whether_it_has_grown(change, said):
    evidence = {} if change is None else {"relative_change": change}
    found = Cause(
        effect="coulomb", parameters={}, interpretation="meaning", p_value=0.0, ties=(),
        evidence=evidence,
    )  # fmt: skip
    told = causes.entry(Change((found,), 1.0, False))
    assert told["interpretation"] == said


@pytest.mark.parametrize(
    ("effect", "ties", "said"),
    [
        ("sublinear_friction", ("coulomb",), "friction, in a form that the recordings do not tell"),
        ("coulomb", ("viscous", "offset"), "friction, in a form that the recordings do not tell"),
        ("sublinear_friction", ("spring",), "meaning; the joint's friction has grown by 50%"),
        ("spring", ("coulomb",), "meaning; the joint's friction has grown by 50%"),
    ],
)
def test_of_forms_of_friction_that_tie_none_is_claimed(effect, ties, said):
    """Dry and lubricant friction that had grown by half were called a starved lubricant."""
    found = Cause(
        effect=effect, parameters={}, interpretation="meaning", p_value=0.0, ties=ties,
        evidence={"relative_change": 0.5},
    )  # fmt: skip
    told = causes.entry(Change((found,), 1.0, False))["interpretation"]
    assert told.startswith(said)
    assert told.endswith("; the joint's friction has grown by 50%")


def test_friction_that_has_fallen_for_no_warmth_sends_nobody_to_the_grease():
    found = Cause(
        effect="coulomb", parameters={}, interpretation=LESS_FRICTION, p_value=0.0,
        ties=("hysteresis",), evidence={"relative_change": -0.4},
    )  # fmt: skip
    told = causes.entry(Change((found,), 1.0, False))["interpretation"]
    assert told == f"{LESS_FRICTION}; the joint's friction has fallen by 40%"
    assert not any(word in told for word in ("grease", "seals"))


@pytest.mark.long
def test_without_the_joint_s_constants_the_baseline_tells_the_pole_pairs():
    found = cause.explain(3, sources("normal"), sources("fault"), JointConfig())
    assert found["effect"] == "ripple"
    assert found["parameters"]["order"] == pytest.approx(2.02, abs=0.01)
    assert found["interpretation"] == FLEXSPLINE
    told = "That the motor has 5 pole pairs is told by the baseline's own line at"
    assert any(why.startswith(told) for why in found["why"])


@pytest.mark.parametrize(
    ("told", "says"),
    [
        (None, None),
        (Joint(101.2), "That the gear ratio is 101.2 is told by the baseline's own line"),
        (Joint(None, 4), "That the motor has 4 pole pairs is told by the baseline's own line"),
    ],
)
def test_what_the_baseline_had_to_tell_is_said_beside_an_order(told, says):
    seen = ("measured_order", "order_error", "power_ratio", "order_resolution")
    found = Cause(
        effect="ripple", parameters={}, interpretation="x", p_value=0.0, ties=(),
        evidence=dict.fromkeys(seen, 1.0),
    )  # fmt: skip
    why = " ".join(causes.entry(Change((found,), 1.0, False, told=told))["why"])
    assert (says or "of the motor has") in why
    assert ("is told by" in why) == (told is not None)


@pytest.mark.long
@pytest.mark.parametrize("axis", [1, 2])
def test_joints_that_nothing_happened_to_have_no_cause(axis):
    assert cause.explain(axis, sources("normal"), sources("fault"), KNOWN) == {}


@pytest.mark.long
@pytest.mark.parametrize("axis", [1, 2, 3])
def test_healthy_sessions_against_healthy_ones_have_no_cause(axis):
    normal = sources("normal")
    assert cause.explain(axis, normal[::2], normal[1::2], KNOWN) == {}


TOOTH = """
import numpy as np
from opamc_cli.joint.effects.base import Effect

class Notch(Effect):
    name, domain, meaning = "notch", "joint-angle", "a notch in the ring"
    needs = ("position",)
    from_motion = True
    def columns(self, track, parameters):
        {body}
"""


def pushed(folder, extra_a, rest=0):
    """Write three sessions of strokes with dry friction; the current of a notch in later ones.

    Before and after them the joint is held for `rest` samples against another one's motion.
    """
    rng = np.random.default_rng(1)
    time = np.arange(0, 24, 0.01)
    q = 1.2 * np.sin(time) + 0.3 * np.sin(2.3 * time)
    for k in range(3):
        current = (1 + 0.02 * rng.normal()) * np.sign(np.gradient(q)) + 0.8 * np.sin(q)
        current += extra_a * np.exp(-(((q - 0.4) / 0.1) ** 2)) + 0.05 * rng.normal(size=q.size)
        held = 3 * np.sin(0.05 * np.arange(rest))
        columns = {
            "axis1_current": np.concatenate([held[::-1], current, held]).astype(np.float32),
            "axis1_position": np.pad(q, rest, mode="edge"),
        }
        save_run(folder / f"{k}.parquet", RunInfo(sampling_rate_hz=100.0), columns)
    found = []
    for name, path in find_runs([folder]):
        with Run(path, name) as run:
            found.append(RunSource(name, path, "", run.n_samples, run.info))
    return found


def paused(folder, noise_a, ripple_a=0.0, friction=1.0, logged=True, lag=0, spikes_a=0.0):
    """Write four sessions of strokes with pauses: with a sensor's noise and a ripple.

    The current comes `lag` samples late, and leaps in five single ones.
    """
    rng = np.random.default_rng(2)
    still, way = np.zeros(100), 0.6 * (1 - np.cos(np.linspace(0, np.pi, 150)))
    q = np.concatenate([still, *[way, still + 1.2, way[::-1], still] * 3])
    speed = np.gradient(q) * 100
    spans = [(100 + 250 * n, 250 + 250 * n) for n in range(6)]
    found = []
    for k in range(4):
        torque = friction * (1 + 0.02 * rng.normal()) * np.tanh(speed / 0.02) + 0.8 * np.sin(q)
        torque += ripple_a * np.sin(150 * q) * (speed != 0)
        torque = np.concatenate([torque[:1].repeat(lag), torque[: q.size - lag]])
        sizes = noise_a * rng.normal(size=(q.size, 3))
        sizes[[60, 333, 700, 1111, 1400], 0] += spikes_a
        columns = {"axis1_current": (torque + sizes[:, 0]).astype(np.float32)}
        columns["axis1_position" if logged else "axis1_velocity"] = q if logged else speed
        path = folder / f"{k}.parquet"
        save_run(path, RunInfo(sampling_rate_hz=100.0), columns)
        with Run(path, path.stem) as run:
            found.append(RunSource(path.stem, path, "", run.n_samples, run.info))
    return found, {str(k): spans for k in range(4)}


@pytest.mark.parametrize("logged", [True, False], ids=["position", "spans of motion"])
def test_noise_that_is_there_at_standstill_is_the_sensor_s(tmp_path, logged):
    """It was a worn gear; the joint is not called healthy for it, nor at fault."""
    before, strokes = paused(tmp_path / "before", 0.03, logged=logged)
    after, _ = paused(tmp_path / "after", 0.12, logged=logged)
    found = cause.explain(1, before, after, JointConfig(), strokes=(strokes, strokes))
    assert (found["effect"], found["origin"]) == ("sensor_noise", "measurement")
    assert not found["harmless"]
    assert found["share"] > 0.5
    assert found["evidence"]["times_at_rest"] == pytest.approx(4, rel=0.1)
    assert "fluctuates 4" in found["why"][0]
    if not logged:  # nobody knows where it stands
        assert (cause.explain(1, before, after, JointConfig()) or {}).get("effect") != (
            "sensor_noise"
        )


def test_single_samples_that_leap_are_the_logger_s(tmp_path):
    before, _ = paused(tmp_path / "before", 0.03)
    after, _ = paused(tmp_path / "after", 0.03, spikes_a=3.0)
    found = cause.explain(1, before, after, JointConfig())
    assert (found["effect"], found["origin"]) == ("sensor_noise", "measurement")
    assert found["evidence"] == {"times_in_spikes": 100.0}
    assert "Single samples that leap" in found["why"][0]


def test_a_late_current_is_the_logger_s(tmp_path):
    """It was friction that differs between directions, or a ripple."""
    before, _ = paused(tmp_path / "before", 0.03)
    after, _ = paused(tmp_path / "after", 0.03, lag=4)
    found = cause.explain(1, before, after, JointConfig())
    assert (found["effect"], found["origin"]) == ("current_lag", "measurement")
    assert not found["harmless"]
    assert found["parameters"]["delay_s"] == pytest.approx(0.04, abs=1e-3)
    assert "comes 40 ms later" in found["interpretation"]
    assert "comes 40 ms later" in found["why"][0]
    assert found["share"] > 0.9
    assert found["others"] == []


def test_what_has_changed_beside_a_lag_is_sought_without_it(tmp_path):
    before, _ = paused(tmp_path / "before", 0.03)
    after, _ = paused(tmp_path / "after", 0.03, lag=8, ripple_a=0.25)
    found = cause.explain(1, before, after, JointConfig())
    assert found["effect"] == "current_lag"
    assert [(other["effect"], other["origin"]) for other in found["others"]] == [
        ("ripple", "joint")
    ]
    assert found["others"][0]["share"] == pytest.approx(1 - found["share"], abs=0.05)
    assert "With the current moved back:" in found["why"]


def test_noise_beside_a_lag_is_told_beside_it(tmp_path):
    before, _ = paused(tmp_path / "before", 0.03)
    after, _ = paused(tmp_path / "after", 0.12, lag=8)
    found = cause.explain(1, before, after, JointConfig())
    assert found["effect"] == "current_lag"
    assert any("fluctuates 4" in sentence for sentence in found["why"])


@pytest.mark.long
def test_why_no_cause_could_be_sought_is_told(tmp_path):
    """A speed of the wrong sign is refused by the model alone: the cause went without a word."""
    sides = []
    for side, ripple_a in (("normal", 0.0), ("fault", 0.6)):
        found, _ = paused(tmp_path / side, 0.03, ripple_a=ripple_a)
        for source in found:
            with Run(source.path) as run:
                columns = run.read(["axis1_current", "axis1_position"])
            speed = -100 * np.gradient(columns["axis1_position"])
            save_run(source.path, source.info, columns | {"axis1_velocity": speed})
        sides.append(found)
    why = "one of them has the wrong sign"
    with pytest.raises(InputError, match=why):
        cause.explain(1, *sides, JointConfig())
    outcome = diagnose.run(
        [tmp_path / "normal"], [tmp_path / "fault"], load_config(), tmp_path / "out"
    )
    (judged,) = outcome.verdict["axes"]
    assert (judged["state"] in ("changed", "fault"), judged["cause"]) == (True, None)
    (note,) = [note for note in outcome.notes if why in note]
    assert note.startswith("axis 1: no cause could be sought (")


@pytest.mark.parametrize("noise_a", [0.03, 0.12])
def test_a_ripple_is_not_the_sensor_s_whatever_its_noise(tmp_path, noise_a):
    before, _ = paused(tmp_path / "before", 0.03)
    after, _ = paused(tmp_path / "after", noise_a, ripple_a=0.4)
    found = cause.explain(1, before, after, JointConfig())
    assert (found["effect"], found["origin"]) == ("ripple", "joint")


@pytest.mark.long
def test_noise_beside_friction_is_told_beside_it(tmp_path):
    before, _ = paused(tmp_path / "before", 0.03)
    after, _ = paused(tmp_path / "after", 0.12, friction=2.0)
    found = cause.explain(1, before, after, JointConfig())
    assert found["effect"] in causes.FRICTION
    assert [other["effect"] for other in found["others"]] == ["sensor_noise"]
    assert "fluctuates 4" in found["why"][-1]


def with_gain(found, folder, phase, gain):
    """Write runs anew with another gain of one phase's sensor."""
    folder.mkdir()
    for source in found:
        with Run(source.path) as run:
            columns = run.read([f"axis2_{name}" for name in "abc"])
        columns[phase] = columns[phase] * np.float32(gain)
        path = folder / source.path.name
        save_run(path, source.info, columns)
        yield replace(source, path=path)


def test_a_gain_of_one_phase_is_the_sensor_s(tmp_path):
    """It was a worn gear: "do first: inspect the gear"."""
    normal = sources("normal")
    after = list(with_gain(normal[5:], tmp_path / "after", "axis2_a", 1.1))
    found = cause.explain(2, normal[:5], after, KNOWN)
    assert (found["effect"], found["origin"]) == ("sensor_gain", "measurement")
    assert found["evidence"]["times_in_the_sum"] > 3
    assert "add up to nothing" in found["why"][-1]
    alike = list(with_gain(normal[5:], tmp_path / "alike", "axis2_a", 1.0))
    assert "times_in_the_sum" not in cause.explain(2, normal[:5], alike, KNOWN).get("evidence", ())


def test_hum_that_is_heard_at_standstill_stays_hum():
    """By that it is believed though no course has changed; see `believed`."""
    hum = Cause(effect="mains_hum", parameters={"frequency_hz": 50.0}, interpretation="hum",
                p_value=0.0, ties=(), evidence={}, share=0.9, origin="measurement")  # fmt: skip
    for explained, effect in ((0.9, "mains_hum"), (0.3, "sensor_noise")):
        found = causes.entry(Change((hum,), explained, True))
        told = causes.with_sensor(causes.of_noise(Growth(times=3.0, share=0.8)), found)
        assert (told["effect"], told["evidence"]) == (effect, {"times_at_rest": 3.0})
        assert "fluctuates 3 times" in told["why"][-1]
    assert [other["effect"] for other in told["others"]] == ["mains_hum"]


def test_motions_of_a_segment_table_are_kept_one_by_one():
    table = pa.table(
        {"axis": [1, 1, 2], "run": list("aab"), "start": [3, 9, 5], "stop": [6, 12, 8]}
    )
    assert cause.strokes_of(table) == {1: {"a": [(3, 6), (9, 12)]}, 2: {"b": [(5, 8)]}}


@pytest.mark.long
def test_nothing_is_looked_at_beside_an_axis_s_motion(tmp_path):
    found = []
    for rest in (150, 1500):
        sides = [
            pushed(tmp_path / f"{rest} {extra_a}", extra_a, rest=rest) for extra_a in (0.0, 0.6)
        ]
        # the position knows of more motion than patterns were taken from
        found.append(cause.explain(1, *sides, JointConfig(), dict.fromkeys("012", (1800, 1900))))
    assert found[0] is not None
    assert found[0] == found[1]


@pytest.mark.long
def test_a_clock_s_drift_is_no_other_rate(tmp_path):
    baseline, target = (pushed(tmp_path / str(extra_a), extra_a) for extra_a in (0.0, 0.6))
    known = cause.explain(1, baseline, target, JointConfig())
    for source in target:
        with Run(source.path) as run:
            columns = run.read(run.columns)
        # a little below what slower logs are interpolated to
        save_run(source.path, replace(source.info, sampling_rate_hz=99.95), columns)
    assert known is not None
    assert cause.explain(1, baseline, target, JointConfig()) == known


def test_a_spike_of_the_position_hides_no_motion(tmp_path):
    sources = pushed(tmp_path, 0.0, rest=300)
    for source in sources:
        with Run(source.path, source.name) as run:
            columns = run.read(["axis1_current", "axis1_position"])
        columns["axis1_position"] = columns["axis1_position"].copy()
        columns["axis1_position"][1000] = 1e6
        save_run(source.path, source.info, columns)
    logged = cause._as_logged(1, sources, 300.0, dict.fromkeys("012", (300, 2700)), 100.0)
    found, *_ = cause._measured(logged, {})
    assert [recording.size for recording in found] == [2600] * 3


def test_motions_of_an_axis_are_where_patterns_were_taken():
    motions = [(1200, 2300), (100, 1100)] * 2
    starts, stops = zip(*motions, strict=True)
    table = pa.table({"axis": [1] * 4, "run": list("0011"), "start": starts, "stop": stops})
    assert cause.moving_samples(table) == {1: {"0": (100, 2300), "1": (100, 2300)}}


@pytest.mark.long
def test_an_effect_of_the_user_s_own_may_be_the_cause(tmp_path):
    before, after = pushed(tmp_path / "before", 0.0), pushed(tmp_path / "after", 0.6)
    assert (cause.explain(1, before, after, JointConfig()) or {}).get("effect") != "notch"
    own = tmp_path / "notch.py"
    own.write_text(
        TOOTH.format(body="return np.exp(-((track.position_rad - 0.4) / 0.1) ** 2)[:, None]")
    )
    found = cause.explain(1, before, after, JointConfig(library=(own,)))
    assert found["effect"] == "notch"
    assert found["share"] > max([0.5, *(other["share"] for other in found["others"])])
    assert found["interpretation"] == "a notch in the ring"
    assert found["origin"] == "joint"
    own.write_text(TOOTH.format(body="return track.no_such_thing"))
    with pytest.raises(ConfigError, match=r"notch.py:10: this effect cannot be used"):
        cause.explain(1, before, after, JointConfig(library=(own,)))
    with pytest.raises(ConfigError, match="cannot be read"):
        cause.library_of(JointConfig(library=(tmp_path / "none.py",)))
