"""What a worker may meet."""

import os
import signal
import time
from pathlib import Path

from opamc_cli.errors import UsageError

LOADED = False
"""Set by a parent, of which a forked worker is a copy."""


def behave(kind: str) -> str:
    if kind == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == "raise":
        return str(1 / 0)
    if kind == "refuse":
        msg = "the disk is full"
        raise UsageError(msg)
    if kind == "eat":
        return str(len(bytearray(1 << 30)))
    if kind == "loaded":
        return str(LOADED)
    if kind == "files":
        return str(sum(int(one.name) > 2 for one in Path("/proc/self/fd").iterdir()) - 1)
    if kind == "nap":
        time.sleep(0.2)
    if kind == "sleep":
        time.sleep(600)
    return kind.upper()


def leave_a_mark(path: str) -> str:
    """Make a file."""
    Path(path).touch()
    return path
