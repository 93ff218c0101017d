"""What a worker may meet."""

import os
import signal
import time

from opamc_cli.errors import UsageError


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
    if kind == "nap":
        time.sleep(0.2)
    if kind == "sleep":
        time.sleep(600)
    return kind.upper()
