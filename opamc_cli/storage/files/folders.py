"""Folders of results that are either whole or not there."""

import shutil
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path

from opamc_cli.errors import UsageError
from opamc_cli.storage.files.atomic import ensure_directory, flush


def replace_folder(
    folder: Path, files: Mapping[str, bytes], *, of: Collection[str] | None = None
) -> None:
    """Put a folder with these files, by their paths in it, in the place of one that may be there.

    Between two renames there is none: whoever finds none takes the work for not done.

    Parameters
    ----------
    folder
        Where.
    files
        Their content.
    of
        Names of the files that a folder of results has; None: any. Another one is somebody else's.

    Raises
    ------
    UsageError
        If it cannot be written, or is somebody else's; what was there is then as it was, or gone.
    """
    _require_own(folder, of)
    ensure_directory(folder.parent)
    staged, old = _beside(folder)
    try:
        for left in (staged, old):
            if left.exists():
                shutil.rmtree(left)
        staged.mkdir()
        for name, content in sorted(files.items()):
            path = staged / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
            flush(path)
        for place in {(staged / name).parent for name in files}:
            flush(place)
        if folder.exists():
            folder.rename(old)
        staged.rename(folder)
        flush(folder.parent)
        shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        with suppress(OSError):
            shutil.rmtree(staged)
        msg = (
            f"{folder}: cannot be written ({error.strerror or error}); check space and permissions"
        )
        raise UsageError(msg) from error


def remove_folder(folder: Path, *, of: Collection[str] | None = None) -> None:
    """Remove a folder of results and what a killed process left beside it.

    Parameters
    ----------
    folder
        Which.
    of
        Names of the files that a folder of results has; None: any. Another one is somebody else's.

    Raises
    ------
    UsageError
        If it cannot be removed, or is somebody else's.
    """
    _require_own(folder, of)
    try:
        for place in (folder, *_beside(folder)):
            if place.exists():
                shutil.rmtree(place)
    except OSError as error:
        msg = f"{folder}: cannot be removed ({error.strerror or error}); check permissions"
        raise UsageError(msg) from error


def _beside(folder: Path) -> tuple[Path, Path]:
    """Return where a folder is made, and where the one before it goes."""
    return folder.parent / f".{folder.name}.part", folder.parent / f".{folder.name}.old"


def _require_own(folder: Path, of: Collection[str] | None) -> None:
    """Refuse to take away what no result is, such as the logs where `out` is their folder."""
    if of is None or not folder.is_dir():
        return
    for path in sorted(folder.rglob("*")):
        if path.name not in of and not path.is_dir():
            msg = f"{path}: would be removed and is no result; choose another folder for `out`"
            raise UsageError(msg)
