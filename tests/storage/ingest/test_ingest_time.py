"""Times of a recording: from its file to the run."""

import re

import numpy as np
import pytest

from opamc_cli.errors import InputError
from opamc_cli.stages.recordings import ingest
from opamc_cli.storage.ingest.map.load import load_map
from opamc_cli.storage.runs.run import Run


def ingested(tmp_path, rows, time, extra=""):
    file = tmp_path / "r.csv"
    file.write_text("t,i\n" + "".join(f"{t},{i}\n" for t, i in rows))
    path = tmp_path / "map.yaml"
    path.write_text(f"time: {time}\ncolumns: {{axis1_a: {{source: i, unit: A}}}}\n{extra}")
    outcome = ingest.run([file], load_map(path), tmp_path / "out")
    if outcome.errors:
        raise outcome.errors[0]
    return outcome.results[0]


@pytest.mark.parametrize(
    ("unit", "factor"), [("s", 1), ("ms", 1e3), ("us", 1e6), ("ns", 1e9), ("µs", 1e6)]
)
def test_units_of_time(tmp_path, unit, factor):
    rows = [(f"{k / 500 * factor:.6f}", k) for k in range(100)]
    assert ingested(tmp_path, rows, f"{{source: t, unit: {unit}}}").sampling_rate_hz == 500


@pytest.mark.parametrize(
    ("unit", "start", "per_s"),
    [
        ("filetime", 134_051_106_000_000_000, 1e7),
        ("ticks", 638_962_722_000_000_000, 1e7),
        ("days", 45953.9166666667, 1 / 86_400),
    ],
)
def test_counts_from_another_day_than_1970_tell_the_start(tmp_path, unit, start, per_s):
    rows = [(f"{start + k / 4 * per_s:.10f}", k) for k in range(100)]
    extra = "metadata: {started_at: {source: t}}\n"
    item = ingested(tmp_path, rows, f"{{source: t, unit: {unit}}}", extra)
    assert item.sampling_rate_hz == pytest.approx(4, rel=1e-6)
    assert Run(item.run).info.started_at.startswith("2025-10-")
    # in another unit they are another year's, or of no log's rate
    with pytest.raises(
        InputError, match=r"no log is of|is not in s; correct|must be a date and time"
    ):
        ingested(tmp_path, rows, f"{{source: t, unit: {'s' if unit == 'days' else 'us'}}}", extra)


def test_dates_with_a_gap(tmp_path):
    seconds = [*range(20), *range(30, 50)]
    rows = [(f"2022-10-26T08:{17 + s // 60}:{s % 60:02}.5Z", s) for s in seconds]
    item = ingested(tmp_path, rows, "{source: t, unit: iso8601}")
    assert (item.sampling_rate_hz, item.n_samples) == (1, 50)
    values = Run(item.run).read(["axis1_a"])["axis1_a"]
    np.testing.assert_allclose(values[np.r_[:20, 30:50]], seconds)
    assert item.missing == {"axis1_a": 10}
    assert item.stamps.n_gaps == 1


def test_dates_with_a_decimal_comma(tmp_path):
    rows = [(f'"2022-10-26T08:17:{s:02},250Z"', s) for s in range(20)]
    item = ingested(tmp_path, rows, "{source: t, unit: iso8601}")
    assert (item.sampling_rate_hz, item.n_samples, item.stamps.even) == (1, 20, True)
    rows[5] = ("", 5)
    item = ingested(tmp_path, rows, "{source: t, unit: iso8601}")
    assert (item.n_samples, item.stamps.n_unreadable, item.stamps.n_bridged) == (20, 1, 1)
    rows[5] = ('"2022-10-26,half past"', 5)
    with pytest.raises(InputError, match=r"r\.csv: 't' is not ISO 8601"):
        ingested(tmp_path, rows, "{source: t, unit: iso8601}")


def test_text_that_is_no_date_is_refused(tmp_path):
    rows = [("2022-10-26T08:17:21Z", 1), ("yesterday", 2), ("2022-10-26T08:17:23Z", 3)]
    with pytest.raises(InputError, match=r"r\.csv: column t holds 'yesterday' in line 3"):
        ingested(tmp_path, rows, "{source: t, unit: iso8601}")


def test_uneven_stamps_end_on_the_grid(tmp_path):
    rng = np.random.default_rng(0)
    times = np.arange(3000) / 1000 + rng.uniform(-2e-4, 2e-4, 3000)
    rows = [(f"{t:.7f}", np.sin(40 * t)) for t in times]
    item = ingested(tmp_path, rows, "{source: t, unit: s}", "sampling_rate_hz: 1000\n")
    run = Run(item.run)
    assert run.sampling_rate_hz == 1000
    grid = times[0] + np.arange(run.n_samples) / 1000
    np.testing.assert_allclose(run.read(["axis1_a"])["axis1_a"], np.sin(40 * grid), atol=2e-4)
    assert not item.missing


@pytest.mark.parametrize("slower", [2, 4])
def test_a_rate_that_changes_midway_is_refused(tmp_path, slower):
    fast, slow = np.arange(3000) / 1000, 3 + np.arange(1500) * slower / 1000
    for stamps, row in ((np.r_[fast, slow], 3001), (np.r_[slow - 3, fast + 1.5 * slower], 1501)):
        rows = [(f"{t:.6f}", 1) for t in stamps]
        said = rf"Hz up to row {row} and [\d.]+ Hz from there: the rate changes; split"
        with pytest.raises(InputError, match=said):
            ingested(tmp_path, rows, "{source: t, unit: s}")


def test_where_the_rate_changes_is_found_among_jitter_gaps_and_repeated_stamps(tmp_path):
    rng = np.random.default_rng(0)
    stamps = np.r_[np.arange(5000) / 500, 10 + np.arange(2000) / 250]
    stamps += rng.uniform(-4e-4, 4e-4, stamps.size)
    stamps[1000:] += 0.5
    stamps[2000:2010] = stamps[1999]
    rows = [(f"{t:.6f}", 1) for t in stamps]
    with pytest.raises(InputError, match=r"Hz up to row 500[012] and [\d.]+ Hz from there"):
        ingested(tmp_path, rows, "{source: t, unit: s}")


def test_lost_samples_here_and_there_are_no_other_rate(tmp_path):
    rng = np.random.default_rng(0)
    stamps = np.delete(np.arange(8000) / 1000, rng.choice(8000, 400, replace=False))
    stamps += rng.normal(0, 1e-4, stamps.size)
    item = ingested(tmp_path, [(f"{t:.6f}", 1) for t in np.sort(stamps)], "{source: t, unit: s}")
    assert item.lost is None


def test_samples_lost_close_together_are_no_other_rate(tmp_path):
    rng = np.random.default_rng(0)
    stamps = np.delete(np.arange(800) / 1000, 300 + rng.choice(100, 34, replace=False))
    item = ingested(tmp_path, [(f"{t:.3f}", 1) for t in stamps], "{source: t, unit: s}")
    assert item.sampling_rate_hz == pytest.approx(1000, rel=0.05)


@pytest.mark.parametrize(
    ("stamps", "said"),
    [
        (lambda t: np.r_[t[:5000], t[4700:]], r"go back or repeat in rows of 0.3 s"),
        (lambda t: np.r_[t[:9700], t[9700:] - 3], r"go back or repeat in rows of 0.3 s"),
        (lambda t: np.r_[t[:5000], t[5000:] + 3], r"1 gap, of 3 s at most, left as NaN"),
    ],
)
def test_a_part_that_is_lost_is_said_when_quiet(tmp_path, opamc, stamps, said):
    file, out = tmp_path / "r.csv", tmp_path / "out"
    times = stamps(np.arange(10000) / 1000)
    file.write_text("t,i\n" + "".join(f"{t:.6f},{k % 7}\n" for k, t in enumerate(times)))
    path = tmp_path / "map.yaml"
    path.write_text("time: {source: t, unit: s}\ncolumns: {axis1_a: {source: i, unit: A}}\n")
    ended = opamc("ingest", file, "--map", path, "--out", out, "--quiet")
    assert (ended.code, out.exists()) == (4, True)
    assert re.search(said, ended.err)


@pytest.mark.parametrize(("column", "known", "code"), [("a", 20, 4), ("a", 60, 0), ("t", 2, 0)])
def test_a_channel_that_is_empty_for_most_of_a_recording_is_said_when_quiet(
    tmp_path, opamc, column, known, code
):
    """An axis of which five seconds of 37 were there was silence; a temperature may be rare."""
    file, path = tmp_path / "r.csv", tmp_path / "map.yaml"
    full = {"a": 100, "t": 100} | {column: known}
    rows = (",".join(str(k % 7) if k < full[of] else "" for of in "at") for k in range(100))
    file.write_text("i,c\n" + "".join(f"{row}\n" for row in rows))
    path.write_text(
        "sampling_rate_hz: 100\ncolumns: {axis1_a: {source: i, unit: A}, "
        "axis1_temperature: {source: c, unit: degC}}\n"
    )
    ended = opamc("ingest", file, "--map", path, "--out", tmp_path / "out", "--quiet")
    assert ended.code == code
    assert ("column axis1_a (source 'i') has no value in 80% of the rows" in ended.err) == bool(
        code
    )


def test_a_date_before_1970_is_none_of_a_log(tmp_path):
    """The year 0026 passed, and its night was that of its folder."""
    rows = [(f"0026-03-01T20:00:00.{k:02d}Z", k % 7) for k in range(100)]
    extra = "metadata: {started_at: {source: t}}\n"
    with pytest.raises(InputError, match=r"no log is of 0026-03-01T.*year in four digits"):
        ingested(tmp_path, rows, "{source: t, unit: iso8601}", extra)
