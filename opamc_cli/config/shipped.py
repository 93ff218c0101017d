"""Files that come with the program: configurations, maps, recordings of a virtual robot.

In an installed package they lie in `opamc_cli/shipped/` (see `setup.py`), in a clone at its top.
"""

import shutil
from pathlib import Path

from opamc_cli.errors import ConfigError, UsageError

PACKAGE = Path(__file__).parents[1]
PLACES = {"configs": "configs", "maps": "configs/maps", "samples": "data/samples"}
"""Where each kind lies, below `opamc_cli/shipped/` or the clone."""


def shipped_folder(kind: str) -> Path:
    """Return the folder of the shipped configurations, maps or samples."""
    inside = PACKAGE / "shipped" / PLACES[kind]
    return inside if inside.is_dir() else PACKAGE.parent / PLACES[kind]


def shipped_names(kind: str) -> list[str]:
    """Return the names of the shipped YAML files of a kind."""
    return sorted(file.stem for file in shipped_folder(kind).glob("*.yaml"))


def shipped_file(path: Path, kind: str) -> Path:
    """Return a user's file as it is, or a shipped one by its bare name, such as ``kinova_gen3``.

    Raises
    ------
    ConfigError
        If it is a bare name that neither exists nor is shipped.
    """
    if path.exists() or path.suffix or len(path.parts) != 1:
        return path
    names = shipped_names(kind)
    if path.name not in names:
        msg = f"{path}: no such file, and not shipped; shipped {kind}: {', '.join(names)}"
        raise ConfigError(msg)
    return shipped_folder(kind) / f"{path.name}.yaml"


def copy_shipped(folder: Path) -> list[Path]:
    """Copy samples to `folder`, configurations and maps to `folder`/configs; say what is new.

    Raises
    ------
    UsageError
        If the folder cannot be written.
    """
    written = []
    for kind, place in (("samples", folder), ("configs", folder / "configs")):
        source = shipped_folder(kind)
        for file in sorted(source.rglob("*")):
            target = place / file.relative_to(source)
            if not file.is_file() or target.exists():
                continue
            try:
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, target)
            except OSError as error:
                msg = f"{target}: cannot be written ({error.strerror}); choose another folder"
                raise UsageError(msg) from error
            written.append(target)
    return written
