"""Every document is checked at its door: one sentence and the right code, whatever is in it."""

import contextlib
import json
import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from recordings import record

from opamc_cli.config.yaml.values import MOST_VALUES, YamlError, plain_values, yaml_of
from opamc_cli.errors import InputError
from opamc_cli.storage.files.json_documents import parsed
from opamc_cli.storage.runs.metadata import RunInfo, RunMetadata
from opamc_cli.storage.runs.run import Run

SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(10**15), 10**15)
    | st.floats(-1e15, 1e15).filter(lambda x: x == 0 or abs(x) > 1e-300)
    | st.text(st.characters(exclude_categories=("Cs", "Cc")), max_size=20)
)
TREES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text("abcdefg", min_size=3, max_size=5), inner, max_size=4)
    ),
    max_leaves=12,
)


@given(TREES, st.booleans())
@example("1E5", False)
@example({"robot": "0e0", "limit": 1e5, "share": 1e-05, "offset": -1.0}, True)
@settings(max_examples=60)
def test_yaml_reads_back_what_was_written(tree, flow):
    text = yaml_of(tree, default_flow_style=flow, allow_unicode=True)
    assert plain_values(text) == tree


@given(st.text(max_size=60) | st.text("[]{}:,-&*!?|>'\"#%@ \nab1.e", max_size=60))
@settings(max_examples=100)
def test_any_text_is_yaml_or_is_refused(text):
    said = ""
    with contextlib.suppress(YamlError):
        try:
            plain_values(text)
        except YamlError as error:
            said = str(error)
            raise
    assert len(said) < 400


def test_aliases_that_multiply_are_counted():
    layers = ["a: &l0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    for number in range(1, 9):
        many = ", ".join([f"*l{number - 1}"] * 10)
        layers.append(f"b{number}: &l{number} [{many}]")
    with pytest.raises(YamlError, match=f"more than {MOST_VALUES} values"):
        plain_values("\n".join(layers))


METADATA = [
    ({"sampling_rate_hz": 1e300}, "less than or equal"),
    ({"sampling_rate_hz": math.nan}, "is not JSON|finite"),
    ({"sampling_rate_hz": 10**400}, "sampling_rate_hz"),
    ({"sampling_rate_hz": "1000"}, "valid number"),
    ({"sampling_rate_hz": True}, "valid number"),
    ({}, "has no sampling_rate_hz"),
    ({"sampling_rate_hz": 1000, "robot": "\ud800"}, "not JSON"),
    ({"sampling_rate_hz": 1000, "robot": ["R1"]}, "robot"),
    ({"sampling_rate_hz": 1000, "robot": "x" * 5000}, "at most 1000"),
    ({"sampling_rate_hz": 1000, "payload_kg": 1e300}, "payload_kg"),
    ({"sampling_rate_hz": 1000, "current_unit": "mA"}, "current_unit"),
    ([1], "holds no JSON object"),
    (None, "holds no JSON object"),
]


@pytest.mark.parametrize(("values", "said"), METADATA, ids=range(len(METADATA)))
def test_odd_run_metadata(values, said):
    with pytest.raises(InputError, match=said) as caught:
        parsed(RunMetadata, json.dumps(values).encode(), "r.parquet: metadata", "write it again")
    assert len(str(caught.value)) < 400


@given(
    st.builds(
        RunInfo,
        sampling_rate_hz=st.floats(1e-3, 1e6),
        robot=st.none() | st.text(st.characters(exclude_categories=("Cs", "Cc")), max_size=50),
        payload_kg=st.none() | st.floats(0.0, 1e6),
    )
)
@settings(max_examples=60)
def test_run_metadata_reads_back(info):
    assert RunInfo(**parsed(RunMetadata, info.to_json().encode(), "", "").model_dump()) == info


def test_columns_that_no_run_has(tmp_path):
    def out_of_range(columns):
        columns["axis99999999999_a"] = columns["axis1_a"]

    with pytest.raises(InputError, match="axes count from 1 to 999"):
        Run(record(tmp_path / "r.parquet", 0, out_of_range))
