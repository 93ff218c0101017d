"""Formats of foreign recordings: which endings tell them, and what each needs to be read."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Format:
    """One format of foreign recordings."""

    shown: str
    """What users call it."""
    endings: tuple[str, ...]
    """Of its files."""
    reader: str
    """``module:function`` in `readers`, imported only where the format is read; called with the
    path, it is a context manager that yields a `Source`."""
    extra: str | None = None
    """Of the package, which brings the library that it needs."""
    laid_out: bool = False
    """The map says how a text is laid out: the reader takes the map, too."""


FORMATS = {
    "csv": Format("CSV", (".csv", ".txt", ".tsv", ".dat"), "csv:CsvSource", laid_out=True),
    "mat": Format("MAT", (".mat",), "mat:open_mat"),
    "hdf5": Format("HDF5", (".h5", ".hdf5", ".hdf"), "hdf5:open_hdf5", "ingest"),
    "tdms": Format("TDMS", (".tdms",), "tdms:open_tdms", "ingest"),
    "parquet": Format("Parquet", (".parquet", ".pq"), "arrow:open_parquet"),
    "feather": Format("Feather", (".feather", ".arrow"), "arrow:open_feather"),
    "ros": Format("ROS bags (.bag, .mcap, .db3)", (".bag", ".mcap", ".db3"), "ros:open_ros", "ros"),
    "mdf": Format("MDF (.mf4)", (".mf4", ".mdf"), "mdf:open_mdf", "mdf"),
}
"""By the name that a map gives as `format`."""

FORMAT_OF_ENDING = {ending: name for name, one in FORMATS.items() for ending in one.endings}

ROS2_INDEX = "metadata.yaml"
"""A ROS 2 bag is a folder that holds this file."""


def format_by_ending(path: Path) -> str | None:
    """Return the format that a file's ending tells, or None; ``.gz`` is passed over.

    Examples
    --------
    >>> format_by_ending(Path("log.CSV.gz")), format_by_ending(Path("log.xlsx"))
    ('csv', None)
    """
    if is_ros2_bag(path):
        return "ros"
    suffixes = [suffix.lower() for suffix in path.suffixes if suffix.lower() != ".gz"]
    return FORMAT_OF_ENDING.get(suffixes[-1] if suffixes else "")


def is_ros2_bag(path: Path) -> bool:
    """Return whether a folder is one recording: a ROS 2 bag."""
    return path.is_dir() and (path / ROS2_INDEX).is_file()


def known_endings() -> str:
    """Return what can be read, for a message."""
    *most, last = (one.shown for one in FORMATS.values())
    return f"{', '.join(most)} and {last}"
