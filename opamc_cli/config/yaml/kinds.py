"""Which kind of document a YAML file is, by its keys, so that one in another's place is told."""

from collections.abc import Mapping
from typing import Any

KEYS = {
    "configuration": ("joint", "segment", "identify", "patterns", "score", "report"),
    "testbed": ("robot", "program", "recording", "faults", "effects", "based_on"),
    "map": ("columns", "time", "sampling_rate_hz", "resample_hz", "format", "separator", "header"),
    "model": ("joint", "effects", "arm", "library", "without"),
    "cell": ("runs", "robots", "baseline", "out", "alarm", "keep"),
}
"""Top keys by kind of document; `joint` alone makes a configuration."""

USES = {
    "configuration": "the options of the stages, for --config",
    "testbed": "a virtual testbed, for `opamc simulate --config`",
    "map": "a map, for `opamc ingest --map`",
    "model": "a joint's model, for `opamc model --model`",
    "cell": "a cell of robots, for `opamc nightly`",
}
"""What each kind is, and what reads it."""


def kind_of(values: Mapping[str, Any]) -> str | None:
    """Return the kind of document that a YAML file's top keys make, None where none fits.

    Examples
    --------
    >>> kind_of({"robot": {}, "program": {}}), kind_of({"joint": {}}), kind_of({"a": 1})
    ('testbed', 'configuration', None)
    """
    shared = {kind: len(set(keys) & set(values)) for kind, keys in KEYS.items()}
    most = max(shared, key=lambda kind: shared[kind])
    return most if shared[most] else None
