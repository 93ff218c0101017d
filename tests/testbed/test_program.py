import itertools
from dataclasses import replace

import numpy as np
import pytest

from opamc_cli.testbed.program import Program, reference, schedule


def _plan(program: Program):
    tops = dict.fromkeys(program.axes, 3.0)
    return schedule(program, tops, np.random.default_rng(3))


def test_one_axis_moves_at_a_time_when_sequential(program: Program) -> None:
    plan = _plan(replace(program, axes=(1, 2, 4), cycles=2))
    spans = [(m.start_s, m.start_s + m.move.duration_s) for m in plan.moves]
    assert all(a[1] < b[0] for a, b in itertools.pairwise(spans))
    assert [m.axis for m in plan.moves] == [1] * 8 + [2] * 8 + [4] * 8
    assert plan.duration_s > spans[-1][1]


def test_all_axes_start_together(program: Program) -> None:
    plan = _plan(replace(program, axes=(1, 2), order="together"))
    starts = {axis: [m.start_s for m in plan.moves if m.axis == axis] for axis in (1, 2)}
    assert starts[1] == starts[2]


def test_a_cycle_visits_the_way_points_and_returns(program: Program) -> None:
    plan = _plan(replace(program, cycles=2))
    ends = [m.start_rad + m.move.distance_rad for m in plan.moves]
    points = program.waypoints_rad
    assert ends == pytest.approx([*points[1:], points[0]] * 2)
    assert [(m.cycle, m.motion) for m in plan.moves] == [(c, k) for c in (0, 1) for k in range(4)]


def test_the_reference_is_continuous_and_ends_where_it_should(program: Program) -> None:
    plan = _plan(program)
    n = int(plan.duration_s * 4000)
    position, velocity, acceleration = reference(plan, 3, program.waypoints_rad[0], 4000.0, n)
    assert np.abs(np.diff(position)).max() <= 3.0 / 4000 * 1.001
    assert position[-1] == pytest.approx(program.waypoints_rad[0])
    assert velocity[-1] == 0.0
    assert acceleration[-1] == 0.0


def test_dwells_jitter_within_their_bounds(program: Program) -> None:
    plan = _plan(replace(program, cycles=30))
    ends = np.array([m.start_s + m.move.duration_s for m in plan.moves])
    dwells = np.array([m.start_s for m in plan.moves])[1:] - ends[:-1]
    assert np.abs(dwells - program.dwell_s).max() <= program.dwell_jitter_s + 1e-12
    assert dwells.std() > 0.2 * program.dwell_jitter_s
