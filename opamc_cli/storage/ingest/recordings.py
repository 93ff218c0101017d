"""Which recordings an argument of `opamc ingest` names: files, folders, patterns, object stores."""

import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import pyarrow as pa
from pyarrow import fs

from opamc_cli.errors import InputError
from opamc_cli.storage.files.paths import expand_patterns
from opamc_cli.storage.ingest.formats import format_by_ending, is_ros2_bag, known_endings

REMOTE_MARK = "://"


@dataclass(frozen=True)
class Recording:
    """A foreign recording and what its run will be called."""

    source: str
    """Its path, or its address in an object store, such as ``s3://bucket/log.csv``."""
    name: str
    """The path of its run below the output folder, without ending."""


def find_recordings(arguments: Sequence[str], any_ending: bool = False) -> list[Recording]:
    """List the recordings that files, folders, patterns and addresses name, each once.

    A folder stands for every recording below it whose ending is known, and their runs lie below
    the output folder as they lie below it.

    Parameters
    ----------
    arguments
        As the user wrote them.
    any_ending
        Take the files of a folder whatever their ending where none tells a format, since the map
        does.

    Raises
    ------
    InputError
        If a folder holds no recording, a pattern matches nothing or an address cannot be reached.
    """
    found: dict[str, Recording] = {}
    for argument in arguments:
        if REMOTE_MARK in argument:
            recordings = _remote(argument)
        else:
            recordings = [
                recording
                for path in expand_patterns([Path(argument)])
                for recording in _local(path, any_ending)
            ]
        for recording in recordings:
            found.setdefault(recording.source, recording)
    return list(found.values())


@contextmanager
def local_copy(source: str) -> Iterator[Path]:
    """Yield the path of a recording; one of an object store is fetched for the time being.

    Raises
    ------
    InputError
        If it cannot be fetched. Errors within name the address, not the copy.
    """
    if REMOTE_MARK not in source:
        yield Path(source)
        return
    with tempfile.TemporaryDirectory(prefix="opamc-") as folder:
        path = Path(folder) / PurePosixPath(source).name
        try:
            filesystem, place = fs.FileSystem.from_uri(source)
            with filesystem.open_input_stream(place) as remote, path.open("wb") as local:
                shutil.copyfileobj(remote, local, 1 << 22)
        except (pa.ArrowException, OSError) as error:
            raise _unreachable(source, error) from error
        try:
            yield path
        except InputError as error:
            raise InputError(str(error).replace(str(path), source)) from error


def _local(path: Path, any_ending: bool) -> list[Recording]:
    if not path.is_dir() or is_ros2_bag(path):
        return [Recording(str(path), _stem(path))]
    found: list[tuple[Path, bool]] = []
    for folder, folders, files in os.walk(path):
        here = Path(folder)
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        bags = [name for name in folders if is_ros2_bag(here / name)]
        folders[:] = [name for name in folders if name not in bags]
        visible = [name for name in files if not name.startswith(".")]
        found += [
            (here / name, format_by_ending(here / name) is not None)
            for name in sorted([*visible, *bags])
        ]
    wanted = [file for file, known in found if known]
    if not wanted and any_ending:
        wanted = [file for file, _ in found]
    if not wanted:
        msg = f"{path}: the folder holds no recording; known: {known_endings()}"
        raise InputError(msg)
    return [
        Recording(str(file), (file.parent.relative_to(path) / _stem(file)).as_posix())
        for file in wanted
    ]


def _remote(address: str) -> list[Recording]:
    try:
        filesystem, place = fs.FileSystem.from_uri(address)
        info = filesystem.get_file_info(place)
        if info.type == fs.FileType.File:
            return [Recording(address, _stem(PurePosixPath(place)))]
        entries = filesystem.get_file_info(fs.FileSelector(place, recursive=True))
    except (pa.ArrowException, OSError) as error:
        raise _unreachable(address, error) from error
    found = []
    for entry in sorted(entries, key=lambda entry: str(entry.path)):
        below = PurePosixPath(entry.path).relative_to(PurePosixPath(place))
        if entry.type == fs.FileType.File and format_by_ending(Path(below)) is not None:
            name = (below.parent / _stem(below)).as_posix()
            found.append(Recording(f"{address.rstrip('/')}/{below}", name))
    if not found:
        msg = f"{address}: holds no recording; known: {known_endings()}"
        raise InputError(msg)
    return found


def _stem(path: PurePosixPath | Path) -> str:
    """Return a file's name without its ending; a ROS 2 bag is a folder and has none."""
    if isinstance(path, Path) and path.is_dir():
        return path.name
    return (path.with_suffix("") if path.suffix.lower() == ".gz" else path).stem


def _unreachable(address: str, error: Exception) -> InputError:
    reason = " ".join(str(error).split())[:160] or type(error).__name__
    return InputError(f"{address}: cannot be reached ({reason}); check the address and access")
