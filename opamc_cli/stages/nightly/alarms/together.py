"""What is wrong with several recordings alike: one sentence, with how many and the first names."""

import re
from collections.abc import Sequence

MOST_NAMES = 3
"""Recordings that are named of many."""

OF_RECORDING = re.compile(r"(?P<path>\S.*?\.parquet): (?P<why>.*)", re.DOTALL)
"""A sentence about one recording, as the errors of all stages begin."""

OF_SEVERAL = re.compile(r"\d+ recordings \(.*?\): ")
"""What `together` puts in the place of their names."""

COUNT = re.compile(r"\d[\d.]*(?:%|(?: of \d+)? (?:segments?|samples?)\b)")
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
    for reason in dict.fromkeys(reasons):
        found = OF_RECORDING.match(reason)
        path, why = (found["path"], found["why"]) if found else ("", reason)
        key = COUNT.sub("#", why) if path else reason
        groups[key] = [*groups.pop(key, ()), (path, why)]
    return [_said(group) for group in groups.values()]


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
