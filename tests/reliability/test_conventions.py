"""Which way a joint counts, where its zero lies, its number and its unit move no verdict.

Metamorphic: nobody needs to know what the verdict should be, but that it stays what it is.
"""

import json
import re

import numpy as np
import pytest
from recordings import columns, record, reported

from tests.marks import long

pytestmark = pytest.mark.usefixtures("undrawn")

NIGHTS = 5
"""Of the baseline: fewer know too little of how far the course and the size of a current differ."""


def worn(found):
    """Grow the fluctuations of joint 2, of which most of its current then is."""
    for name in [n for n in found if n.startswith("axis2") and n[-1] in "abct"]:
        wave = 1 + 0.5 * np.sin(np.arange(len(found[name])) / 7)
        found[name] = (found[name] * wave).astype(np.float32)


def as_it_is(found):
    return found


def counted_backwards(found):
    """Mirror the joints: of phases, which then turn the other way, two change places."""
    swapped = {"b": "c", "c": "b"}
    return {
        name[:-1] + swapped.get(name[-1], name[-1]) if name[-2] == "_" else name: (
            values if name[-2] == "_" else -values
        )
        for name, values in found.items()
    }


def from_another_zero(found):
    return {n: v + 1.234 if n.endswith("position") else v for n, v in found.items()}


def numbered_otherwise(found):
    return {re.sub(r"\d", lambda number: "31"[int(number[0]) - 1], n): v for n, v in found.items()}


def in_another_unit(found):
    measured = {n: n[-2] == "_" or n.endswith("current") for n in found}
    return {n: values * np.float32(20) if measured[n] else values for n, values in found.items()}


def verdict(opamc, folder, made, told):
    """Return state, health index and cause of both joints, in the order of the untold robot."""

    def write(path, seed, alter):
        def afterwards(found):
            alter(found)
            other = told(dict(found))
            found.clear()
            found.update(other)

        record(path, seed, afterwards, made)

    for seed in range(NIGHTS):
        write(folder / "normal" / f"{seed}.parquet", seed, lambda _: None)
    write(folder / "tonight.parquet", 9, worn)
    ended = opamc(
        *("diagnose", "--baseline", folder / "normal", "--target", folder / "tonight.parquet"),
        *("--out", folder / "out", "--quiet"),
    )
    axes = json.loads((folder / "out" / "verdict.json").read_text())["axes"]
    axes.sort(key=lambda entry: entry["axis"], reverse=told is numbered_otherwise)
    return ended.code, [
        (entry["state"], entry["health_index"], (entry["cause"] or {}).get("effect"))
        for entry in axes
    ]


@pytest.mark.parametrize("made", [long(columns), reported], ids=lambda made: made.__name__)
def test_a_convention_of_the_log_moves_no_verdict(opamc, tmp_path, made):
    code, found = verdict(opamc, tmp_path / "as it is", made, as_it_is)
    assert (code, [state for state, *_ in found]) == (1, ["healthy", "fault"])
    for told in (counted_backwards, from_another_zero, numbered_otherwise, in_another_unit):
        other_code, others = verdict(opamc, tmp_path / told.__name__, made, told)
        assert other_code == code, told.__name__
        for (state, index, cause), (other_state, other_index, other_cause) in zip(
            found, others, strict=True
        ):
            assert (other_state, other_cause) == (state, cause), told.__name__
            # single precision and phases in another order round otherwise
            assert other_index == pytest.approx(index, rel=0.05, abs=0.1), told.__name__
