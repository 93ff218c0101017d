"""Standard output and error that may be closed, full, or knows no Greek."""

import os
import sys
from contextlib import suppress

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import TextIO  # which takes longer to import than all else here


def open_streams() -> None:
    """Have all three standard streams: a file that is opened must not become one of them."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            opened = os.open(os.devnull, os.O_RDWR)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115


def say(text: str, stream: "TextIO") -> None:
    """Write at once, come what may: the exit code tells more than the text.

    A reader that has seen enough, as ``| head``, is no error, nor is a terminal or a cron that
    knows no Greek: what it cannot show becomes a question mark. What cannot be written because
    the disk is full is told on the other stream.
    """
    encoding = stream.encoding or "utf-8"
    try:
        stream.write(text.encode(encoding, "replace").decode(encoding))
        stream.flush()
    except BrokenPipeError:
        _silence(stream)
    except (OSError, ValueError) as error:
        _silence(stream)
        if stream is sys.stdout:
            reason = getattr(error, "strerror", None) or error
            say(f"opamc: standard output cannot be written ({reason})\n", sys.stderr)


LONGEST_WORD = 300
"""Characters of a word in an error; a path is seldom longer, a value in a damaged file may be."""


def complain(text: str) -> None:
    """Write an error on one line, of whatever it quotes no more than a person would read."""
    words = (
        word if len(word) <= LONGEST_WORD else f"{word[:150]}…{word[-100:]}"
        for word in printable(text).split(" ")
    )
    say(f"opamc: {' '.join(words)}\n", sys.stderr)


def printable(text: str) -> str:
    """Return text from a file without the control characters that steer a terminal."""
    return "".join(c if c.isprintable() else "�" for c in text)


def finish() -> None:
    """Write what is left in the buffers, or drop it: the interpreter's end would exit with 120."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            _silence(stream)


def _silence(stream: "TextIO") -> None:
    """Send what is left in the stream's buffer nowhere: its end must not change the exit code."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
