"""What a maintainer is told of a joint, where that is not the terminal's to test."""

from dataclasses import replace

from opamc_cli.decision.judge import Bundle, judge
from opamc_cli.stages.verdict.reasons import reasons
from tests.decision.fleet import Fleet, cells


def test_a_joint_that_unusual_conditions_excuse_is_told_so():
    """Never for a fault, which lies far along by itself."""
    own = cells(Fleet(n_axes=1), 0)[1]
    judged = judge({1: Bundle(own)})[1]
    entries = [
        {
            **{"motion": cell.motion, "order": cell.order, "tau": cell.tau},
            **{"jsd_baseline": [0.02], "jsd_target": [0.03]},
        }
        for cell in own
    ]
    said = {}
    for state, unusual in (("healthy", 0.2), ("healthy", 2.0), ("fault", 2.0)):
        one = replace(judged, state=state, unusual_log_ratio=unusual)
        text = " ".join(reasons(one, Bundle(own), entries, {"baseline": [], "target": []}))
        said[state, unusual] = "Conditions were unusual" in text
    assert said == {("healthy", 0.2): False, ("healthy", 2.0): True, ("fault", 2.0): False}
