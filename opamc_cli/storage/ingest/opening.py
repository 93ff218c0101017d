"""Open a foreign recording, by its format, and let every error name the file."""

import importlib
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path

from opamc_cli.config.reading import require_regular_file
from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.formats import FORMATS, is_ros2_bag
from opamc_cli.storage.ingest.map.map_file import IngestMap, format_of
from opamc_cli.storage.ingest.source import Block, Listed, Name, Selection, Source

LIBRARY_ERRORS = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    struct.error,
    zlib.error,
)
"""What h5py, scipy, npTDMS, rosbags and asammdf raise on damaged files."""


@contextmanager
def open_source(path: Path, channels: IngestMap) -> Iterator[Source]:
    """Open a foreign recording.

    Raises
    ------
    InputError
        If it is missing, damaged or not of its format, or a library to read it is not installed.
    """
    require_recording(path)
    with ExitStack() as stack:
        with _readable(path):
            source = stack.enter_context(_opened(path, channels))
        yield _Guarded(path, source)


def require_recording(path: Path) -> None:
    """Refuse what is no file that may be opened, or an empty one.

    Raises
    ------
    InputError
    """
    if any("\ud800" <= sign <= "\udfff" for sign in str(path)):
        msg = f"{str(path)!r}: its name is not UTF-8; rename it"
        raise InputError(msg)
    if path.is_dir() and not is_ros2_bag(path):
        msg = f"{path}: is a folder where a recording is needed; name the files in it"
        raise InputError(msg)
    if not path.exists():
        msg = f"{path}: no such file; check the path"
        raise InputError(msg)
    if not path.is_dir():
        require_regular_file(path, InputError, "a recording")
    if path.is_file() and path.stat().st_size == 0:
        msg = f"{path}: is empty (0 bytes); record it again"
        raise InputError(msg)


def _opened(path: Path, channels: IngestMap) -> AbstractContextManager[Source]:
    form = FORMATS[format_of(path, channels)]
    module, _, function = form.reader.partition(":")
    # each format's library is imported only where that format is read
    reader: Callable[..., AbstractContextManager[Source]] = getattr(
        importlib.import_module(f"opamc_cli.storage.ingest.readers.{module}"), function
    )
    return reader(path, channels) if form.laid_out else reader(path)


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        yield
    except LIBRARY_ERRORS as error:
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        msg = f"{path}: cannot be read ({reason}); it is damaged, or format in the map is wrong"
        raise InputError(msg) from error


class _Guarded:
    """A source whose library's errors name the file."""

    def __init__(self, path: Path, source: Source) -> None:
        self._path = path
        self._source = source

    def channels(self) -> list[Listed]:
        with _readable(self._path):
            return self._source.channels()

    def blocks(self, selections: Mapping[str, Selection]) -> Iterator[Block]:
        blocks = self._source.blocks(selections)
        while True:
            with _readable(self._path):
                block = next(blocks, None)
            if block is None:
                return
            yield block

    @property
    def remarks(self) -> list[str]:
        # only a text can end within a line
        return list(getattr(self._source, "remarks", []))

    def value(self, source: Name) -> object:
        with _readable(self._path):
            return self._source.value(source)
