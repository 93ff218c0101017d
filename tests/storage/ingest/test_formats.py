"""Which format an ending tells."""

import tomllib
from pathlib import Path

import pytest

from opamc_cli.storage.ingest.formats import FORMATS, format_by_ending, known_endings

ENDINGS = {
    "csv": "csv txt tsv dat CSV csv.gz",
    "mat": "mat",
    "hdf5": "h5 hdf5 hdf",
    "tdms": "tdms",
    "parquet": "parquet pq",
    "feather": "feather arrow",
    "ros": "bag mcap db3",
    "mdf": "mf4 mdf MF4",
}


@pytest.mark.parametrize("kind", FORMATS)
def test_endings(kind, tmp_path):
    for ending in ENDINGS[kind].split():
        assert format_by_ending(tmp_path / f"a.b.{ending}") == kind
    assert format_by_ending(Path("a.xlsx")) is format_by_ending(Path("gz")) is None


def test_what_a_format_needs_is_an_extra_of_the_package():
    text = (Path(__file__).parents[3] / "pyproject.toml").read_text(encoding="utf-8")
    extras = tomllib.loads(text)["project"]["optional-dependencies"]
    assert {one.extra for one in FORMATS.values()} - {None} <= extras.keys()


def test_a_folder_with_its_index_is_a_bag(tmp_path):
    assert format_by_ending(tmp_path) is None
    (tmp_path / "metadata.yaml").touch()
    assert format_by_ending(tmp_path) == "ros"


def test_all_that_can_be_read_is_listed():
    assert known_endings() == (
        "CSV, MAT, HDF5, TDMS, Parquet, Feather, ROS bags (.bag, .mcap, .db3) and MDF (.mf4)"
    )
