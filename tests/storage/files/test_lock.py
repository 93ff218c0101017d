"""One writer per folder, until it ends."""

import subprocess
import sys
import time

import pytest

from opamc_cli.errors import LockedError
from opamc_cli.storage.files.lock import output_lock

HOLDER = """
import sys, time
from pathlib import Path
from opamc_cli.storage.files.lock import output_lock
with output_lock(Path({folder!r})):
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_folder_that_another_process_writes_to_is_refused(tmp_path):
    code = HOLDER.format(folder=str(tmp_path))
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(LockedError, match="another opamc run is writing here"):
            output_lock(tmp_path).__enter__()
        holder.kill()
        holder.wait()
    # the kernel let go of it with the process, though the file is still there
    deadline = time.monotonic() + 5
    with output_lock(tmp_path):
        assert time.monotonic() < deadline
    with output_lock(tmp_path):
        pass
