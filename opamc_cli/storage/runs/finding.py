"""Which files are runs, of what the user names."""

from collections.abc import Sequence
from pathlib import Path

from opamc_cli.config.reading import shown
from opamc_cli.errors import InputError
from opamc_cli.storage.files.parquet import read_schema
from opamc_cli.storage.files.paths import expand_patterns
from opamc_cli.storage.ingest.formats import FORMAT_OF_ENDING


def find_runs(paths: Sequence[Path]) -> list[tuple[str, Path]]:
    """List the runs named by files, folders and patterns, as (name, path), sorted, each once.

    A folder stands for every `*.parquet` below it that is not a stage table. Names are the
    paths below the folder without their ending; of files given one by one, their stems.

    Raises
    ------
    InputError
        If there is no path, one does not exist or a folder holds no run.
    """
    if not paths:
        msg = "no run was named; name files or folders of them"
        raise InputError(msg)
    found: dict[Path, str] = {}
    for path in expand_patterns(paths):
        if path.is_dir():
            files = [f for f in sorted(path.rglob("*.parquet")) if _may_be_run(path, f)]
            if not files:
                msg = f"{path}: the folder holds no run (*.parquet); record or ingest one first"
                raise InputError(msg)
            for file in files:
                found.setdefault(file, file.relative_to(path).with_suffix("").as_posix())
        elif path.exists():
            found.setdefault(path, path.stem)
        else:
            msg = f"{path}: no such file or folder; check the path"
            raise InputError(msg)
    for path in found:
        if any("\ud800" <= c <= "\udfff" for c in str(path)):
            msg = f"{str(path)!r}: its name is not UTF-8; rename it"
            raise InputError(msg)
    runs = [(name, path) for path, name in found.items()]
    names = [name for name, _ in runs]
    if len(set(names)) < len(names):
        # two folders with equal file names: the whole path tells them apart
        runs = [(path.with_suffix("").as_posix(), path) for _, path in runs]
    return sorted(runs)


NO_RUNS = {ending for ending in FORMAT_OF_ENDING if ending not in (".txt", ".dat", ".parquet")}
"""Of files that are recordings, if not runs: a text beside them may be anything."""


def passed_over(paths: Sequence[Path]) -> list[str]:
    """Say in one sentence for each folder what recordings in it are no runs, and of links in it.

    A recording that lies beside a run of its name was made into it.
    """
    said = []
    for folder in dict.fromkeys(path for path in expand_patterns(paths) if path.is_dir()):
        inside = sorted(folder.rglob("*"))
        left = [
            file.relative_to(folder)
            for file in inside
            if _ending(file) in NO_RUNS or file.suffix == ".PARQUET"
            if not any(part.startswith(".") for part in file.relative_to(folder).parts)
            if file.is_file() and not file.with_suffix(".parquet").exists()
        ]
        if left:
            count = f"{len(left)} recordings are" if len(left) > 1 else "1 recording is"
            said.append(
                f"{folder}: {count} passed over ({shown(left[0])}"
                f"{', …' if len(left) > 1 else ''}): only *.parquet are runs; "
                "`opamc ingest` turns others into runs"
            )
        said += [
            f"{link}: is a link to a folder, which is passed over; name it beside {folder}"
            for link in inside
            if link.is_symlink() and link.is_dir() and not link.name.startswith(".")
        ]
    return said


def _ending(file: Path) -> str:
    suffixes = [suffix.lower() for suffix in file.suffixes if suffix.lower() != ".gz"]
    return suffixes[-1] if suffixes else ""


def _may_be_run(folder: Path, file: Path) -> bool:
    relative = file.relative_to(folder)
    if any(part.startswith(".") for part in relative.parts):
        return False
    try:
        metadata = read_schema(file, "").metadata or {}
    except InputError:
        return True  # opening it will say what is wrong with it
    return b"opamc_table" not in metadata
