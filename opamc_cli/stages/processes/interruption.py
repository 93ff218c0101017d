"""What ends a command from outside: Ctrl-C, a scheduler, a terminal that goes away."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from opamc_cli.errors import Interrupted

TYPE_CHECKING = False
if TYPE_CHECKING:
    from sys import UnraisableHookArgs

SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)


AGAIN_S = 0.01
"""After so long a signal comes again that arrived where nothing can be raised."""


@contextmanager
def interruptible() -> Iterator[list[int]]:
    """Let signals unwind the main thread, so that temporary files go; the second one ends it.

    Yields
    ------
    list of int
        The signal that has come, if one has. Libraries may answer an exception in their midst with
        one of their own, or go on half imported: whatever is raised after a signal is its doing.
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield came
        return

    def handle(number: int, frame: FrameType | None) -> None:
        del frame
        came.append(number)
        if len(came) > 1:
            os._exit(128 + number)
        raise Interrupted(number)

    def unraisable(lost: "UnraisableHookArgs") -> None:
        if not isinstance(lost.exc_value, Interrupted):
            told(lost)
            return
        # it came within a destructor or a callback, which pass nothing on
        arguments = (os.getpid(), came.pop())
        again = threading.Timer(AGAIN_S, os.kill, arguments)
        again.daemon = True
        again.start()

    # a command that was started to survive its terminal (nohup) goes on to do so
    before = {number: signal.getsignal(number) for number in SIGNALS}
    told, sys.unraisablehook = sys.unraisablehook, unraisable
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, handle)
    try:
        yield came
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = told


@contextmanager
def held_back() -> Iterator[None]:
    """Hold signals back; processes that are started meanwhile never get them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
