"""What a night says of recordings that lay in a folder that is gone by the time it is read."""

from pathlib import Path

import pytest

from opamc_cli.stages.nightly.workers.judge import _plain

WORK = Path("/cell one/nightly/.opamc-work")


@pytest.mark.parametrize(
    "lay",
    [
        "/cell one/nightly/.opamc-work/2026-04-01-abcd_123/0/baseline",
        "/cell one/nightly/.opamc-work/2026-03-09-vpumgvem/1/baseline",
        "/mnt/other/.opamc-work/2026-03-09-vpumgvem/0/out/baseline",
    ],
)
def test_a_note_names_the_recording_s_place_whichever_night_s_work_said_it(lay):
    folder = WORK / "2026-04-01-abcd_123" / "0"
    note = f"{lay}/2026-03-03/log_0.parquet: column axis1_current looks clipped"
    plain = _plain(note, folder)
    assert plain == "2026-03-03/log_0.parquet: column axis1_current looks clipped"
