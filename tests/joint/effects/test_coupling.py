"""What another joint of the arm asks of this one."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from closing import fit_declared

from opamc_cli.errors import ConfigError
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.loop import close_loop
from opamc_cli.joint.motion.kinematics import Recording, build_track
from opamc_cli.joint.motion.track import Joint
from tests.marks import long

RATE = 250.0
DECLARED = ("inertia", "gravity", "offset", "coulomb", "viscous")


def waves(seed, seconds=30.0):
    """Position, speed and acceleration that never repeat."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * RATE)) / RATE
    parts = [
        (w, p, a / w)
        for w, p, a in zip(
            rng.uniform(0.5, 4.0, 6),
            rng.uniform(0, 6, 6),
            rng.uniform(0.2, 0.5, 6),
            strict=True,
        )
    ]
    return (
        sum(s * np.sin(w * t + p) for w, p, s in parts),
        sum(s * w * np.cos(w * t + p) for w, p, s in parts),
        -sum(s * w**2 * np.sin(w * t + p) for w, p, s in parts),
    )


def shoulder(first, second):
    """Torque on a planar shoulder, in the textbook's words (Spong et al., 2006, (7.87))."""
    (q1, v1, a1), (q2, v2, a2) = first, second
    h = -0.4 * np.sin(q2)
    return (
        (0.8 + 2 * 0.4 * np.cos(q2)) * a1
        + (0.3 + 0.4 * np.cos(q2)) * a2
        + h * v2 * v1
        + h * (v1 + v2) * v2
        + 2.0 * np.cos(q1)
        + 1.1 * np.cos(q1 + q2)
    )


def elbow(first, second):
    """Torque on the elbow of the same arm."""
    (q1, v1, a1), (q2, _, a2) = first, second
    turned = 0.4 * (np.cos(q2) * a1 + np.sin(q2) * v1**2)
    return 0.3 * (a1 + a2) + turned + 1.1 * np.cos(q1 + q2)


def upright(first, second, third):
    """Torque about an arm's vertical axis: its momentum's rate of change."""
    inertia = 0.5 + (0.8 * np.cos(second[0]) + 0.6 * np.cos(second[0] + third[0] + 0.4)) ** 2
    return np.gradient(inertia * first[1], 1 / RATE)


def third_link(first, second, third):
    """Torque on a shoulder whose elbow is balanced, and whose third link is not."""
    return 0.5 * first[2] + 2.0 * np.cos(first[0]) + 1.5 * np.sin(first[0] + second[0] + third[0])


def across(first, second, third):
    """Torque on a joint whose link is weighed through two others, all at right angles."""
    weighed = np.cos(second[0] + 0.4) * np.cos(third[0])
    return 0.5 * first[2] + 8.0 * np.sin(first[0]) * weighed


def chain(joint, *motions):
    """Torque on a joint of links on parallel axes, from their angles against the ground."""
    angle, speed, acceleration = (np.cumsum(one, axis=0) for one in zip(*motions, strict=True))
    inertia = np.array([[1.9, 0.8, 0.3], [0.8, 0.7, 0.25], [0.3, 0.25, 0.2]])
    torque = 0.0
    for i in range(joint, 3):
        torque = torque + (3.0, 1.8, 0.7)[i] * np.cos(angle[i])
        for j in range(3):
            apart = angle[i] - angle[j]
            pulled = np.cos(apart) * acceleration[j] + np.sin(apart) * speed[j] ** 2
            torque = torque + inertia[i, j] * pulled
    return torque


def recording(current, place, others):
    return Recording("run", RATE, current, position_rad=place, others_rad=others)


FIRST, SECOND, THIRD = waves(1), waves(2), waves(3)
ELBOW = {"axis": 3.0}
PAIR = [{"axis": 2.0}, {"axis": 3.0}, {"axis": 2.0, "beside": 3.0}]


@pytest.mark.parametrize(
    ("torque", "own", "others", "asked"),
    [
        (shoulder(FIRST, SECOND), FIRST, {3: SECOND}, [ELBOW]),
        (elbow(FIRST, SECOND), SECOND, {3: FIRST}, [ELBOW]),
        (third_link(FIRST, SECOND, THIRD), FIRST, {2: SECOND, 3: THIRD}, PAIR[2:]),
        (upright(FIRST, SECOND, THIRD), FIRST, {2: SECOND, 3: THIRD}, PAIR),
        (across(FIRST, SECOND, THIRD), FIRST, {2: SECOND, 3: THIRD}, PAIR[2:]),
        (chain(0, FIRST, SECOND, THIRD), FIRST, {2: SECOND, 3: THIRD}, PAIR),
        (chain(1, FIRST, SECOND, THIRD), SECOND, {2: FIRST, 3: THIRD}, PAIR),
        (chain(2, FIRST, SECOND, THIRD), THIRD, {2: FIRST, 3: SECOND}, PAIR),
    ],
    ids=["shoulder", "elbow", "third link", "upright", "across", "first", "second", "third"],
)
@pytest.mark.parametrize("senses", [(1, 1), (-1, 1), (1, -1), (-1, -1)])
def test_an_arm_s_torques_are_held_by_the_columns(torque, own, others, asked, senses):
    places = {a: way * one[0] for way, (a, one) in zip(senses, others.items(), strict=False)}
    track = build_track([recording(torque, own[0], places)], Joint())
    inner = slice(50, -50)
    columns = [built_in_library()["coupling"].columns(track, one)[inner] for one in asked]
    declared = np.stack([track.acceleration, np.sin(own[0]), np.cos(own[0])], axis=1)[inner]
    design = np.concatenate([declared, *columns], axis=1)
    rest = torque[inner] - design @ np.linalg.lstsq(design, torque[inner], rcond=None)[0]
    assert np.std(rest) < 1e-3 * np.std(torque)


@pytest.mark.parametrize("mirrored", [False, True])
def test_the_joint_that_loads_this_one_is_named_and_another_is_not(mirrored):
    first, second, third = waves(1), waves(2), waves(3)
    seen = -second[0] if mirrored else second[0]
    noise = 0.05 * np.random.default_rng(4).normal(size=first[0].size)
    current = shoulder(first, second) + 0.3 * np.sign(first[1]) + noise
    others = {2: seen + 0.7, 3: third[0]}
    laid = recording(current, first[0], others)
    loop = close_loop(fit_declared([laid], base=DECLARED), built_in_library())
    (step,) = loop.steps
    assert (step.term.effect.name, step.term.parameters) == ("coupling", {"axis": 2.0})
    assert "motion of axis 2:" in step.interpretation
    assert step.term.effect.origin != "joint"
    assert loop.rmse_after_a < 1.1 * 0.05 < 0.2 * loop.rmse_before_a
    # Functions of this joint's own motion alone explain next to nothing of it.
    assert loop.ceiling.certain
    assert loop.ceiling.share == pytest.approx(1 - (0.05 / loop.rmse_before_a) ** 2, abs=0.01)
    assert loop.verdict == "closed"


@pytest.mark.parametrize(
    "torque", [third_link, long(upright), long(across), long(partial(chain, 0))]
)
def test_two_joints_that_load_this_one_are_named_and_another_is_not(torque):
    noise = 0.05 * np.random.default_rng(4).normal(size=FIRST[0].size)
    current = torque(FIRST, SECOND, THIRD) + 0.3 * np.sign(FIRST[1]) + noise
    laid = recording(current, FIRST[0], {2: SECOND[0], 3: THIRD[0], 6: waves(8)[0]})
    loop = close_loop(fit_declared([laid], base=DECLARED), built_in_library())
    assert {step.term.effect.name for step in loop.steps} == {"coupling"}
    parameters = [step.term.parameters for step in loop.steps]
    assert {"axis": 2.0, "beside": 3.0} in parameters
    assert all(set(one.values()) <= {2.0, 3.0} for one in parameters)
    assert any("motion of axes 2 and 3:" in step.interpretation for step in loop.steps)
    assert loop.rmse_after_a < 1.1 * 0.05 < 0.2 * loop.rmse_before_a


@pytest.mark.long
def test_friction_that_grows_with_what_another_joint_asks_is_found():
    noise = 0.02 * np.random.default_rng(4).normal(size=FIRST[0].size)
    load = shoulder(FIRST, SECOND)
    current = load + np.sign(FIRST[1]) * (0.3 + 0.1 * np.abs(load)) + noise
    laid = recording(current, FIRST[0], {2: SECOND[0]})
    loop = close_loop(fit_declared([laid], base=DECLARED), built_in_library())
    assert {step.term.effect.name for step in loop.steps} == {"coupling", "load_friction"}
    assert loop.rmse_after_a < 1.1 * 0.02


def test_a_joint_that_moves_beside_and_asks_nothing_is_not_named():
    first, second = waves(5), waves(6)
    noise = 0.05 * np.random.default_rng(7).normal(size=first[0].size)
    current = 0.3 * first[2] + np.sin(first[0]) + 0.3 * np.sign(first[1]) + noise
    laid = recording(current, first[0], {2: second[0]})
    loop = close_loop(fit_declared([laid], base=DECLARED), built_in_library())
    assert (loop.steps, loop.verdict) == ((), "nothing-missing")


@pytest.mark.parametrize("others", [{}, {2: np.full(7500, 0.3)}, {2: 1e-4 * waves(6)[0]}])
def test_joints_that_hold_still_cost_nothing_and_cannot_be_asked(others):
    first = waves(5)
    track = build_track([recording(first[2], first[0], others)], Joint())
    assert (track.others, track.other_axes) == (None, ())
    assert "no other joint" in built_in_library()["coupling"].untestable(track)


def test_of_joints_beside_only_those_that_move_are_guessed():
    first = waves(5)
    others = {2: np.full(7500, 0.3), 4: waves(6)[0]}
    runs = [recording(first[2], first[0], others), recording(first[2], first[0], {4: others[4]})]
    effect = built_in_library()["coupling"]
    track = build_track(runs[:1], Joint())
    assert track.other_axes == (2, 4)
    assert effect.guesses(track, first[0]) == [{"axis": 4.0}]
    assert build_track(runs, Joint()).other_axes == (4,)
    with pytest.raises(ConfigError, match=r"axis 3, and those .* are 2, 4"):
        effect.columns(track, {"axis": 3.0})
    part = replace(runs[0]).cut(slice(100, 300))
    np.testing.assert_array_equal(part.others_rad[4], others[4][100:300])


@pytest.mark.long
def test_what_another_joint_asks_is_not_called_closed_where_no_effect_holds_it():
    first, second = waves(1), waves(2)
    noise = 0.05 * np.random.default_rng(4).normal(size=first[0].size)
    laid = recording(shoulder(first, second) + noise, first[0], {2: second[0]})
    loop = close_loop(fit_declared([laid], base=DECLARED), built_in_library(("coupling",)))
    assert loop.verdict in ("partial", "not-in-library")
    assert loop.ceiling.certain
    assert loop.rmse_after_a**2 > 2 * loop.floor_a**2
