"""Numbers that jump where their range ends, unwrapped block by block."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.convert import convert
from opamc_cli.storage.ingest.map.map_file import IngestMap

FILE = Path("a.csv")


@settings(max_examples=100)
@given(
    steps=st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=60),
    cut=st.integers(0, 60),
    missing=st.sets(st.integers(0, 60), max_size=10),
)
def test_unwrapping_in_blocks_is_numpys(steps, cut, missing):
    angle = np.cumsum(steps)
    wrapped = (angle + np.pi) % (2 * np.pi) - np.pi
    for k in missing:
        wrapped[k : k + 1] = np.nan
    channels = IngestMap.model_validate(
        {"columns": {"axis1_position": {"source": 0, "unit": "rad", "unwrap": True}}}
    )
    blocks = [{"axis1_position": part} for part in (wrapped[:cut], wrapped[cut:])]
    found = np.concatenate([b["axis1_position"] for b in convert(FILE, blocks, channels)])
    known = np.isfinite(wrapped)
    np.testing.assert_allclose(found[known], np.unwrap(wrapped[known]), atol=1e-9)
    assert np.isnan(found[~known]).all()


def test_a_motors_single_turn_is_unwrapped_before_it_is_scaled():
    counts = np.arange(0, 9000, 100) % 4096
    column = {"source": 0, "unit": "deg", "unwrap": 4096, "scale": 360 / 4096 / 100, "offset": 5}
    channels = IngestMap.model_validate({"columns": {"axis1_position": column}})
    (block,) = convert(FILE, [{"axis1_position": counts.astype(float)}], channels)
    expected = np.radians(np.arange(0, 9000, 100) * 360 / 4096 / 100 + 5)
    np.testing.assert_allclose(block["axis1_position"], expected)


SIGNED = np.round(6000 * np.sin(np.arange(500) / 40))


def _current(values, **extra):
    channels = IngestMap.model_validate(
        {"columns": {"axis1_current": {"source": "i", "unit": "mA", **extra}}}
    )
    blocks = [{"axis1_current": part} for part in np.array_split(values, 3)]
    return np.concatenate([b["axis1_current"] for b in convert(FILE, blocks, channels)])


def test_currents_that_were_logged_without_their_sign_are_refused_until_the_map_says_so():
    with pytest.raises(
        InputError, match=r"a.csv: column axis1_current \(source 'i'\).*unwrap: 65536"
    ):
        _current(SIGNED % 65536)
    # From the first sample on, which may be a negative one.
    for values in (SIGNED, -SIGNED - 1):
        assert _current(values % 65536, unwrap=65536) == pytest.approx(values / 1000)


@pytest.mark.parametrize(
    "honest",
    [SIGNED, np.abs(SIGNED), SIGNED + 32768, SIGNED % 65536 + 0.5, np.full(5, np.nan)],
    ids=["signed", "positive", "around the middle", "fractions", "nothing"],
)
def test_honest_currents_are_taken_as_they_are(honest):
    np.testing.assert_allclose(_current(honest), honest / 1000)
