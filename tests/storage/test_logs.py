"""Which files of a cell are recordings, whose they are, and of which night."""

import pytest

from opamc_cli.storage.logs import find_logs


@pytest.mark.parametrize(
    ("folder", "night"),
    [
        ("2026-03-02", "2026-03-02"),
        ("20260302", "2026-03-02"),
        ("2026-02-30", None),  # no day: the recording itself has to tell, or it is said
        ("2026-3-2", None),
    ],
)
def test_a_night_is_a_day_or_left_to_the_recording(tmp_path, folder, night):
    path = tmp_path / "r1" / folder / "a.parquet"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"")
    (log,) = find_logs(f"{tmp_path}/{{robot}}/{{night}}/*.parquet", None)
    assert (log.robot, log.night) == ("r1", night)


def test_other_folders_beside_the_nights_are_no_logs(tmp_path):
    for folder in ("archive", "2026", "tmp-2026-03-02"):
        (tmp_path / "r1" / folder).mkdir(parents=True)
        (tmp_path / "r1" / folder / "a.parquet").write_bytes(b"")
    assert find_logs(f"{tmp_path}/{{robot}}/{{night}}/*.parquet", None) == []
