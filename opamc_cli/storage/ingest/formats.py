"""Formats of foreign recordings: which endings tell them, and what each needs to be read."""

from pathlib import Path

FORMAT_OF_ENDING = {
    ".csv": "csv",
    ".txt": "csv",
    ".tsv": "csv",
    ".dat": "csv",
    ".mat": "mat",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".hdf": "hdf5",
    ".tdms": "tdms",
    ".parquet": "parquet",
    ".pq": "parquet",
    ".feather": "feather",
    ".arrow": "feather",
    ".bag": "ros",
    ".mcap": "ros",
    ".db3": "ros",
    ".mf4": "mdf",
    ".mdf": "mdf",
}

EXTRA_OF_FORMAT = {"hdf5": "ingest", "tdms": "ingest", "ros": "ros", "mdf": "mdf"}
"""Which extra of the package brings a format's library; the others are always there."""

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
    return "CSV, MAT, HDF5, TDMS, Parquet, Feather, ROS bags (.bag, .mcap, .db3) and MDF (.mf4)"
