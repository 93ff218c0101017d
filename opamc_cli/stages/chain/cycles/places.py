"""Reference cycles whose motions lead to their places, but where the program's do not."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from opamc_cli.signal.cycles.features import MatchRule
from opamc_cli.signal.cycles.identification import (
    UNIDENTIFIED,
    identify_anywhere,
)
from opamc_cli.signal.cycles.reference import MOSTLY
from opamc_cli.stages.chain.cycles.axis import (
    Axis,
    usable_segments,
    whole_segments,
)
from opamc_cli.stages.chain.cycles.reference import (
    Reference,
)

AT_PLACES = 0.5
"""Of the segments that are told wherever they lead, which have to lead to their places: of a long
cycle, such as a pallet's, both ends of a recording hold a part. Else the program goes elsewhere
each time, as one does that a camera guides."""

APART = 5.0
"""Times what nine in ten of a motion's turns deviate from its middle by, by which motions that are
told as one have to differ: noise alone makes that 0.6 to 5.7 in groups of two (1.9 in the middle of
300 made-up recordings), a pallet 12 to 30."""


def references_of_places(
    parts: Sequence[Axis],
    found_in: Callable[[Sequence[Axis]], dict[int, Reference]],
    rule: MatchRule,
) -> dict[int, Reference]:
    """Find reference cycles whose motions lead to their places, but where the program's do not."""
    anywhere = [replace(part, features=part.features.anywhere()) for part in parts]
    loose = found_in(anywhere)
    if not any(part.features.leads_by for part in parts):
        return loose
    strict = found_in(parts)
    for axis, reference in loose.items():
        of_axis = [pair for pair in zip(anywhere, parts, strict=True) if pair[1].axis == axis]
        told = [_told(bare, reference, rule) for bare, _ in of_axis]
        led = [_told(part, strict[axis], rule) for _, part in of_axis]
        known, kept = (sum(int(np.count_nonzero(t >= 0)) for t in each) for each in (told, led))
        if kept < AT_PLACES * known:
            continue
        if strict[axis].features.leads_by == "turns":
            whole = [whole_segments(part) for _, part in of_axis]
            turns = [part.features.turns for _, part in of_axis]
            if not mixes(*(_joined(each, whole) for each in (turns, told, led))):
                continue
        loose[axis] = strict[axis]
    return loose


def _joined(
    values: Sequence[npt.NDArray[Any] | None], which: Sequence[npt.NDArray[np.int64]]
) -> npt.NDArray[Any]:
    return np.concatenate([np.asarray(of)[i] for of, i in zip(values, which, strict=True)])


def mixes(
    turns: npt.NDArray[np.float64], told: npt.NDArray[np.int64], led: npt.NDArray[np.int64]
) -> bool:
    """Tell whether segments are told as one motion that turn by other amounts, each time again.

    Turns, unlike places, scatter where noise hides the current: by others than a motion's own
    repetitions do, or it is no other motion.

    Parameters
    ----------
    turns
        Of each segment.
    told, led
        Which motion it is of a cycle that was found without its turns, and with them.
    """
    both = (told > UNIDENTIFIED) & (led > UNIDENTIFIED)
    turns, told, led = turns[both], told[both], led[both]
    motions, of, count = np.unique(led, return_inverse=True, return_counts=True)
    middle = np.array([np.median(turns[led == motion]) for motion in motions])
    again = count[of] > 1
    if not again.any():
        return False
    own = float(np.quantile(np.abs(turns - middle[of])[again], MOSTLY))
    apart = max(float(np.ptp(middle[np.unique(of[told == one])])) for one in np.unique(told))
    return apart > APART * own


def _told(part: Axis, reference: Reference, rule: MatchRule) -> npt.NDArray[np.int64]:
    """Return which motion of a reference each segment of an axis is."""
    told, usable = np.full(len(part.features), UNIDENTIFIED), usable_segments(part, reference.edges)
    own = part.features.take(usable)
    told[usable] = identify_anywhere(reference.features, own, rule).motion
    return told
