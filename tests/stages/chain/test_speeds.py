import numpy as np
import pyarrow as pa
import pytest

from opamc_cli.stages.chain.compared.speeds import odd_cycles, odd_speeds


def table(speeds, *, references=(1.0, 1.0), samples=200, odd_axis=1.0, carrier=None):
    """Two axes of some runs, four motions each, of which a reference cycle has its own speed."""
    rows = [
        {
            "run": f"run{number}",
            "axis": axis + 1,
            "cycle": 0,
            "start": 0,
            "stop": round(samples * (1 + 0.2 * motion) / speed * (odd_axis if axis else 1.0)),
            "edge": False,
            "kind": "motion",
            "sampling_rate_hz": 100.0,
            "reference_samples": round(samples * (1 + 0.2 * motion) / references[axis]),
            "signal": "reported" if carrier is None else "phases",
            "f_max_hz": 60 * speed if carrier is None else carrier,
            "reference_f_max_hz": 60 * references[axis],
        }
        for number, speed in enumerate(speeds)
        for axis in range(2)
        for motion in range(4)
    ]
    return pa.Table.from_pylist(rows)


def test_a_run_that_is_three_per_cent_slower_is_of_another_speed():
    motions = table([1.0, 1.0, 0.97, 1.0])
    assert odd_speeds(motions, motions, 0.01) == {"run2": pytest.approx(1 / 0.97, rel=3e-3)}


def test_the_speed_is_the_one_that_most_runs_share_and_not_that_of_the_reference_cycle():
    motions = table([1.0, 0.97, 1.0, 1.0], references=(0.97, 1.0))
    assert odd_speeds(motions, motions, 0.01).keys() == {"run1"}


def test_two_runs_of_two_speeds_are_not_both_refused():
    motions = table([1.0, 0.97])
    assert len(odd_speeds(motions, motions, 0.01)) == 1


def test_a_target_is_held_against_what_is_left_of_the_baseline():
    baseline = table([1.0, 1.0, 1.03], references=(1.03, 1.03))
    kept = baseline.filter(np.asarray(baseline["run"]) != "run2")
    assert not odd_speeds(table([1.0, 1.0], references=(1.03, 1.03)), kept, 0.01)
    assert odd_speeds(table([1.03], references=(1.03, 1.03)), kept, 0.01).keys() == {"run0"}


def test_few_samples_leave_the_speed_open_however_many_motions_there_are():
    assert not odd_speeds(table([0.97], samples=40), table([1.0], samples=40), 0.01)


def test_a_joint_whose_boundaries_move_does_not_make_another_speed():
    odd = table([1.0], odd_axis=1.012)
    assert not odd_speeds(odd, table([1.0]), 0.01)


@pytest.mark.parametrize(("carrier", "same"), [(60.0, True), (60.0 * 0.97, False)])
def test_the_carrier_tells_a_fault_s_longer_motions_from_another_speed(carrier, same):
    longer = table([0.97], carrier=carrier)
    assert bool(odd_speeds(longer, table([1.0], carrier=60.0), 0.01)) is not same


def test_a_baseline_whose_motions_are_longer_than_the_reference_s_has_its_carrier():
    alike = table([0.985] * 6, carrier=60.0)
    assert not odd_speeds(table([1.0], carrier=60.0), alike, 0.01)


def test_motions_that_are_much_longer_at_the_same_carrier_are_of_another_program():
    longer = table([0.9], carrier=60.0)
    assert odd_speeds(longer, table([1.0], carrier=60.0), 0.01).keys() == {"run0"}


def test_nothing_identified_has_no_speed():
    motions = table([1.0])
    none = motions.set_column(2, "cycle", pa.array([-1] * motions.num_rows))
    assert not odd_speeds(none, motions, 0.01)
    assert not odd_speeds(motions, none, 0.01)


@pytest.mark.parametrize(("name", "value"), [("kind", "window"), ("edge", True)])
def test_windows_and_motions_that_an_edge_has_cut_tell_no_speed(name, value):
    slower, usual = table([0.97]), table([1.0])
    of_all = pa.array([value] * slower.num_rows)
    odd = slower.set_column(slower.schema.get_field_index(name), name, of_all)
    assert not odd_speeds(odd, usual, 0.01)
    assert odd_speeds(slower, usual, 0.01)


def test_a_baseline_of_several_runs_tells_by_its_own_scatter_what_is_another_speed():
    """Of half a second three alone are known to 4 %, five that are alike to a sample."""
    alike = table([1.0] * 5, samples=1000)
    fast = alike.set_column(
        alike.schema.get_field_index("sampling_rate_hz"), "sampling_rate_hz",
        pa.array([2000.0] * alike.num_rows),
    )  # fmt: skip
    odd = fast.set_column(
        fast.schema.get_field_index("stop"), "stop",
        pa.array([round(stop / 0.98) for stop in fast["stop"].to_pylist()]),
    )  # fmt: skip
    assert odd_speeds(odd, fast, 0.01).keys() == {f"run{n}" for n in range(5)}
    assert not odd_speeds(odd, fast.slice(0, 3 * 8), 0.01)


@pytest.mark.parametrize(
    ("speeds", "odd"),
    [
        ((1.0, 1.0, 0.8), {2: 1.25}),
        ((0.8, 1.0, 0.8, 1.0), {0: 1.25, 2: 1.25}),
        ((1.0, 0.95, 1.05), {}),
        ((0.8, 0.8, 0.8), {}),
    ],
    ids=["the last", "half of them", "a fault's ringing", "a run of another speed"],
)
def test_cycles_of_another_speed_than_the_others(speeds, odd):
    rows = []
    for cycle, speed in enumerate(speeds):
        rows += [{**row, "run": "run0", "cycle": cycle} for row in table([speed]).to_pylist()]
    found = odd_cycles(pa.Table.from_pylist(rows))
    assert found == ({("run0", axis): pytest.approx(odd, rel=1e-2) for axis in (1, 2) if odd})


@pytest.mark.parametrize(("carriers", "odd"), [((60.0, 60.2, 59.9), {}), ((60, 60, 48), {2: 1.25})])
def test_a_cycle_whose_carrier_is_as_ever_is_of_the_same_speed(carriers, odd):
    """A joint that creeps into its stop was told that its speed had been changed midway."""
    rows = []
    for cycle, (speed, carrier) in enumerate(zip((1.0, 1.0, 0.8), carriers, strict=True)):
        motions = table([speed], carrier=carrier).to_pylist()
        rows += [{**row, "run": "run0", "cycle": cycle} for row in motions]
    found = odd_cycles(pa.Table.from_pylist(rows))
    assert found == ({("run0", axis): pytest.approx(odd, rel=1e-2) for axis in (1, 2) if odd})
