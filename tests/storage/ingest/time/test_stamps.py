"""Time stamps: even ones are kept, uneven ones give a grid, others are refused."""

from pathlib import Path

import numpy as np
import pytest

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.time import stamps
from opamc_cli.storage.ingest.time.stamps import _is_line, examine, resolution_s

FILE = Path("r.csv")


def clock_of(times_s, rate=None, gap=2.5, grid=None):
    return examine(FILE, "t", np.asarray(times_s, dtype=float), rate, gap, grid)


@pytest.mark.parametrize("rate", [1.0, 60.0, 999.7, 1000.0, 2048.0, 20_000.0])
@pytest.mark.parametrize("start", [0.0, -3.7, 1.7e9])
def test_even_stamps_give_their_rate(rate, start):
    clock = clock_of(start + np.arange(5000) / rate)
    assert clock.kept is None
    assert clock.n_samples == 5000
    assert clock.sampling_rate_hz == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize("offset", [0, 1024])  # rounded down, rounded to the nearest
def test_stamps_rounded_to_the_millisecond_are_even(offset):
    # 2048 Hz in ms: half of the stamps repeat the one before; with the rate declared they are
    # what even sampling gives
    times = (np.arange(20_000) * 1000 + offset) // 2048 / 1000
    assert clock_of(times, 2048).kept is None
    slower = (np.arange(20_000) * 1000 + offset % 300) // 300 / 1000
    clock = clock_of(slower)
    assert clock.kept is None
    assert clock.sampling_rate_hz == pytest.approx(300, rel=1e-6)


def test_a_missing_sample_is_not_taken_for_rounding():
    counted = np.delete(np.arange(1000.0), 500) / 1000
    clock = clock_of(counted, 1000)
    assert clock.kept is not None
    assert (clock.n_samples, clock.account.n_bridged, clock.account.n_gaps) == (1000, 1, 0)


def test_a_slow_clock_is_no_reason_to_touch_the_samples():
    clock = clock_of(np.arange(100_000) / 2048.3, 2048)
    assert clock.kept is None
    assert clock.sampling_rate_hz == 2048
    assert clock.account.measured_rate_hz == pytest.approx(2048.3)


def test_gaps_repeats_and_backward_steps_are_counted():
    times = np.arange(1000.0) / 100
    times[200:] += 0.5  # 51 periods
    times[400:] += 0.013  # a sample and a third
    times[600] = times[599]
    times[700] = times[650]
    times[800] = np.nan
    account = clock_of(times).account
    assert not account.even
    # the rows dropped at 600, 700 and 800 leave steps of two periods; so does the shift at 400
    assert (account.n_gaps, account.n_bridged) == (1, 4)
    assert account.longest_gap_s == pytest.approx(0.51)
    assert (account.n_duplicates, account.n_backward, account.n_unreadable) == (1, 1, 1)
    assert account.measured_rate_hz == pytest.approx(100)


def test_rows_that_a_halted_logger_writes_in_a_burst_tell_no_rate():
    """Of a measured log the gap was left out of the mean, and its burst was not: 127.7 Hz."""
    times = np.arange(300.0) / 125
    times[40:48] = times[48] - 0.001 * np.arange(8, 0, -1)
    clock = clock_of(times)
    assert clock.account.measured_rate_hz == pytest.approx(125, rel=1e-9)
    assert clock.account.n_gaps == 1


@pytest.mark.parametrize(
    ("times", "rate", "expected"),
    [
        (
            np.r_[np.arange(500.0), np.arange(500.0)] / 100,
            None,
            "500 of 1000 rows (1 repeated, 499",
        ),
        (
            (np.arange(1000.0) - 700 * (np.arange(1000) > 800)) / 100,
            None,
            "at most 5% may be; split the recording where its clock was set back",
        ),
        (np.zeros(100), None, "99 of 100 rows"),
        (np.full(100, np.nan), None, "100 unreadable"),
        (np.arange(100.0) / 100, 200.0, "says 100 Hz, the map 200 Hz, more than 10% apart"),
        (np.r_[np.arange(50.0), 1e6 + np.arange(50.0)], 1.0, "it is mostly gap"),
        (np.r_[np.arange(99.0), 1e12], 1.0, "it is mostly gap"),
        ([0.0, 1.0], None, "2 rows are too few"),
        (-np.arange(100.0), None, "99 of 100 rows"),
    ],
)
def test_stamps_that_tell_no_time_are_refused(times, rate, expected):
    with pytest.raises(InputError) as caught:
        clock_of(times, rate)
    assert expected in str(caught.value)
    assert str(caught.value).startswith("r.csv: ")


@pytest.mark.parametrize(("late", "even"), [(0.0199, True), (0.0201, False)])
def test_even_is_within_a_hundredth_of_a_sample_either_way(late, even):
    times = np.arange(1001.0)
    times[500] += late
    clock = clock_of(1 + times / 100)
    assert clock.account.even is even
    assert clock.account.resampled is not even
    assert clock.account.jitter_s == pytest.approx(late / 100, rel=1e-3)


@pytest.mark.parametrize(("drift", "even"), [(0.9e-3, True), (1.1e-3, False)])
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_clock_may_drift_by_a_thousandth(drift, even, sign):
    clock = clock_of(np.arange(5000) / (100 * (1 + sign * drift)), 100)
    assert (clock.kept is None) is even
    assert clock.sampling_rate_hz == 100


@pytest.mark.parametrize(("apart", "refused"), [(1.09, False), (1.11, True), (0.91, False)])
def test_rates_more_than_a_tenth_apart_are_refused(apart, refused):
    even = np.arange(200) / (100 * apart)
    uneven = even + 0.002 * (np.arange(200) % 2)
    for times, rates in ((even, {"grid": 100}), (uneven, {"rate": 100}), (uneven, {"grid": 100})):
        if refused:
            with pytest.raises(InputError, match="more than 10% apart"):
                clock_of(times, **rates)
        else:
            clock = clock_of(times, **rates)
            assert clock.sampling_rate_hz == 100
            assert clock.n_samples == int((times[-1] - times[0]) * 100 + 1e-6) + 1


def test_another_grid_for_even_stamps():
    clock = clock_of(7 + np.arange(101) / 100, grid=96, gap=3)
    assert (clock.sampling_rate_hz, clock.n_samples, clock.start_s) == (96, 97, 7)
    assert clock.kept.tolist() == [True] * 101
    assert clock.max_gap_s == pytest.approx(0.03)
    assert (clock.account.even, clock.account.resampled) == (True, True)
    # the rate that it has is no other
    clock = clock_of(7 + np.arange(101) / 100, grid=100 * (1 + 5e-10))
    assert (clock.kept, clock.account.resampled, clock.n_samples) == (None, False, 101)


@pytest.mark.parametrize(("n_bad", "refused"), [(5, False), (6, True)])
def test_one_stamp_in_twenty_may_be_unusable(n_bad, refused):
    times = np.arange(100.0)
    times[10 : 10 + 10 * n_bad : 10] = np.nan
    if refused:
        with pytest.raises(InputError, match=r"6 of 100 rows .*first: data row 11"):
            clock_of(times)
    else:
        clock = clock_of(times)
        assert (clock.account.n_unreadable, clock.n_samples) == (5, 100)
        assert np.array_equal(clock.kept, np.isfinite(times))


@pytest.mark.parametrize(("longest", "refused"), [(901, False), (902, True)])
def test_ten_samples_per_row_are_mostly_gap(longest, refused):
    times = np.cumsum([0.0, *[1.0] * 49, longest, *[1.0] * 49])
    if refused:
        with pytest.raises(InputError, match=f"it is mostly gap \\(longest {longest} s\\)"):
            clock_of(times)
    else:
        clock = clock_of(times)
        assert clock.n_samples == 1000
        assert (clock.account.n_gaps, clock.account.longest_gap_s) == (1, longest)


def test_a_late_stamp_is_no_missing_sample():
    times = np.arange(20.0)
    times[5] += 0.6  # a long step, and a short one beside it
    times[12:] += 1.4
    times[16:] += 1.6
    account = clock_of(times).account
    assert (account.n_bridged, account.n_gaps) == (1, 1)
    assert account.longest_gap_s == pytest.approx(2.6)
    # of the steps that miss none
    assert account.measured_rate_hz == pytest.approx(1.0)
    assert account.jitter_s == pytest.approx(0.6)


@pytest.mark.parametrize("rate", [418.0, 440.0, 310.0])
def test_a_period_between_two_whole_milliseconds_is_not_the_commoner_step(rate):
    """A measured 418 Hz log in milliseconds was put on 473 Hz, its longer steps lost samples."""
    late = 1e-3 * (np.arange(500) % 42 == 41)  # a clock of 1.024 ms, as an Arduino's
    times = np.round(np.delete(np.arange(500) / rate + late, [100, 300]), 3)
    account = clock_of(times).account
    assert not account.even
    assert account.measured_rate_hz == pytest.approx(rate, rel=0.005)
    assert account.n_bridged + account.n_gaps == 2


@pytest.mark.parametrize("lost", [0.05, 0.25])
def test_samples_lost_of_a_clock_that_counts_its_samples_are_no_rounding(lost):
    kept = np.random.default_rng(6).random(1000) >= lost
    account = clock_of(np.flatnonzero(kept).astype(float)).account
    assert account.measured_rate_hz == pytest.approx(1.0)


def test_the_step_that_stamps_are_rounded_to():
    times = np.arange(300) / 2048
    for digits in range(1, 9):
        assert resolution_s(5.5 + np.round(times, digits)) == pytest.approx(10.0**-digits)
    assert resolution_s(np.arange(300.0)) == 1.0
    assert resolution_s(np.sqrt(np.arange(300))) == 0.0


@pytest.mark.parametrize("chunk", [7, 50])
def test_stamps_that_are_looked_at_in_pieces_tell_the_same(chunk, monkeypatch):
    even = 3 + np.arange(100) / 60
    late, missing, unreadable = even.copy(), np.delete(even, 50), even.copy()
    late[49] += 0.004
    unreadable[60] = np.nan
    every = (even, np.round(even, 2), late, missing, unreadable)
    whole = [clock_of(times) for times in every]
    monkeypatch.setattr(stamps, "_CHUNK", chunk)
    for times, expected in zip(every, whole, strict=True):
        found = clock_of(times)
        assert found.account.even is expected.account.even
        assert found.sampling_rate_hz == expected.sampling_rate_hz
        assert found.account.jitter_s == pytest.approx(expected.account.jitter_s, abs=1e-12)


@pytest.mark.parametrize(("spread", "line"), [(0.99, True), (1.01, False)])
def test_a_line_is_as_wide_as_the_stamps_rounding(spread, line):
    times = np.arange(100) * 0.7
    times[50] += 0.3 * spread
    assert _is_line(times, 0.7, 0.3) == line
