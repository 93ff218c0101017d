"""The command in a process of its own that need not import it again: a fork of one that has.

A start of the interpreter with all that a command imports costs seconds, a fork milliseconds; so
the same time tries fifty times as many kills and failing calls. The parent must only import: what
runs there (threads of a library) would be missing in the forks.
"""

import faulthandler
import importlib
import os
import pkgutil
import signal
import sys
import tempfile
import time
import traceback
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import opamc_cli
from opamc_cli.__main__ import main
from opamc_cli.stages.processes.interruption import SIGNALS

LIBRARIES = ("numpy", "scipy.signal", "numba", "pyarrow.parquet", "matplotlib.figure", "rich.table")


@dataclass(frozen=True)
class Ended:
    """How a process ended: like `subprocess`, a signal's number is negative."""

    returncode: int
    stdout: str
    stderr: str


def preload() -> None:
    """Import everything that a command may, and let a report draw one figure instead of eight."""
    for name in LIBRARIES:
        importlib.import_module(name)
    for module in pkgutil.walk_packages(opamc_cli.__path__, "opamc_cli."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    shown = importlib.import_module("opamc_cli.stages.report.figures.shown")
    shown.EVIDENCE = shown.EVIDENCE[:1]  # type: ignore[attr-defined]


class Fork:
    """Something that runs in a fork, in a session of its own.

    Parameters
    ----------
    what
        The arguments of a command, or a function.
    environment
        What is added to the environment.
    at_end
        Called when the command has ended by itself.
    """

    def __init__(
        self,
        what: tuple[str, ...] | Callable[[], object],
        environment: Mapping[str, str] | None = None,
        at_end: Callable[[], object] = lambda: None,
    ) -> None:
        self._files = [tempfile.TemporaryFile() for _ in range(2)]  # noqa: SIM115
        before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        self.pid = os.fork()
        if self.pid == 0:
            # as the command's own entry does, before it has the signals in hand
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            self._be(what, environment or {}, at_end)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _be(
        self,
        what: tuple[str, ...] | Callable[[], object],
        environment: Mapping[str, str],
        at_end: Callable[[], object],
    ) -> None:
        code = 99
        try:
            os.setsid()
            nothing = os.open(os.devnull, os.O_RDONLY)
            for number, source in enumerate((nothing, *(file.fileno() for file in self._files))):
                os.dup2(source, number)
            sys.stdout = os.fdopen(1, "w", encoding="utf-8")
            sys.stderr = os.fdopen(2, "w", encoding="utf-8")
            # workers start as those of the command do, not as those of this script
            sys.modules["__main__"] = types.ModuleType("__main__")
            os.environ.update(environment)
            faulthandler.enable(sys.stderr)
            if callable(what):
                what()
            else:
                sys.argv = ["opamc", *what]
                main()
            code = 0
        except SystemExit as ended:
            code = int(ended.code or 0)
        except BaseException:  # noqa: BLE001 - what the interpreter would print
            traceback.print_exc()
        finally:
            for stream in (sys.stdout, sys.stderr):
                stream.flush()
            at_end()
            os._exit(code)

    def wait(self, timeout_s: float) -> Ended:
        """Return how it ended; TimeoutError if it has not in time."""
        until = time.monotonic() + timeout_s
        while not (ended := os.waitpid(self.pid, os.WNOHANG))[0]:
            if time.monotonic() > until:
                os.kill(self.pid, signal.SIGKILL)
                os.waitpid(self.pid, 0)
                msg = f"still running after {timeout_s} s"
                raise TimeoutError(msg)
            time.sleep(0.002)
        texts = []
        for file in self._files:
            file.seek(0)
            texts.append(file.read().decode("utf-8", "replace"))
            file.close()
        return Ended(os.waitstatus_to_exitcode(ended[1]), *texts)
