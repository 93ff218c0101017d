"""Which recordings an argument names."""

import pytest

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.recordings import Recording, find_recordings, local_copy


def touch(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("x")
    return path


@pytest.mark.parametrize("address", ["{}", "file://{}"])
def test_a_folder_s_recordings_keep_their_places(tmp_path, address):
    for name in ("b.csv", "a.txt.gz", "day/c.mat", "notes.docx"):
        touch(tmp_path / "logs" / name)
    place = address.format(tmp_path / "logs")
    found = find_recordings([place, place])
    assert found == [
        Recording(f"{place}/a.txt.gz", "a"),
        Recording(f"{place}/b.csv", "b"),
        Recording(f"{place}/day/c.mat", "day/c"),
    ]
    # one file, whatever its ending
    assert find_recordings([f"{place}/notes.docx"]) == [Recording(f"{place}/notes.docx", "notes")]
    with local_copy(f"{place}/b.csv") as path:
        assert path.name == "b.csv"
        assert path.read_text() == "x"


def test_hidden_files_are_none_and_a_bag_is_one(tmp_path):
    for name in (".a.csv", ".git/b.csv", "z.csv", "bag/metadata.yaml", "bag/part.db3"):
        touch(tmp_path / name)
    found = [recording.name for recording in find_recordings([str(tmp_path)])]
    assert found == ["bag", "z"]
    assert find_recordings([str(tmp_path / "bag")]) == [Recording(str(tmp_path / "bag"), "bag")]


def test_files_of_unknown_endings_are_taken_where_a_map_tells_the_format(tmp_path):
    for name in ("a.log", "b.xyz"):
        touch(tmp_path / name)
    with pytest.raises(InputError, match="the folder holds no recording"):
        find_recordings([str(tmp_path)])
    found = find_recordings([str(tmp_path)], any_ending=True)
    assert [recording.name for recording in found] == ["a", "b"]
    touch(tmp_path / "c.csv")
    assert [r.name for r in find_recordings([str(tmp_path)], any_ending=True)] == ["c"]
    with pytest.raises(InputError, match="holds no recording"):
        find_recordings([f"file://{touch(tmp_path / 'd' / 'e.xyz').parent}"])


def test_what_is_wrong_with_a_copy_names_its_address(tmp_path):
    address = f"file://{touch(tmp_path / 'a.csv')}"
    with pytest.raises(InputError, match=f"^{address}: broken"), local_copy(address) as path:
        raise InputError(f"{path}: broken")  # noqa: EM102
