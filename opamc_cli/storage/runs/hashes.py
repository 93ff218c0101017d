"""SHA-256 of files, each hashed once."""

import hashlib
from functools import lru_cache
from pathlib import Path

from opamc_cli.config.reading import require_regular_file
from opamc_cli.errors import InputError


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's content as hexadecimal digits.

    Raises
    ------
    InputError
        If it is missing or no regular file.
    """
    require_regular_file(path, InputError)
    state = path.stat()
    return _sha256(path.resolve(), state.st_mtime_ns, state.st_size)


def know_sha256(path: Path, modified_ns: int, size: int, sha256: str) -> None:
    """Spare a file the hashing: its content was read before it last had this time and size."""
    _KNOWN_SHA256[path.resolve(), modified_ns, size] = sha256


_KNOWN_SHA256: dict[tuple[Path, int, int], str] = {}


@lru_cache(maxsize=4096)
def _sha256(path: Path, modified_ns: int, size: int) -> str:
    # a diagnosis names the same gigabytes in three tables: they are hashed once
    known = _KNOWN_SHA256.get((path, modified_ns, size))
    if known is not None:
        return known
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()
