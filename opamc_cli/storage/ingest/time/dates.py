"""Dates and times of foreign recordings."""

from collections.abc import Sequence
from datetime import MAXYEAR, MINYEAR, UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.source import Array, Name


def has_zone(text: str) -> bool:
    """Return whether an ISO 8601 time states its distance from UTC.

    Examples
    --------
    >>> has_zone("2022-10-26T08:17:21.847Z"), has_zone("2022-10-26 08:17:21")
    (True, False)
    """
    clock = text.strip()[10:]
    return clock.endswith(("Z", "z")) or "+" in clock or "-" in clock


def timestamp_type(first: str) -> pa.DataType:
    """Return the arrow type that reads times written like `first`; without a zone, UTC is meant."""
    return pa.timestamp("us", tz="UTC") if has_zone(first) else pa.timestamp("us")


def parse_dates(path: Path, source: Name, texts: Sequence[str]) -> Array:
    """Return ISO 8601 texts as datetime64[us], UTC; empty ones become NaT.

    Raises
    ------
    InputError
        If one is something else.
    """
    known = [text or None for text in texts]
    first = next((text for text in known if text), None)
    if first is None:
        return np.full(len(texts), np.datetime64("NaT"), dtype="datetime64[us]")
    try:
        parsed = pa.array(known, pa.string()).cast(timestamp_type(first))
    except pa.ArrowException as error:
        msg = f"{path}: {source!r} is not ISO 8601 ({str(error).splitlines()[0]})"
        raise InputError(msg) from error
    return np.asarray(parsed.to_numpy(zero_copy_only=False)).astype("datetime64[us]")


def utc_text(value: object) -> str | None:
    """Return a date and time as ISO 8601 in UTC, or None where it is not one.

    Examples
    --------
    >>> utc_text("2022-10-26 10:17:21+02:00")
    '2022-10-26T08:17:21Z'
    """
    if isinstance(value, np.datetime64):
        value = value.astype("datetime64[us]").item()
    if isinstance(value, str):
        try:
            value = datetime.fromisoformat(value.strip())
        except ValueError:
            return None
    if not isinstance(value, datetime) or not MINYEAR < value.year < MAXYEAR:
        return None
    zoned = value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)
    return zoned.isoformat().replace("+00:00", "Z")
