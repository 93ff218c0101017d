"""Windows of whole carrier periods."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from opamc_cli.signal.motion.windows import carrier_windows


def test_four_windows_of_whole_periods():
    windows = carrier_windows(0, 5000, 60.0, 1000.0, 4, 1200)
    assert len(windows) == 4
    assert {b - a for a, b in windows} == {1250}  # 75 periods
    assert windows[0] == (0, 1250)


def test_fewer_windows_rather_than_too_short_ones():
    assert len(carrier_windows(0, 3000, 60.0, 1000.0, 4, 1200)) == 2
    assert len(carrier_windows(0, 500, 60.0, 1000.0, 4, 1200)) == 1


def test_a_window_is_as_long_as_its_periods_and_the_room_allow():
    # 3.5 periods of 100 samples: three
    assert carrier_windows(7, 357, 10.0, 1000.0, 1, 1) == [(7, 307)]
    assert carrier_windows(7, 357, 10.0, 1000.0, 3, 1) == [(7, 107), (107, 207), (207, 307)]
    # periods of 2.5 samples, rounded up to three, where two have room
    assert carrier_windows(0, 5, 400.0, 1000.0, 2, 1) == [(0, 2), (2, 4)]
    assert carrier_windows(0, 350, 10.0, 1000.0, 2, 175) == [(0, 100), (100, 200)]
    assert carrier_windows(0, 350, 10.0, 1000.0, 2, 176) == [(0, 300)]
    assert carrier_windows(0, 350, 10.0, 1000.0, 3, 0) == [(0, 100), (100, 200), (200, 300)]


def test_less_than_a_period_gives_none():
    assert carrier_windows(0, 10, 60.0, 1000.0, 4, 1) == []
    assert carrier_windows(0, 99, 10.0, 1000.0, 1, 1) == []
    assert carrier_windows(0, 100, 10.0, 1000.0, 1, 1) == [(0, 100)]


@given(
    st.integers(0, 1000),
    st.integers(1, 100_000),
    st.floats(0.5, 400),
    st.integers(1, 10),
    st.integers(1, 5000),
)
def test_windows_are_equal_ordered_and_inside(start, length, carrier_hz, n, least):
    windows = carrier_windows(start, start + length, carrier_hz, 1000.0, n, least)
    assert len(windows) <= n
    for (a, b), (c, _) in pairwise(windows):
        assert b <= c
        assert b - a == windows[0][1] - windows[0][0]
    for a, b in windows:
        assert start <= a < b <= start + length
        periods = (b - a) * carrier_hz / 1000
        # Whole to half a sample, or cut by the room that there is.
        assert abs(periods - round(periods)) <= carrier_hz / 1000 * 1.01
