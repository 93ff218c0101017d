"""When nights make an alarm, by hand."""

import pytest

from opamc_cli.decision.trend.alarm import Episode, Night, episodes

S, N, U = Night(True), Night(False), Night(False, judged=False)
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
