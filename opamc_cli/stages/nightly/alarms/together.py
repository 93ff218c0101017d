"""What is wrong with several recordings alike: one sentence, with how many and the first names."""

import re
from collections.abc import Iterable, Iterator, Sequence

from opamc_cli.storage.schemas.channels import axes_phrase

MOST_NAMES = 3
"""Recordings that are named of many."""

OF_RECORDING = re.compile(r"(?P<path>\S.*?\.parquet): (?P<why>.*)", re.DOTALL)
"""A sentence about one recording, as the errors of all stages begin."""

OF_SEVERAL = re.compile(r"\d+ recordings \(.*?\): ")
"""What `together` puts in the place of their names."""

AXIS = re.compile(r"\baxis (\d+)\b")
"""A joint that a sentence names."""

COUNT = re.compile(r"\d[\d.]*(?:%|(?: of \d+)? (?:segments?|samples?|motions?)\b)")
"""What differs from one recording to the next that lack the same."""


def together(reasons: Sequence[str]) -> list[str]:
    """Say once what is wrong with several recordings, in the order in which each is said last.

    Parameters
    ----------
    reasons
        Sentences; of those about a recording, "PATH: WHY", those that say the same are one. A
        recording is named by its file and folder: robot and night are said before.

    Examples
    --------
    >>> together(["a/1.parquet: is cut", "no more", "a/2.parquet: is cut"])
    ['no more', '2 recordings (a/1.parquet, a/2.parquet): is cut']
    """
    groups: dict[str, list[tuple[str, str]]] = {}
    for reason in _of_joints(dict.fromkeys(reasons)):
        found = OF_RECORDING.match(reason)
        path, why = (found["path"], found["why"]) if found else ("", reason)
        key = COUNT.sub("#", why) if path else reason
        groups[key] = [*groups.pop(key, ()), (path, why)]
    return [_said(group) for group in groups.values()]


def _of_joints(reasons: Iterable[str]) -> Iterator[str]:
    """Name the joints of which one recording lacks the same in one sentence, each with its own."""
    groups: dict[str, list[str]] = {}
    for reason in reasons:
        one = len(AXIS.findall(reason)) == 1 and OF_RECORDING.match(reason)
        key = AXIS.sub("axis #", COUNT.sub("#", reason)) if one else reason
        groups.setdefault(key, []).append(reason)
    for first, *others in groups.values():
        if others:
            rest = axes_phrase(sorted(int(AXIS.findall(other)[0]) for other in others))
            first = AXIS.sub(rf"\g<0> ({rest} likewise)", first)
        yield first


def kind(sentence: str) -> str:
    """Return a sentence without what differs from night to night: paths, names and numbers."""
    plain = OF_SEVERAL.sub("", sentence, count=1)
    return " ".join(word for word in plain.split() if not re.search(r"[\d/]", word))


def _said(group: Sequence[tuple[str, str]]) -> str:
    (path, why), n = group[-1], len(group)
    if not path:
        return why
    names = ["/".join(one.split("/")[-2:]) for one, _ in group[:MOST_NAMES]]
    if n == 1:
        return f"{names[0]}: {why}"
    more = f" and {n - MOST_NAMES} more" if n > MOST_NAMES else ""
    return f"{n} recordings ({', '.join(names)}{more}): {why}"
