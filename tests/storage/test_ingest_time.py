from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.errors import InputError
from opamc_cli.stages.recordings import ingest
from opamc_cli.storage.ingest.convert import convert
from opamc_cli.storage.ingest.map.load import load_map
from opamc_cli.storage.ingest.map.map_file import IngestMap
from opamc_cli.storage.ingest.time.resample import resample
from opamc_cli.storage.ingest.time.stamps import examine
from opamc_cli.storage.runs import Run

FILE = Path("r.csv")


def clock_of(times_s, rate=None, gap=2.5):
    return examine(FILE, "t", np.asarray(times_s, dtype=float), rate, gap)


# -- are they even? ------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [1.0, 60.0, 999.7, 1000.0, 2048.0, 20_000.0])
@pytest.mark.parametrize("start", [0.0, -3.7, 1.7e9])
def test_even_stamps_give_their_rate(rate, start):
    clock = clock_of(start + np.arange(5000) / rate)
    assert clock.kept is None
    assert clock.n_samples == 5000
    assert clock.sampling_rate_hz == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize("offset", [0, 1024])  # rounded down, rounded to the nearest
def test_stamps_rounded_to_the_millisecond_are_even(offset):
    # 2048 Hz in ms: half of the stamps repeat the one before; with the rate declared they are
    # what even sampling gives
    times = (np.arange(20_000) * 1000 + offset) // 2048 / 1000
    assert clock_of(times, 2048).kept is None
    slower = (np.arange(20_000) * 1000 + offset % 300) // 300 / 1000
    clock = clock_of(slower)
    assert clock.kept is None
    assert clock.sampling_rate_hz == pytest.approx(300, rel=1e-6)


def test_a_missing_sample_is_not_taken_for_rounding():
    counted = np.delete(np.arange(1000.0), 500) / 1000
    clock = clock_of(counted, 1000)
    assert clock.kept is not None
    assert (clock.n_samples, clock.account.n_bridged, clock.account.n_gaps) == (1000, 1, 0)


def test_a_slow_clock_is_no_reason_to_touch_the_samples():
    clock = clock_of(np.arange(100_000) / 2048.3, 2048)
    assert clock.kept is None
    assert clock.sampling_rate_hz == 2048
    assert clock.account.measured_rate_hz == pytest.approx(2048.3)


def test_gaps_repeats_and_backward_steps_are_counted():
    times = np.arange(1000.0) / 100
    times[200:] += 0.5  # 51 periods
    times[400:] += 0.013  # a sample and a third
    times[600] = times[599]
    times[700] = times[650]
    times[800] = np.nan
    account = clock_of(times).account
    assert not account.even
    # the rows dropped at 600, 700 and 800 leave steps of two periods; so does the shift at 400
    assert (account.n_gaps, account.n_bridged) == (1, 4)
    assert account.longest_gap_s == pytest.approx(0.51)
    assert (account.n_duplicates, account.n_backward, account.n_unreadable) == (1, 1, 1)
    assert account.measured_rate_hz == pytest.approx(100)


@pytest.mark.parametrize(
    ("times", "rate", "expected"),
    [
        (
            np.r_[np.arange(500.0), np.arange(500.0)] / 100,
            None,
            "500 of 1000 rows (1 repeated, 499",
        ),
        (np.zeros(100), None, "99 of 100 rows"),
        (np.full(100, np.nan), None, "100 unreadable"),
        (np.arange(100.0) / 100, 200.0, "says 100 Hz, the map 200 Hz, more than 10% apart"),
        (np.r_[np.arange(50.0), 1e6 + np.arange(50.0)], 1.0, "it is mostly gap"),
        (np.r_[np.arange(99.0), 1e12], 1.0, "it is mostly gap"),
        ([0.0, 1.0], None, "2 rows are too few"),
        (-np.arange(100.0), None, "99 of 100 rows"),
    ],
)
def test_stamps_that_tell_no_time_are_refused(times, rate, expected):
    with pytest.raises(InputError) as caught:
        clock_of(times, rate)
    assert expected in str(caught.value)
    assert str(caught.value).startswith("r.csv: ")


# -- resampling ----------------------------------------------------------------------------


def resampled_slowly(times, values, grid, period, max_gap, cubic):
    """One grid point after the other, by the rules of the docstring."""
    out = []
    for g in grid:
        i = max(k for k in range(len(times) - 1) if times[k] <= g or k == 0)
        step = times[i + 1] - times[i]
        if g - times[i] <= 1e-3 * period:
            out.append(values[i])
        elif times[i + 1] - g <= 1e-3 * period:
            out.append(values[i + 1])
        elif step > max_gap:
            out.append(np.nan)
        else:
            line = values[i] + (values[i + 1] - values[i]) * (g - times[i]) / step
            four = range(i - 1, i + 3)
            smooth = cubic and i >= 1 and i + 2 < len(times)
            if smooth:
                steps = np.diff([times[k] for k in four])
                smooth = all(0.5 * period <= s <= 1.5 * period for s in steps)
                smooth = smooth and all(np.isfinite(values[k]) for k in four)
            if smooth:
                fit = np.polyfit([times[k] - g for k in four], [values[k] for k in four], 3)
                line = fit[-1]
            out.append(line)
    return np.array(out)


@settings(max_examples=150, deadline=None)
@given(
    steps=st.lists(st.floats(0.05, 4.0), min_size=3, max_size=40),
    cuts=st.lists(st.integers(1, 40), max_size=6),
    cubic=st.booleans(),
    missing=st.sets(st.integers(0, 40), max_size=3),
    seed=st.integers(0, 99),
)
def test_resampling_in_any_blocks_is_the_slow_rule(steps, cuts, cubic, missing, seed):
    times = np.concatenate([[0.0], np.cumsum(steps)])
    values = np.random.default_rng(seed).normal(size=len(times))
    values[[k for k in missing if k < len(values)]] = np.nan
    n = int(times[-1] + 1e-6) + 1
    edges = sorted({0, len(times), *(c for c in cuts if c < len(times))})
    blocks = [(times[a:b], {"x": values[a:b]}) for a, b in pairwise(edges)]
    fast = [block["x"] for block in resample(iter(blocks), 0.0, 1.0, n, 2.5, cubic)]
    slow = resampled_slowly(times, values, np.arange(n), 1.0, 2.5, cubic)
    np.testing.assert_allclose(np.concatenate(fast), slow, atol=1e-9)


def test_cubic_keeps_a_carrier_that_linear_interpolation_damps():
    rng = np.random.default_rng(3)
    times = np.arange(4000) / 2048 + rng.uniform(-0.2, 0.2, 4000) / 2048
    carrier = 2 * np.pi * 200
    grid = times[0] + np.arange(3990) / 2048
    worst = {}
    for cubic in (True, False):
        blocks = iter([(times, {"x": np.cos(carrier * times)})])
        found = [b["x"] for b in resample(blocks, times[0], 2048.0, 3990, 1.0, cubic)]
        worst[cubic] = np.abs(np.concatenate(found) - np.cos(carrier * grid))[5:-5].max()
    assert worst[True] < 0.02
    assert worst[False] > 3 * worst[True]


def test_nothing_is_invented_across_a_gap():
    times = np.r_[np.arange(10.0), 20 + np.arange(10.0)]
    blocks = resample(iter([(times, {"x": times})]), 0.0, 1.0, 30, 2.5)
    values = np.concatenate([block["x"] for block in blocks])
    assert np.isnan(values[10:20]).all()
    np.testing.assert_allclose(values[np.r_[:10, 20:30]], np.r_[:10, 20:30])


# -- angles --------------------------------------------------------------------------------


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


# -- from the file to the run ---------------------------------------------------------------


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
