"""A current that comes later against the position, and faults that bend it instead."""

from itertools import pairwise

import numpy as np
import pytest

from opamc_cli.decision.measurement.lag import (
    BESIDE_S,
    HELD,
    LONGEST_S,
    STEP_S,
    Course,
    correlation,
    courses,
    lag_behind,
    mean_course,
    shift,
    strokes,
)

RATE_HZ = 250.0
PLACES = (0.0, 0.7, -0.4, 1.1, 0.0)


def motion() -> np.ndarray:
    """Moves between places with pauses of 0.4 s."""
    parts = [np.full(150, PLACES[0])]
    for start, stop in pairwise(PLACES):
        t = np.linspace(0, 1, 200)
        parts += [start + (stop - start) * (t - np.sin(2 * np.pi * t) / (2 * np.pi))]
        parts += [np.full(100, stop)]
    return np.concatenate([*parts, np.full(100, PLACES[-1])])


def recording(
    seed: int,
    lag_s: float = 0.0,
    *,
    dry: float = 1.0,
    wet: float = 1.0,
    bump: float = 0.0,
    ripple: float = 0.0,
    play: float = 0.0,
    gain: float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Current and position; friction of healthy sessions differs by 5 %."""
    rng = np.random.default_rng(seed)
    q = motion()
    v = np.gradient(q) * RATE_HZ
    a = np.gradient(v) * RATE_HZ
    current = dry * (1 + 0.05 * rng.normal()) * 0.5 * np.tanh(v / 0.05) + 0.3 * wet * v
    current += 0.05 * a + 0.4 * np.sin(q) + bump * np.exp(-(((q - 0.3) / 0.06) ** 2))
    current += ripple * np.sin(200 * q) * (v != 0)
    # a knock where the torque changes its side
    crossed = np.flatnonzero(np.diff(np.sign(a)))
    for n in crossed:
        current[n : n + 10] += play * np.cos(np.arange(10))[: current[n : n + 10].size]
    time = np.arange(q.size) / RATE_HZ
    late = np.interp(time - lag_s, time, gain * current)
    return late + 0.02 * rng.normal(size=q.size), np.round(q / 1e-5) * 1e-5


def measured(seed: int, lag_s: float = 0.0, **change: float) -> list[Course]:
    return courses(*recording(seed, lag_s, **change), RATE_HZ)


@pytest.fixture(scope="module")
def baseline() -> list[list[Course]]:
    return [measured(seed) for seed in range(6)]


@pytest.mark.parametrize("lag_s", [0.01, 0.017, 0.04, 0.08, -0.04])
def test_a_lag_is_measured(baseline, lag_s):
    found = lag_behind(baseline, [measured(9, lag_s)])
    assert found is not None
    assert found.lag_s == pytest.approx(lag_s, abs=1.5e-3)
    assert found.share > HELD
    assert found.of_baseline_s < 2e-3


@pytest.mark.parametrize(
    "change",
    [
        {}, {"dry": 2.0}, {"dry": 4.0}, {"wet": 3.0}, {"bump": 1.0}, {"ripple": 0.5}, {"play": 1.0},
        {"gain": 1.3}, {"lag_s": 0.003},
    ],
    ids=str,
)  # fmt: skip
def test_what_bends_the_course_is_no_lag(baseline, change):
    assert lag_behind(baseline, [measured(9, **change)]) is None


def test_a_lag_no_longer_than_the_baseline_s_own_is_none(baseline):
    late = measured(9, 0.012)
    assert lag_behind(baseline, [late]) is not None
    jittery = [*baseline[:5], measured(5, 0.006)]
    assert lag_behind(jittery, [late]) is None


def test_who_has_too_few_recordings_or_no_motion_is_told_nothing(baseline):
    late = measured(9, 0.04)
    assert lag_behind(baseline[:2], [late]) is None
    assert lag_behind(baseline, []) is None
    current, position = recording(1)
    still = courses(current, np.zeros_like(position), RATE_HZ)
    assert still == []
    assert lag_behind(baseline, [still]) is None
    assert courses(current[:5], position[:5], RATE_HZ) == []
    assert courses(np.full_like(current, np.nan), position, RATE_HZ) == []
    assert courses(current, np.full_like(position, np.nan), RATE_HZ) == []


def test_of_several_recordings_the_middle_one_counts(baseline):
    healthy, late = [measured(seed) for seed in (7, 8)], measured(9, 0.04)
    assert lag_behind(baseline, [*healthy, late]) is None
    assert lag_behind(baseline, [healthy[0], late, late]) is not None


def test_lost_samples_cost_their_stroke_alone():
    current, position = recording(1)
    whole = courses(current, position, RATE_HZ)
    assert len(whole) == 4
    lost = np.arange(current.size) == 250  # amid the first stroke
    for one, other in (
        (np.where(lost, np.nan, current), position),
        (current, np.where(lost, np.nan, position)),
    ):
        left = courses(one, other, RATE_HZ)
        assert [course.first for course in left] == [course.first for course in whole[1:]]


def test_phases_count_by_the_length_of_their_vector(baseline):
    current, position = recording(9, 0.04)
    angle = 700 * position[:, None] + 2 * np.pi / 3 * np.array([0, 1, 2])
    phases = np.abs(current)[:, None] * np.cos(angle)
    one, three = courses(np.abs(current), position, RATE_HZ), courses(phases, position, RATE_HZ)
    for a, b in zip(one, three, strict=True):
        np.testing.assert_allclose(a.current, b.current, atol=1e-9)


def test_strokes_are_cut_where_a_joint_stands_or_turns():
    found = strokes(motion(), RATE_HZ)
    assert len(found) == 4
    starts = 150 + 300 * np.arange(4)
    for (start, stop), begins in zip(found, starts, strict=True):
        assert begins < start < begins + 60
        assert begins + 140 < stop < begins + 200
    turning = np.sin(2 * np.pi * np.arange(1000) / 250)
    assert len(strokes(turning, RATE_HZ)) == 8 + 1
    assert strokes(np.zeros(0), RATE_HZ) == []


def test_a_shift_is_the_best_of_all_tried_one_by_one(baseline):
    """The obvious way: every shift, every sample by itself, numpy's own correlation."""
    for seed, lag_s in ((11, 0.0), (12, 0.03), (13, -0.05)):
        late = measured(seed, lag_s)
        most = round(LONGEST_S / STEP_S)
        left = {}
        for lag in range(-most, most + 1):
            x, y = [], []
            for course in late:
                alike = [one for courses_ in baseline for one in courses_ if one.is_of(course)]
                other = mean_course(alike).current
                half = min(course.current.size, other.size) // 2
                for k in range(-half + most, half - most + 1):
                    x.append(course.current[course.current.size // 2 + k])
                    y.append(other[other.size // 2 + k - lag])
            left[lag] = 1 - max(np.corrcoef(x, y)[0, 1], 0) ** 2
        best = min(left, key=left.__getitem__)
        found = shift(baseline, late)
        assert found is not None
        assert found.left == pytest.approx(left[best], rel=1e-6)
        assert found.unshifted == pytest.approx(left[0], rel=1e-6)
        assert abs(found.lag_s - STEP_S * best) <= STEP_S / 2
        assert found.lag_s == pytest.approx(lag_s, abs=1.5e-3)


def test_ties_and_constants():
    size = 2 * round((LONGEST_S + BESIDE_S) / STEP_S) + 1
    flat = [Course(0.0, 1.0, np.ones(size))]
    found = shift([flat], flat)
    assert found is not None
    assert (found.lag_s, found.left, found.held) == (0.0, 1.0, 0.0)
    assert shift([flat], [Course(0.5, 1.0, np.ones(size))]) is None
    assert correlation(np.ones(3), np.arange(3.0)) == 0.0
