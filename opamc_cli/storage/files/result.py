"""Several files that appear at once: a reader meets the whole new result, the last one, or none.

The files lie in the hidden folder `.result` of the output folder; their public names are symbolic
links into it. A new result is written beside it and the two folders are exchanged in one step, so
that no kill, no full disk and no reader ever meets files of two results.
"""

import ctypes
import errno
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from opamc_cli.errors import OpamcError, UsageError
from opamc_cli.storage.files.atomic import ensure_directory, flush

CURRENT = ".result"
STAGED = ".result.part"
REPLACED = ".result.old"

_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
_NO_EXCHANGE = (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP)
"""What kernels and filesystems answer that cannot exchange two folders, such as NFS."""
_NO_LINKS = (errno.EPERM, errno.ENOSYS, errno.ENOTSUP)
"""What filesystems answer that have no symbolic links, such as FAT."""


def published(path: Path) -> Path:
    """Return where a file of a result is seen: its path without the hidden folder."""
    return Path(*(part for part in path.parts if part not in (CURRENT, STAGED)))


def published_text(text: str) -> str:
    """Return a sentence that names files of a result by the paths where they are seen."""
    return text.replace(f"{STAGED}{os.sep}", "")


@contextmanager
def result(folder: Path, *names: str, linked: bool = True) -> Iterator[Path]:
    """Yield an empty folder; what is written there replaces the files `names` at once on success.

    Files of other names that an earlier result left in `folder` stay. The caller holds the
    folder's lock.

    Parameters
    ----------
    folder
        The output folder.
    names
        Every file that this kind of result may have, as paths below `folder`; the first one
        vouches for the others.
    linked
        False: plain files, for what users move elsewhere, such as recordings. They appear one
        after the other, while the file that vouches for them is away.

    Raises
    ------
    UsageError
        If the folder cannot be written; the last result is then as it was.
    """
    staged = folder / STAGED
    try:
        with _writing(folder):
            clear(folder)
            ensure_directory(staged)
        yield staged
        with _writing(folder):
            _publish(folder, names, linked)
    except OpamcError as error:
        msg = published_text(str(error))
        if names and (folder / names[0]).exists():
            msg = f"{msg.rstrip('.')} ({folder / names[0]} is still that of the last result)"
        raise type(error)(msg) from error
    finally:
        with suppress(OSError):
            clear(folder)


def clear(folder: Path) -> None:
    """Remove what a killed process left of a result that it was writing."""
    current, replaced = folder / CURRENT, folder / REPLACED
    if replaced.is_dir() and not current.exists():
        replaced.rename(current)
    for left in (folder / STAGED, replaced):
        if left.is_dir():
            shutil.rmtree(left)


def _publish(folder: Path, names: Sequence[str], linked: bool) -> None:
    staged, current = folder / STAGED, folder / CURRENT
    written = _files(staged)
    if not written:
        return
    if not linked or not _has_links(staged):
        _move(folder, names, written)
        return
    for name in sorted(_files(current) - {*names} - written):
        (staged / name).parent.mkdir(parents=True, exist_ok=True)
        (staged / name).hardlink_to(current / name)
    for name in sorted({*names} | written):
        _adopt(folder, name, name in written)
    for place in [*staged.rglob("*"), staged]:
        if place.is_dir():
            flush(place)
    _exchange(staged, current, folder / REPLACED)
    with suppress(OSError):  # the result is there; what is left of the old one goes next time
        flush(folder)
        for name in names:
            public = folder / name
            if public.is_symlink() and not public.exists():
                public.unlink()


def _adopt(folder: Path, name: str, wanted: bool) -> None:
    """Make a public name a link into the hidden folder, with the same content behind it."""
    public, held = folder / name, folder / CURRENT / name
    target = os.path.relpath(folder.resolve() / CURRENT / name, public.parent.resolve())
    if public.is_symlink() and str(public.readlink()) == target:
        return
    if public.exists():
        if not public.is_file():
            msg = f"{public}: is a folder where a result goes; move it or choose another --out"
            raise UsageError(msg)
        held.parent.mkdir(parents=True, exist_ok=True)
        held.unlink(missing_ok=True)
        held.hardlink_to(public.resolve())
    elif not wanted:
        return
    public.parent.mkdir(parents=True, exist_ok=True)
    link = public.with_name(f".{public.name}.link.part")
    link.unlink(missing_ok=True)
    link.symlink_to(target)
    link.replace(public)


def _move(folder: Path, names: Sequence[str], written: set[str]) -> None:
    """Put plain files in place while the one that vouches for them is away."""
    for name in names:  # the first one first
        if name not in written or name == names[0]:
            (folder / name).unlink(missing_ok=True)
    for name in sorted(written, key=lambda name: name == names[0]):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / STAGED / name).replace(folder / name)
    for place in {(folder / name).parent for name in written}:
        flush(place)


def _exchange(staged: Path, current: Path, replaced: Path) -> None:
    if not current.exists():
        staged.rename(current)
        return
    libc = ctypes.CDLL(None, use_errno=True)
    if hasattr(libc, "renameat2"):
        paths = os.fsencode(staged), os.fsencode(current)
        if not libc.renameat2(_AT_FDCWD, paths[0], _AT_FDCWD, paths[1], _RENAME_EXCHANGE):
            return
        number = ctypes.get_errno()
        if number not in _NO_EXCHANGE:
            raise OSError(number, os.strerror(number))
    current.rename(replaced)
    staged.rename(current)


def _has_links(folder: Path) -> bool:
    probe = folder / "probe"
    try:
        probe.symlink_to("nowhere")
    except OSError as error:
        if error.errno in _NO_LINKS:
            return False
        raise
    probe.unlink()
    return True


def _files(folder: Path) -> set[str]:
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*")
        if path.is_file() or path.is_symlink()
    }


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        msg = f"{folder}: cannot be written ({reason}); check space and permissions, or --out"
        raise UsageError(msg) from error
