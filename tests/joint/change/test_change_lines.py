"""Order spectra of strokes against the sum that they stand for, and how their lines are read."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from simulator import simulate

from opamc_cli.joint.change.lines import order_spectra, strokes
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
