"""Order spectra of strokes against the sum that they stand for, and how their lines are read."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from simulator import simulate

from opamc_cli.joint.change.lines import Line, order_spectra, strokes
from opamc_cli.joint.change.reading import read_lines
from opamc_cli.joint.change.units import read_side
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Joint

JOINT = Joint(100.0, 5)


@pytest.fixture(scope="module")
def units():
    made = simulate(2, rate=500.0, cycles=6, kind="trapezoid")
    edges = np.linspace(0, made.time.size, 4).astype(int)
    recordings = [
        Recording(f"part-{k}", 500.0, current_a=made.current[a:b], position_rad=made.position[a:b])
        for k, (a, b) in enumerate(pairwise(edges))
    ]
    before = read_side(recordings[:2], JOINT, after=False, cycles=False)
    return before + read_side(recordings[2:], JOINT, after=True, cycles=False)


def test_binned_transform_is_the_plain_sum_over_the_angle(units):
    rng = np.random.default_rng(0)
    white = [np.where(unit.fine_rows, rng.normal(size=unit.fine.size), 0.0) for unit in units]
    spectra = order_spectra(units, white)
    unit, residual = units[0], white[0]
    pieces = strokes(unit.fine, unit.fine_rows & (residual != 0))
    samples = sum(np.count_nonzero(residual[start:stop]) for start, stop in pieces)
    errors = []
    for k in range(0, spectra.orders.size, spectra.orders.size // 40):
        plain = 0.0
        for start, stop in pieces:
            angle = unit.fine.machine_angle_rad[start:stop]
            turned = np.exp(-1j * spectra.orders[k] * angle)
            plain += abs(np.sum(residual[start:stop] * turned)) ** 2
        errors.append(abs(spectra.before[0, k] - plain / samples) / max(plain / samples, 0.5))
    # At the highest orders a bin is a sixteenth of a wave: single ones may be off by more.
    assert np.mean(errors) < 0.05
    assert np.max(errors[:20]) < 0.1
    assert spectra.before.mean() == pytest.approx(1.0, abs=0.1)


def test_samples_that_do_not_count_end_no_stroke_where_the_angle_is_logged(units):
    unit = units[0]
    (start, stop), *_ = strokes(unit.fine, unit.fine_rows)
    middle = (start + stop) // 2
    rows = unit.fine_rows.copy()
    rows[middle - 5 : middle + 5] = False
    assert strokes(unit.fine, rows)[0] == (start, stop)
    followed = replace(unit.fine, channels=unit.fine.channels - {"logged"})
    assert strokes(followed, rows)[0][1] <= middle - 5


def line(order, reference=None, error=0.001):
    return Line(order, error, reference, 0.001, growth=40.0, excess=1.0, p_value=1e-6)


@pytest.mark.parametrize(
    ("found", "resolution", "order", "says", "ties"),
    [
        ([line(2.021, 2.0)], 0.02, 2.02, "inspect the flexspline", 0),
        ([line(2.021, 2.0)], 0.08, 2.02, "inspect the flexspline", 1),
        # The baseline's own line at 2 shows that all lines lie 0.006 too low.
        ([line(2.014, 1.994)], 0.02, 2.02, "inspect the flexspline", 0),
        ([line(2.0, 2.0)], 0.02, 2.0, "kinematic error", 1),
        ([line(3.3), line(4.04), line(6.06), line(8.08)], 0.03, 2.02, "flexspline", 0),
        ([line(3.3)], 0.03, 3.3, "unknown periodic source", 0),
        # The third harmonic alone, which turns with the flexspline; and a whole order like it.
        ([line(6.06)], 0.04, 2.02, "inspect the flexspline", 1),
        ([line(6.0)], 0.04, 6.0, "unknown periodic source", 0),
        ([line(7.0)], 0.03, 7.0, "unknown periodic source", 0),
    ],
)
def test_lines_are_read_in_the_frame_that_they_can_be_told_to_turn_in(
    units, found, resolution, order, says, ties
):
    reading = read_lines(found, units[0].fine, resolution)
    assert reading.effect == "ripple"
    assert reading.parameters["order"] == pytest.approx(order)
    assert says in reading.interpretation
    assert len(reading.ties) == ties
