"""Recordings of an earlier night that a logger which is stuck has written again."""

from collections.abc import Sequence
from dataclasses import replace

from opamc_cli.stages.nightly.inputs.recordings import Recording
from opamc_cli.storage.logs import Facts


def without_copies(recordings: Sequence[Recording]) -> list[Recording]:
    """Have recordings of an earlier night stand for nothing.

    Parameters
    ----------
    recordings
        All of a robot's.

    Returns
    -------
    list of Recording
        A copy has the bytes of an earlier one, or its currents' samples whatever it says of
        itself: it tells no more than what it is a copy of.
    """
    first: dict[str, Recording] = {}
    for one in sorted(recordings, key=lambda one: (one.night, one.log.path)):
        if not one.facts.error:
            first.setdefault(one.sha256, one)
            first.setdefault(one.facts.samples or one.sha256, one)
    found = []
    for one in recordings:
        alike = [first.get(content, one) for content in (one.sha256, one.facts.samples)]
        original = next((each for each in alike if each.night != one.night), None)
        if original is not None and not one.facts.error:
            error = f"{one.log.path}: is a copy of {original.log.path}; was that night recorded?"
            one = replace(one, facts=Facts(error=error))
        found.append(one)
    return found
