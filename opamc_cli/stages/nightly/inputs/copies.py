"""Recordings that are there twice: of an earlier night, by a logger which is stuck, or by hand."""

from collections.abc import Iterator, Sequence
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


def twins(recordings: Sequence[Recording]) -> Iterator[tuple[Recording, Recording]]:
    """Yield each recording that is one of its own night once more, and that one, by their paths.

    Somebody has copied a file. One that says to have begun at another time is none of these: its
    logger was stuck, and what it should hold is missing.
    """
    first: dict[tuple[str, str, str | None], Recording] = {}
    for one in sorted(recordings, key=lambda one: one.log.path):
        if not one.facts.error:
            key = one.night, one.facts.samples or one.sha256, one.facts.started_at
            if first.setdefault(key, one) is not one:
                yield one, first[key]
