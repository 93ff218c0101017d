"""When nights make an alarm, by hand."""

import random

import pytest

from opamc_cli.decision.trend.alarm import LATELY, Episode, Night, episodes, nights_to_go

S, N, U = Night(True), Night(False), Night(False, judged=False)
L = Night(True, large=True)
NEAR, ODD = Night(False, calm=False), Night(False, differs=True)


@pytest.mark.parametrize(
    ("nights", "expected"),
    [
        ([], []),
        ([S, N, N, S, N], []),
        ([N, S, S], [Episode(2, None)]),
        ([S, N, S, N, N, N], [Episode(2, 5)]),
        ([S, U, U, S], [Episode(3, None)]),
        ([N, Night(True, gross=True), N, N], [Episode(1, None)]),
        ([N, Night(True, gross=True), N, N, N], [Episode(1, 4)]),
        ([S, S, U, U, U], [Episode(1, None)]),
        # in the night of a signal only, and cleared by as many quiet nights as are looked at
        ([S, U, N, S, N, N, N, N], [Episode(3, 6)]),
        ([Night(False, gross=True), N], [Episode(0, None)]),
        ([Night(False, gross=True), N, N], [Episode(0, 2)]),
        ([S, S, N, N, N, S, S], [Episode(1, 4), Episode(6, None)]),
        # what is still near the limit ends nothing, and raises nothing
        ([S, S, N, N, NEAR, NEAR, S, N, N], [Episode(1, None)]),
        ([S, S, NEAR, NEAR, N], [Episode(1, 4)]),
        ([NEAR, NEAR, NEAR], []),
        # nor does a night that differs by itself, for whatever reason
        ([S, S, ODD, N, N], [Episode(1, None)]),
        ([S, S, ODD, N, N, N], [Episode(1, 5)]),
        ([ODD, ODD, ODD], []),
    ],
)
def test_two_of_three_nights_make_an_alarm(nights, expected):
    assert episodes(nights, 2, 3) == expected


@pytest.mark.parametrize(
    ("nights", "expected"),
    [
        ([L, N, N, N, L, N, N], []),
        ([L, N, N, N, L, N, N, N, L], [Episode(8, None, returns=True)]),
        # a small one is none of them, and one that was not judged is no night
        ([L, N, N, N, S, N, N, N, L], []),
        ([L, *[N] * 27, L, L], [Episode(29, None)]),
        ([L, *[N] * 14, L, *[N] * 13, L], [Episode(29, None, returns=True)]),
        ([L, *[N] * 14, L, *[N] * 14, L], []),
        ([L, *[N] * 14, L, *[U] * 9, *[N] * 13, L], [Episode(38, None, returns=True)]),
        # over when the first of them is past, and the next one is no third
        ([L, N, N, N, L, N, N, N, L, *[N] * 21], [Episode(8, None, returns=True)]),
        ([L, N, N, N, L, N, N, N, L, *[N] * 22], [Episode(8, LATELY, returns=True)]),
        # what lasts is an alarm of nights together, and over with them
        ([L, N, N, N, L, L, N, N, N], [Episode(5, 8)]),
    ],
)
def test_large_nights_that_come_back_make_an_alarm(nights, expected):
    assert episodes(nights, 2, 3) == expected


def test_an_alarm_waits_for_as_many_nights_as_end_it():
    draw = random.Random(5)
    seen = set()
    for _ in range(400):
        nights = draw.choices([N, S, L, ODD, NEAR, U], [9, 1, 2, 1, 1, 1], k=draw.randint(4, 60))
        found = episodes(nights, 2, 3)
        if not found or found[-1].cleared is not None:
            continue
        judged = [one for one in nights if one.judged]
        more = nights_to_go(judged, 2, 3, returns=found[-1].returns)
        seen.add((found[-1].returns, more > 3))
        ends = [
            episodes([*nights, *[N] * k], 2, 3)[len(found) - 1].cleared for k in (more - 1, more)
        ]
        assert (ends[0], ends[1] is not None) == (None, True)
    assert seen == {(False, False), (True, False), (True, True)}
