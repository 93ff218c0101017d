"""One writer per output folder."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from opamc_cli.errors import LockedError, UsageError
from opamc_cli.storage.files.atomic import clear_parts, ensure_directory
from opamc_cli.storage.files.result import clear

LOCK_NAME = ".opamc.lock"


@contextmanager
def output_lock(folder: Path, chosen_by: str = "--out") -> Iterator[None]:
    """Hold the output folder for this process; the kernel lets go of it when the process dies.

    Parameters
    ----------
    folder
        Which.
    chosen_by
        What another one is named with, for errors.

    Raises
    ------
    LockedError
        If another process holds it.
    UsageError
        If the folder cannot be written.
    """
    ensure_directory(folder, chosen_by)
    path = folder / LOCK_NAME
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        reason = f"cannot write here ({error.strerror})"
        msg = f"{folder}: {reason}; choose another folder with {chosen_by}"
        raise UsageError(msg) from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            msg = (
                f"{folder}: another opamc run is writing here (lock {path.name}); "
                f"wait for it to end or choose another folder with {chosen_by}"
            )
            raise LockedError(msg) from error
        clear(folder)
        clear_parts(folder)
        yield
    finally:
        os.close(descriptor)
