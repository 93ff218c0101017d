"""Verdict, tables and report are of one diagnosis, for whoever looks at whatever time."""

import shutil
import threading
import time

import pyarrow.parquet as pq
import pytest

from tests.marks import long


@pytest.mark.long
def test_a_verdict_is_seen_with_its_report_or_not_at_all(opamc, baseline, tonight, tmp_path):
    """A poller must not take a verdict that the rest of the diagnosis could still change."""
    out, over = tmp_path / "out", threading.Event()
    seen: list[bool] = []

    def poll():
        while not over.is_set():
            if (out / "verdict.json").exists():
                seen.append((out / "report.html").exists())
            time.sleep(0.002)

    poller = threading.Thread(target=poll)
    poller.start()
    try:
        arguments = ("--baseline", baseline, "--target", tonight, "--out", out)
        ended = opamc("diagnose", *arguments, "--set", "joint.explain=false")
    finally:
        over.set()
        poller.join()
    assert ended.code == 0
    assert (out / "verdict.json").exists()
    assert all(seen)


@pytest.mark.parametrize("name", ["scores.parquet", long("target/patterns.parquet")])
def test_a_report_of_two_diagnoses_is_refused(opamc, diagnosed, tmp_path, name):
    out = shutil.copytree(diagnosed, tmp_path / "out", symlinks=True)
    assert opamc("report", "--out", out).code == 0
    table = pq.read_table(out / name)
    pq.write_table(table.slice(0, table.num_rows - 1), out / name)
    ended = opamc("report", "--out", out)
    assert ended.code == 3
    (sentence,) = ended.sentences
    assert f"{out / name}: is not the table that" in sentence
