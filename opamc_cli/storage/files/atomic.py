"""Files that are either whole or not there."""

import json
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from opamc_cli.errors import UsageError


def ensure_directory(folder: Path, chosen_by: str = "--out") -> Path:
    """Make an output folder with its parents.

    Raises
    ------
    UsageError
        If the folder cannot be made or is a file.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = error.strerror or str(error)
        msg = (
            f"{folder}: cannot make this output folder ({reason}); choose another with {chosen_by}"
        )
        raise UsageError(msg) from error
    return folder


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path` and rename it onto `path` on success.

    The file is flushed to disk before the rename and the folder after it, so a kill or a power
    cut leaves the old file or the new one, never half of one.

    Raises
    ------
    UsageError
        If the folder cannot be written or the disk is full.
    """
    path = Path(path).resolve()  # the public name of a result is a link into it
    ensure_directory(path.parent)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    except OSError as error:
        msg = f"{path}: cannot write here ({error.strerror}); choose another folder with --out"
        raise UsageError(msg) from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        flush(temporary)
        # mkstemp makes files private; a report is for everybody the umask lets read it
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
        flush(path.parent)
    except OSError as error:
        msg = f"{path}: cannot be written ({error.strerror or error}); check space and permissions"
        raise UsageError(msg) from error
    finally:
        temporary.unlink(missing_ok=True)


_PART = re.compile(r"\..+\.([a-z0-9_]{8}|link)\.part")
"""Names of temporary files of `atomic_path` and of a result's links."""


def clear_parts(folder: Path) -> None:
    """Remove what killed processes left half-written in a folder and the folders in it.

    The caller holds the folder's lock.
    """
    for pattern in (".*.part", "*/.*.part", "*/*/.*.part"):
        for path in folder.glob(pattern):
            if _PART.fullmatch(path.name) and not path.is_dir():
                with suppress(OSError):
                    path.unlink()


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically (UTF-8)."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: object) -> None:
    """Write a JSON document atomically, other alphabets as they are."""
    write_text(path, json.dumps(value, indent=2, allow_nan=False, ensure_ascii=False) + "\n")


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


_SCRATCH = ContextVar("scratch", default=False)


@contextmanager
def scratch() -> Iterator[None]:
    """Have nothing waited for that is thrown away anyway, or checked when it is read."""
    before = _SCRATCH.set(True)
    try:
        yield
    finally:
        _SCRATCH.reset(before)


def flush(path: Path) -> None:
    """Have a file or folder on the disk before going on, unless it is scratch."""
    if _SCRATCH.get():
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
