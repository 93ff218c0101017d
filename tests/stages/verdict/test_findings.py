"""What forbids a comparison, rule by rule."""

from types import SimpleNamespace

import pytest

from opamc_cli.stages.verdict.agreement.findings import _coarser


@pytest.mark.parametrize(
    ("usual", "tonight", "refused"),
    [(0.9, 0.1, True), (0.9, 0.4, False), (0.3, 0.05, False), (0.15, 0.8, False)],
)
def test_a_current_that_lost_its_steps_is_another_log_and_one_that_gained_some_may_knock(
    usual, tonight, refused
):
    own = SimpleNamespace(axis=2, changing=tonight)
    told = _coarser(own, SimpleNamespace(changing={2: usual}))
    assert (told is not None) == refused
    assert not refused or f"changes in {tonight:.0%} of its samples" in told
