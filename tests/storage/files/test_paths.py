"""Patterns that no shell has replaced."""

from pathlib import Path

import pytest

from opamc_cli.errors import InputError
from opamc_cli.storage.files.paths import expand_patterns


@pytest.mark.parametrize("pattern", ["*.csv", "?.csv", "[ab].csv"])
def test_a_pattern_gives_its_matches_in_order(tmp_path, pattern):
    for name in ("b.csv", "a.csv", "c.txt"):
        (tmp_path / name).touch()
    found = expand_patterns([tmp_path / pattern, Path("plain")])
    assert found == [tmp_path / "a.csv", tmp_path / "b.csv", Path("plain")]


def test_two_stars_go_down(tmp_path):
    (tmp_path / "x" / "y").mkdir(parents=True)
    (tmp_path / "x" / "y" / "a.csv").touch()
    assert expand_patterns([tmp_path / "**" / "*.csv"]) == [tmp_path / "x" / "y" / "a.csv"]


def test_a_file_of_a_pattern_s_name_is_itself(tmp_path):
    for name in ("[a].csv", "a.csv"):
        (tmp_path / name).touch()
    assert expand_patterns([tmp_path / "[a].csv"]) == [tmp_path / "[a].csv"]


def test_no_match_is_refused(tmp_path):
    with pytest.raises(InputError, match="nothing matches this pattern"):
        expand_patterns([tmp_path / "*.csv"])
