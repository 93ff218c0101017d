"""Angles that jump by a turn, unwrapped block by block."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.storage.ingest.convert import convert
from opamc_cli.storage.ingest.map.map_file import IngestMap


@settings(max_examples=100, deadline=None)
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
    found = np.concatenate([b["axis1_position"] for b in convert(blocks, channels)])
    known = np.isfinite(wrapped)
    np.testing.assert_allclose(found[known], np.unwrap(wrapped[known]), atol=1e-9)
    assert np.isnan(found[~known]).all()


def test_a_motors_single_turn_is_unwrapped_before_it_is_scaled():
    counts = np.arange(0, 9000, 100) % 4096
    column = {"source": 0, "unit": "deg", "unwrap": 4096, "scale": 360 / 4096 / 100, "offset": 5}
    channels = IngestMap.model_validate({"columns": {"axis1_position": column}})
    (block,) = convert([{"axis1_position": counts.astype(float)}], channels)
    expected = np.radians(np.arange(0, 9000, 100) * 360 / 4096 / 100 + 5)
    np.testing.assert_allclose(block["axis1_position"], expected)
