"""What a user gives us is read within bounds: regular files, so many bytes, so many words."""

import reprlib
import stat
from pathlib import Path

from opamc_cli.errors import OpamcError

MOST_DOCUMENT_BYTES = 4 << 20
"""Of a configuration, a map or a declared model: the longest we know of has 40 kB."""

_KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def require_regular_file(path: Path, error: type[OpamcError], what: str = "a file") -> None:
    """Refuse what is no regular file: others can keep a reader waiting for ever.

    Parameters
    ----------
    path
        What the user named.
    error
        What is raised.
    what
        What is needed there, such as "a run file (*.parquet)".

    Raises
    ------
    OpamcError
        Of the given kind, if the path is missing or something else.
    """
    try:
        mode = path.stat().st_mode
    except OSError as reason:
        msg = f"{shown(path)}: cannot be read ({reason.strerror or reason}); check the path"
        raise error(msg) from reason
    if not stat.S_ISREG(mode):
        kind = next((name for is_kind, name in _KINDS if is_kind(mode)), "no regular file")
        msg = f"{path}: cannot be read, it is {kind} where {what} is needed"
        raise error(msg)


def read_text(path: Path, error: type[OpamcError], most_bytes: int = MOST_DOCUMENT_BYTES) -> str:
    """Read a text file in UTF-8 of bounded size.

    Raises
    ------
    OpamcError
        Of the given kind, if it is missing, no regular file, too long or not UTF-8.
    """
    require_regular_file(path, error)
    try:
        with path.open("rb") as file:
            content = file.read(most_bytes + 1)
    except OSError as reason:
        msg = f"{path}: cannot be read ({reason.strerror or reason}); check the path"
        raise error(msg) from reason
    if len(content) > most_bytes:
        msg = f"{path}: has more than {most_bytes} bytes; is it the right file?"
        raise error(msg)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as reason:
        msg = f"{path}: is not a text file in UTF-8 (byte {reason.start}); save it as UTF-8"
        raise error(msg) from reason


def shown(value: object) -> str:
    """Return a value as a sentence can hold it: at most some 80 characters, all printable."""
    if isinstance(value, Path):
        text = str(value)
    elif isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 10**40:
        return f"an integer of {value.bit_length()} bits"
    else:
        text = _SHORT.repr(value)
    text = "".join(c if c.isprintable() else "�" for c in text)
    return text if len(text) <= 400 else f"{text[:200]}…{text[-100:]}"


_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 80
_SHORT.maxlevel = 2
