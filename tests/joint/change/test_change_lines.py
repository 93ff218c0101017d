"""Order spectra of strokes against the sum that they stand for, and the lines that grew."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from sessions import columns_of, current_of, rows_of, with_track
from simulator import simulate

from opamc_cli.joint.change.lines import (
    OrderSpectra,
    clocked,
    fast_residuals,
    grown_lines,
    order_spectra,
    power_at,
    strokes,
)
from opamc_cli.joint.change.slow import Shift
from opamc_cli.joint.change.units import read_side, side_by_side
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Joint
from opamc_cli.joint.spectra import highest_order

JOINT = Joint(100.0, 5)
LIBRARY = built_in_library()


@pytest.fixture(scope="module")
def units():
    made = simulate(2, rate=500.0, cycles=6, kind="trapezoid")
    edges = np.linspace(0, made.time.size, 4).astype(int)
    recordings = [
        Recording(f"part-{k}", 500.0, current_a=made.current[a:b], position_rad=made.position[a:b])
        for k, (a, b) in enumerate(pairwise(edges))
    ]
    sides = recordings[:2], recordings[2:]
    return side_by_side(*(read_side(side, JOINT, cycles=False) for side in sides))


@pytest.fixture(scope="module")
def counted(units):
    return units.dataset.fine.fit


@pytest.mark.parametrize("tapered", [False, True])
def test_binned_transform_is_the_plain_sum_over_the_angle(units, counted, tapered):
    rng = np.random.default_rng(0)
    residual = np.where(counted, rng.normal(size=counted.size), 0.0)
    spectra = order_spectra(units, residual, tapered)
    track = units.track
    pieces = [piece for piece in strokes(track, counted) if track.group[piece[0]] == 0]
    samples = sum(np.count_nonzero(residual[start:stop]) for start, stop in pieces)
    errors = []
    for k in range(0, spectra.orders.size, spectra.orders.size // 40):
        plain = 0.0
        for start, stop in pieces:
            angle = track.machine_angle_rad[start:stop]
            turned = np.exp(-1j * spectra.orders[k] * angle)
            if tapered:
                place = (angle - angle.min()) / np.ptp(angle)
                turned *= np.sqrt(8 / 3) * 0.5 * (1 - np.cos(2 * np.pi * place))
            plain += abs(np.sum(residual[start:stop] * turned)) ** 2
        errors.append(abs(spectra.before[0, k] - plain / samples) / max(plain / samples, 0.5))
    # At the highest orders a bin is a sixteenth of a wave: single ones may be off by more.
    assert np.mean(errors) < 0.05
    assert np.max(errors[:20]) < 0.1
    assert tapered or spectra.before.mean() == pytest.approx(1.0, abs=0.1)


def test_samples_that_do_not_count_end_no_stroke_where_the_angle_is_logged(units, counted):
    track = units.track
    (start, stop), *_ = strokes(track, counted)
    middle = (start + stop) // 2
    rows = counted.copy()
    rows[middle - 5 : middle + 5] = False
    assert strokes(track, rows)[0] == (start, stop)
    followed = replace(track, channels=track.channels - {"logged"})
    assert strokes(followed, rows)[0][1] <= middle - 5


def test_a_stroke_ends_with_its_unit(units, counted):
    track = units.track
    (start, stop), *_ = strokes(track, counted)
    middle = (start + stop) // 2
    group = track.group.copy()
    group[middle:stop] += 1
    assert strokes(replace(track, group=group), counted)[0] == (start, middle)


def spectra_of(after_line=None, before_line=None, size=400, resolution=0.04, seed=0, units=4):
    """Return noise of mean 1 over orders 1 to 5, with lines of (order, power) in either side."""
    orders = 1 + 0.01 * np.arange(size)
    rng = np.random.default_rng(seed)

    def side(count, line):
        power = rng.gamma(20.0, 1 / 20.0, size=(count, size))
        if line is not None:
            place, height = line
            power += height * np.sinc((orders - place) / resolution) ** 2
        return power

    return OrderSpectra(orders, side(units, before_line), side(3, after_line), resolution)


def test_a_line_that_grew_is_found_with_its_order_and_power():
    (found,) = grown_lines(spectra_of((2.5, 50.0)))
    assert found.order == pytest.approx(2.5, abs=0.005)
    assert found.new
    # Averaged over four orders, a resolution, a line shows with most of its power.
    assert 30 < found.excess < 51
    assert found.growth == pytest.approx(found.excess + 1, rel=0.1)
    assert found.p_value < 1e-3
    assert found.error == pytest.approx(0.05 * 0.04 / np.sqrt(3))


def test_what_was_there_before_or_everywhere_has_not_grown():
    assert grown_lines(spectra_of()) == []
    assert grown_lines(spectra_of((2.5, 50.0), (2.5, 50.0))) == []
    # All orders alike are no line.
    flat = spectra_of()
    assert grown_lines(replace(flat, after=5 * flat.after)) == []
    # Too few orders have no neighbourhood.
    assert grown_lines(spectra_of((1.1, 50.0), size=23)) == []


def test_a_line_that_the_baseline_has_near_is_not_new():
    (found,) = grown_lines(spectra_of((2.52, 200.0), (2.5, 20.0)))
    assert found.order == pytest.approx(2.52, abs=0.005)
    assert not found.new


def test_a_line_has_to_double():
    assert grown_lines(spectra_of((2.5, 60.0), (2.5, 40.0))) == []
    assert len(grown_lines(spectra_of((2.5, 120.0), (2.5, 40.0)))) == 1


def test_what_cycles_of_one_session_cannot_show_is_allowed_for():
    strong, weak = spectra_of((2.5, 50.0)), spectra_of((2.5, 3.0))
    assert [len(grown_lines(weak, between)) for between in (0.0, 1.0)] == [1, 0]
    first, second = (grown_lines(strong, between)[0].p_value for between in (0.0, 0.1))
    assert first < second


def test_the_largest_come_first_and_no_more_than_are_asked_for():
    spectra = spectra_of((2.0, 30.0))
    far = spectra_of((4.0, 90.0), seed=1)
    both = replace(spectra, after=spectra.after + far.after)
    orders = [line.order for line in grown_lines(both)]
    assert orders == pytest.approx([4.0, 2.0], abs=0.01)
    assert len(grown_lines(both, most=1)) == 1


def test_side_lobes_are_no_lines_but_a_line_beside_is():
    spectra = spectra_of((2.5, 5000.0))
    assert len(grown_lines(spectra)) == 1
    beside = replace(spectra, after=spectra.after + spectra_of((2.7, 3000.0), seed=2).after)
    orders = [line.order for line in grown_lines(beside)]
    assert orders == pytest.approx([2.5, 2.7], abs=0.01)


def test_more_orders_that_are_looked_at_make_a_line_less_sure():
    few, many = (
        grown_lines(replace(spectra_of((2.5, 6.0)), resolution=width))[0].p_value
        for width in (0.04, 0.02)
    )
    assert many == pytest.approx(2 * few, rel=1e-6)


def test_of_a_tapered_spectrum_the_surroundings_are_a_part_of_each_order():
    spectra = replace(spectra_of((2.5, 50.0)), tapered=True)
    (found,) = grown_lines(spectra)
    # Their power, 1, is added to both sides thrice.
    assert found.growth == pytest.approx((found.excess + 4) / 4, rel=0.1)
    quiet = replace(spectra_of((2.5, 3.0)), tapered=True)
    assert (len(grown_lines(quiet)), len(grown_lines(replace(quiet, tapered=False)))) == (0, 1)


def test_jumps_at_the_ends_of_strokes_hide_no_tapered_line(units, counted):
    """A step of forty times the line, as friction leaves where a stroke begins and ends."""
    track = units.track
    step = np.where(counted, 4.0 * track.direction, 0.0)
    new = np.append(units.after, False)[track.group] * np.cos(2.5 * track.machine_angle_rad)
    residual = step + np.where(counted, 0.1 * new, 0.0)
    (found, *_), hidden = (
        grown_lines(order_spectra(units, residual, tapered)) for tapered in (True, False)
    )
    assert found.order == pytest.approx(2.5, abs=0.02)
    assert not any(abs(line.order - 2.5) < 0.1 for line in hidden)


def test_power_at_an_order_is_that_of_its_highest_excess():
    excess, growth = power_at(spectra_of((2.51, 50.0), (2.5, 20.0)), 2.5)
    assert 20 < excess < 40
    assert growth == pytest.approx(51 / 21, rel=0.3)


def test_over_time_a_line_s_order_is_its_frequency(units, counted):
    tone = np.where(counted, np.cos(2 * np.pi * 40.0 * units.track.run_time_s), 0.0)
    spectra = order_spectra(clocked(units), tone)
    assert spectra.orders[np.argmax(spectra.after[0])] == pytest.approx(40.0, abs=0.2)
    assert spectra.orders[0] >= 8.0  # the lowest of the joint's orders


def test_spectra_need_two_units_before_and_one_after(units, counted):
    white = np.where(counted, 1.0, 0.0)
    assert order_spectra(units.only(np.array([False, True, True])), white).orders.size == 0
    assert order_spectra(units.only(~units.after), white).orders.size == 0
    assert order_spectra(units, 0 * white).orders.size == 0
    # A unit without a long stroke is left out.
    gone = np.where(units.track.group == 0, 0.0, white)
    assert order_spectra(units, gone).orders.size == 0
    still = with_track(units, machine_angle_rad=0 * units.track.machine_angle_rad)
    assert order_spectra(still, white).orders.size == 0


def test_a_stroke_is_long_and_goes_one_way(units, counted):
    track = units.track
    found = strokes(track, counted)
    assert len(found) > 6
    assert strokes(track, np.zeros_like(counted)) == []
    for start, stop in found:
        inside = track.direction[start:stop][counted[start:stop]]
        assert len(set(inside)) == 1
        # 0.4 cycles of the lowest order, 0.4 per turn of the motor: a turn.
        assert np.ptp(track.machine_angle_rad[start:stop]) >= 2 * np.pi
        assert stop - start >= 50
    slow = replace(track, machine_angle_rad=1e-3 * track.machine_angle_rad)
    assert strokes(slow, counted) == []
    few = np.zeros_like(counted)
    few[found[0][0] : found[0][0] + 49] = True
    assert strokes(track, few) == []


def test_a_fast_residual_is_the_own_fit_s_without_a_shift(units, counted):
    terms = tuple(Term(LIBRARY[name], {}) for name in ("coulomb", "offset"))
    shift = Shift((Term(LIBRARY["spring"], {}),), np.array([0.7, 0.1]), 0.0, 2)
    plain = fast_residuals(units, terms, None)
    shifted = fast_residuals(units, terms, shift)
    assert not plain[~counted].any()
    for unit, after in enumerate(units.after):
        rows = rows_of(units, unit, True)
        columns = columns_of(units, terms, unit, True)
        if units.track.blur is not None:
            columns = np.concatenate([columns, units.track.blur[rows]], axis=1)
        current = current_of(units, unit, True)
        own = current - columns @ np.linalg.lstsq(columns, current)[0]
        np.testing.assert_allclose(plain[rows], own, atol=1e-9)
        assert np.allclose(plain[rows], shifted[rows], atol=1e-9) is not after


def test_the_resolution_is_that_of_the_long_strokes_and_orders_begin_at_two_of_it(units, counted):
    spectra = order_spectra(units, np.where(counted, 1.0, 0.0))
    angle = units.track.machine_angle_rad
    pieces = strokes(units.track, counted)
    travels = np.array([np.ptp(angle[start:stop]) for start, stop in pieces])
    assert spectra.resolution == pytest.approx(2 * np.pi * travels.sum() / (travels**2).sum())
    lowest = max(0.4, 2 * spectra.resolution)
    spacing = spectra.orders[1] - spectra.orders[0]
    assert lowest <= spectra.orders[0] < lowest + spacing
    assert spectra.orders[-1] == pytest.approx(highest_order(units.track), abs=2 * spacing)


def test_a_travel_of_more_bins_than_memory_allows_is_wound_up_by_whole_turns(
    units, counted, monkeypatch
):
    tone = np.where(counted, np.cos(3 * units.track.machine_angle_rad), 0.0)
    whole = order_spectra(units, tone)
    monkeypatch.setattr("opamc_cli.signal.transform.angle_bins.MOST_BINS", whole.orders.size // 8)
    wound = order_spectra(units, tone)
    assert wound.orders.size < whole.orders.size / 2
    for spectra in (whole, wound):
        peak = spectra.orders[np.argmax(spectra.before.mean(axis=0))]
        assert peak == pytest.approx(3.0, abs=spectra.orders[1] - spectra.orders[0])


def test_an_order_s_error_is_the_scatter_of_the_target_s_units():
    spectra = spectra_of()
    places = [2.48, 2.5, 2.52]
    lines = [60.0 * np.sinc((spectra.orders - place) / 0.04) ** 2 for place in places]
    scattered = replace(spectra, after=spectra.after + np.stack(lines))
    (found,) = grown_lines(scattered)
    assert found.order == pytest.approx(2.5, abs=0.003)
    assert found.error == pytest.approx(0.02 / np.sqrt(3), rel=0.1)
    (alone,) = grown_lines(replace(scattered, after=scattered.after[1:2]))
    assert alone.error == pytest.approx(0.1 * 0.04)
