"""Lines that are multiples of one: one event in its turn, and not a source for each."""

import pytest

from opamc_cli.stages.model.doubts import one_turn


@pytest.mark.parametrize(
    ("orders", "family"),
    [
        ([2.0, 3.0, 4.0, 5.0, 1.0], [1.0, 2.0, 3.0, 4.0, 5.0]),
        ([0.125, 0.25, 0.375, 6.0], [0.125, 0.25, 0.375]),
        ([24.0, 0.2501, 0.7502, 0.5003, 0.33], [0.2501, 0.5003, 0.7502]),
        ([1.0, 2.0, 4.0], []),  # eccentricity and kinematic error
        ([2.0, 2.02, 1.98], []),  # teeth
        ([1.0, 2.0, 3.1], []),
        ([2.0, 3.0], []),
        ([], []),
    ],
)
def test_a_family_has_its_first_second_and_third_order(orders, family):
    assert one_turn(orders) == family


def test_two_lines_close_together_hide_no_multiple():
    assert one_turn([1.0, 2.0, 3.0, 3.3, 2.6]) == [1.0, 2.0, 3.0]
