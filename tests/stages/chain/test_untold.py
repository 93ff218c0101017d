"""Recordings of which no motion can be told: said, and no exit code 0."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

RATE = 400


def stroke(path, lasts_s, rest_s):
    """One stroke of 2.7 rad with some rest on either side; a motor current that is reported."""
    rest, moving = round(rest_s * RATE), round(lasts_s * RATE)
    part = np.clip((np.arange(2 * rest + moving) - rest) / moving, 0, 1)
    position = 2.7 * (part - np.sin(2 * np.pi * part) / (2 * np.pi))
    turning = (part > 0) & (part < 1)
    noise = np.random.default_rng(moving).normal(scale=0.02, size=part.size)
    current = np.where(turning, 0.5 + 0.2 * np.cos(np.pi * part), 0.05) + noise
    table = pa.table({"axis1_current": current.astype("f4"), "axis1_position": position})
    metadata = {"opamc": json.dumps({"sampling_rate_hz": RATE})}
    pq.write_table(table.replace_schema_metadata(metadata), path)


@pytest.mark.parametrize(
    ("rest_s", "lasts_s", "why"),
    [
        (0.02, (0.5, 0.5, 0.65, 0.65), "may have cut it, and they last 0."),
        (
            0.02,
            (0.5,),
            "may have cut it; record at least two cycles, or more rest before and after\n",
        ),
        (0.02, (0.5, 0.5, 0.5), None),
        (0.5, (0.5, 0.5, 0.5), None),
    ],
)
def test_strokes_that_begin_with_their_recordings_are_told_or_said(
    opamc, tmp_path, rest_s, lasts_s, why
):
    for number, each_s in enumerate(lasts_s):
        stroke(tmp_path / f"s{number}.parquet", each_s, rest_s)
    assert opamc("segment", tmp_path / "*.parquet", "--out", tmp_path, "--quiet").code == 0
    told = opamc("identify", "--out", tmp_path, "--json")
    assert len(json.loads(told.out)["series"]) == len(lasts_s)
    counted = opamc("patterns", "--out", tmp_path, "--quiet")
    assert told.code == counted.code == (5 if why else 0)
    assert (why in told.err and "no motion is told" in counted.err) if why else not told.sentences


def test_a_baseline_of_strokes_that_cannot_be_told_is_refused_for_its_own_reason(opamc, tmp_path):
    for number, each_s in enumerate((0.5, 0.65, 0.65, 0.5)):
        stroke(tmp_path / f"s{number}.parquet", each_s, 0.02)
    baseline, target = tmp_path / "s[012].parquet", tmp_path / "s3.parquet"
    ended = opamc("diagnose", "--baseline", baseline, "--target", target, "--out", tmp_path / "d")
    assert ended.code == 5
    assert (
        "holds no reference cycle: no motion repeats: each begins or ends within 0.05" in ended.err
    )
