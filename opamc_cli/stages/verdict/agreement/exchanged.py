"""Two phases exchanged: the current vector turns the other way, and motions fit the wrong way."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from opamc_cli.config.models import IdentifyConfig
from opamc_cli.signal.cycles.identification import identify_anywhere
from opamc_cli.stages.chain.cycles.axis import match_rule, segment_features
from opamc_cli.stages.verdict.agreement.findings import Finding
from opamc_cli.stages.verdict.agreement.measured import Measured

TURNED_ROUND = 2
"""Times as many segments that fit with the current turned the other way. Of exchanged phases next
to none fit as they are, but of a program that goes out and back over like ways nearly all do either
way: 28 and 30 of a healthy pallet's, 20 and 30."""


def exchanged(
    measured: Sequence[Measured], segments: pa.Table, reference: pa.Table, config: IdentifyConfig
) -> list[Finding]:
    """Find axes without a logged motion whose cycles fit better with the current turned round.

    Parameters
    ----------
    measured
        Axes of the runs.
    segments
        Rows of their segment table.
    reference
        Rows of the baseline's motion table that are its reference cycles.
    config
        When segments are a cycle.
    """
    rule = match_rule(config)
    if not rule.use_direction:
        return []
    found = []
    for own in measured:
        rows = segments.filter(
            pc.and_(pc.equal(segments["axis"], own.axis), pc.equal(segments["run"], own.run))
        )
        known = reference.filter(pc.equal(reference["axis"], own.axis))
        if not rows.num_rows or not known.num_rows or len(own.signal) != 3:
            continue
        if own.turning is not None:  # a logged motion has told it, see `findings`
            continue
        rows = rows.filter(pc.invert(rows["edge"]))
        features, cycle = segment_features(rows), segment_features(known)
        turned = replace(features, direction=-features.direction)
        as_is, reversed_ = (
            int(np.count_nonzero(identify_anywhere(cycle, each, rule).cycle >= 0))
            for each in (features, turned)
        )
        if reversed_ > TURNED_ROUND * as_is:
            why = (
                f"of {rows.num_rows} segments of axis {own.axis} {as_is} fit a motion of the "
                f"baseline, {reversed_} would if the current turned the other way: are two of its "
                "phases exchanged?"
            )
            found.append(Finding(own.run, own.axis, why, of_log=True))
    return found
