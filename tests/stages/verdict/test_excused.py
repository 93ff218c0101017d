"""A joint that differs, but no more than conditions may move it, is not passed over in silence."""

import math
from dataclasses import replace

import numpy as np
import pytest

from opamc_cli.commands.terminal.tables import verdict_lines, verdict_table
from opamc_cli.config.models import ScoreConfig
from opamc_cli.decision.judge import judge
from opamc_cli.errors import ExitCode
from opamc_cli.stages.chain.compared.pattern_rows import PatternRows
from opamc_cli.stages.verdict.agreement.unjudged import with_reasons
from opamc_cli.stages.verdict.verdict import _warmer_c, exit_code
from opamc_cli.stages.verdict.wording.reasons import is_excused, reasons
from tests.decision import known_fleet

SAID = "It differs from its baseline (p 0.001, 3 times as far as a healthy session), but no more"


def axis(number, state="healthy", **more):
    return {"axis": number, "state": state, "excused": False, "reasons": [], **more}


@pytest.fixture(scope="module")
def differing():
    """Return a healthy joint that lies far out, and what is known of it."""
    bundle = known_fleet.bundle(4, 6, 1, (), 0.0)
    one = judge({4: bundle})[4]
    changes = {"p_adjusted": 1e-3, "p_alone": 0.2, "allowed_log_ratio": 1.0, "distance_ratio": 3.0}
    return replace(one, state="healthy", **changes), bundle


def test_it_is_one_that_would_be_unhealthy_but_for_what_was_allowed(differing):
    one, limits = differing[0], ScoreConfig()
    assert is_excused(one, limits)
    assert not is_excused(replace(one, p_adjusted=0.02), limits)
    assert not is_excused(one, ScoreConfig(minimum_effect=1.0, fault_effect=1.0))
    assert not is_excused(replace(one, state="changed"), limits)


def test_its_first_reason_says_that_a_fault_may_look_alike(differing):
    one, bundle = differing
    entries = [
        {
            **{"motion": cell.motion, "order": cell.order, "tau": cell.tau},
            **{"jsd_baseline": [0.02], "jsd_target": [0.03]},
        }
        for cell in bundle.cells
    ]
    sides = {"baseline": [], "target": []}
    first, *_ = reasons(one, bundle, entries, sides)
    assert first.startswith(SAID)
    assert "may move it: a fault that looks alike would not be told" in first
    cold, *_ = reasons(one, bundle, entries, sides, warmer_c=-12.2)
    assert "may move it (logged: 12 °C colder): a fault" in cold


@pytest.mark.parametrize(
    ("usual", "now", "said"),
    [
        ((15.0, 19.0), (7.0, 9.0), -9.0),
        ((15.0, 19.0), (15.0, 17.0), 0.0),  # as it has been
        ((16.0, 18.0), (18.0, 19.0), 0.0),  # hardly beyond
        ((15.0, math.nan), (25.0, math.nan), 10.0),
        ((math.nan, math.nan), (25.0, 25.0), None),
    ],
)
def test_warmth_is_said_where_the_baseline_never_had_it(usual, now, said):
    before, after = (
        {(2, 0, 4, 1): PatternRows({"temperature_c": np.array(side)}, np.ones((2, 24)), np.ones(2))}
        for side in (usual, now)
    )
    assert _warmer_c(2, before, after) == said
    assert _warmer_c(3, before, after) is None


def test_it_does_not_end_as_health_does_and_a_fault_still_wins():
    """Of a robot whose joints all had twice the friction a scheduler saw 0."""
    excused = axis(2, excused=True)
    assert exit_code({"axes": [axis(1), axis(2)]}) is ExitCode.DONE
    assert exit_code({"axes": [axis(1), excused]}) is ExitCode.NOT_ENOUGH_DATA
    assert exit_code({"axes": [excused, axis(3, "fault")]}) is ExitCode.UNHEALTHY


def test_one_that_is_not_judged_for_another_reason_is_not_excused():
    verdict = with_reasons({"axes": [axis(2, excused=True)]}, {2: ["too far"], 5: ["at rest"]})
    assert [one["excused"] for one in verdict["axes"]] == [False, False]


def test_it_is_a_line_and_is_not_counted_as_healthy(capsys):
    from opamc_cli.commands.terminal.output import Output

    verdict = {"axes": [axis(1), axis(2, excused=True, reasons=[SAID, "More."]), axis(3)]}
    assert [line.plain for line in verdict_lines(verdict)] == [
        "Axis 2 not told from unusual conditions; the other 2 axes healthy",
        f"axis 2: {SAID}",
    ]
    Output().result({}, verdict_table(verdict))
    assert SAID in " ".join(capsys.readouterr().out.split())
