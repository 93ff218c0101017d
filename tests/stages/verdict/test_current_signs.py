"""Signs of a reported current, and of a current vector's turning beside a logged motion."""

import numpy as np
import pyarrow as pa
import pytest

from opamc_cli.stages.verdict.agreement.findings import findings, reference_of
from opamc_cli.stages.verdict.agreement.measured import LONGEST_LOOK, measure
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.storage.sources import RunSource

RATE_HZ = 100.0
REST = 50


def measured(folder, name, moves, *, load=0.0, alter=lambda current: current):
    """Measure a balanced joint's axis 1 through moves, each (sense of rotation, samples)."""
    speeds, spans, n = [np.zeros(REST)], [], REST
    for sense, length in moves:
        speeds += [sense * (1 + length % 7) * np.hanning(length), np.zeros(REST)]
        spans.append((n + 1, n + length - 1))
        n += length + REST
    v = np.concatenate(speeds)
    noise = 0.02 * np.random.default_rng(len(moves)).normal(size=v.size)
    columns = {
        "axis1_current": alter(2 * np.sign(v) + 0.1 * v + load + noise).astype(np.float32),
        "axis1_position": np.cumsum(v) / RATE_HZ,
    }
    info, path = RunInfo(sampling_rate_hz=RATE_HZ), folder / f"{name}.parquet"
    save_run(path, info, columns)
    starts, stops = zip(*spans, strict=True)
    of_run = {"run": [name] * len(spans), "axis": [1] * len(spans), "start": starts, "stop": stops}
    of_run["edge"] = [False] * len(spans)
    (own,) = measure([RunSource(name, path, "", n, info)], pa.table(of_run))
    return own


def there_and_back(count, length=100):
    return [((-1) ** k, length + k % 4) for k in range(count)]


def refusal(own, *usual):
    return " ".join(found.why for found in findings([own], reference_of(usual)))


@pytest.mark.parametrize("count", [9, 16, 32, 64])
def test_a_signed_current_has_its_sign_wherever_its_recording_is_cut(tmp_path, count):
    """Every second motion of sixteen goes the same way; so does every fourth of 32."""
    usual = measured(tmp_path, "usual", there_and_back(7))
    own = measured(tmp_path, "own", there_and_back(count))
    reference = reference_of([usual])
    assert refusal(own, usual) == ""
    assert own.reversing == pytest.approx(0.5, abs=0.1)
    assert own.size["current"] == pytest.approx(usual.size["current"], rel=0.1)
    assert refusal(usual, own) == ""
    unsigned = measured(tmp_path, "unsigned", there_and_back(count), alter=np.abs)
    assert "has lost its sign" in refusal(unsigned, usual)
    turned = measured(tmp_path, "turned", there_and_back(count), alter=np.negative)
    assert "inverted" in refusal(turned, usual)
    of_log = [found.of_log for each in (unsigned, turned) for found in findings([each], reference)]
    assert of_log == [True, True]


def test_motions_longer_than_what_is_looked_at_are_seen_both_ways(tmp_path):
    own = measured(tmp_path, "own", there_and_back(16, 2 * LONGEST_LOOK))
    assert own.reversing == pytest.approx(0.5, abs=0.1)


def test_a_recording_of_one_way_alone_shows_one_sign(tmp_path):
    """It is no modulus, and a load that pulls it down the whole way does not turn its current."""
    both = measured(tmp_path, "both", there_and_back(8))
    loaded = measured(tmp_path, "loaded", there_and_back(8), load=1.5)
    forth = measured(tmp_path, "forth", [(1, 100)])
    down = measured(tmp_path, "down", [(-1, 100)], load=2.5)
    assert refusal(forth, both) == refusal(both, forth) == ""
    assert refusal(down, loaded) == refusal(loaded, down) == ""
    # where both sides go one way alone they are asked as ever
    turned = measured(tmp_path, "turned", [(1, 100)], alter=np.negative)
    assert "inverted" in refusal(turned, forth)


def test_a_current_that_a_load_leads_has_a_sign_too(tmp_path):
    """A shoulder's turned sign was an alarm: magnets weaker by 200 %."""
    usual = measured(tmp_path, "usual", there_and_back(8), load=-9.0)
    turned = measured(tmp_path, "turned", there_and_back(9), load=-9.0, alter=np.negative)
    assert "of the other sign throughout" in refusal(turned, usual)
    assert all(found.of_log for found in findings([turned], reference_of([usual])))
    # neither what a load changes by nor a position of the other sign is a turned current
    other = measured(tmp_path, "other", there_and_back(9), load=6.0)
    assert refusal(other, usual) == refusal(usual, other) == ""
    assert refusal(measured(tmp_path, "own", there_and_back(9), load=-9.5), usual) == ""


@pytest.mark.parametrize("logged", ["position", "velocity"])
def test_beside_a_logged_motion_exchanged_phases_turn_against_it(tmp_path, logged):
    """Whatever the program: its motions there and back may be alike."""

    def recorded(name, moves, order="abc"):
        v = np.concatenate([sense * np.hanning(length) for sense, length in moves])
        position = np.cumsum(v) / RATE_HZ
        torque = 1 + 3 * np.sign(v)
        columns = {
            f"axis1_{phase}": torque * np.cos(40 * position - 2 * np.pi * k / 3)
            for k, phase in enumerate(order)
        }
        columns[f"axis1_{logged}"] = position if logged == "position" else v
        info, path = RunInfo(sampling_rate_hz=RATE_HZ), tmp_path / f"{name}.parquet"
        save_run(path, info, columns)
        row = {"run": [name], "axis": [1], "start": [0], "stop": [v.size], "edge": [False]}
        (own,) = measure([RunSource(name, path, "", v.size, info)], pa.table(row))
        return own

    usual = recorded("usual", there_and_back(6, 300))
    assert refusal(recorded("own", there_and_back(5, 300)), usual) == ""
    one_way = [(-1, 300), (-1, 500)]
    assert refusal(recorded("one way", one_way), usual) == ""
    exchanged = recorded("exchanged", there_and_back(5, 300), order="bac")
    assert "two of its phases exchanged" in refusal(exchanged, usual)
