"""How the history's file is made, and what may stand in it."""

import re
import sqlite3
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args, get_type_hints

from pydantic import TypeAdapter

from opamc_cli.storage.history.rows import (
    AlarmRow,
    Declared,
    Event,
    FileRow,
    MeasureRow,
    NightRow,
    VerdictRow,
)
from opamc_cli.storage.logs import Facts

SCHEMA_VERSION = 1
SCHEMA = """
CREATE TABLE verdict (
  robot TEXT NOT NULL, program TEXT NOT NULL, axis INTEGER NOT NULL, night TEXT NOT NULL,
  state TEXT NOT NULL, health_index REAL, p_value REAL, cause TEXT, alarm INTEGER NOT NULL,
  temperature_c REAL, payload_kg REAL, speed_percent REAL, n_runs INTEGER NOT NULL,
  report TEXT, config_hash TEXT NOT NULL, version TEXT NOT NULL,
  PRIMARY KEY (robot, program, axis, night)
) WITHOUT ROWID;
CREATE TABLE event (
  time TEXT NOT NULL, robot TEXT NOT NULL, axis INTEGER, kind TEXT NOT NULL, text TEXT NOT NULL
);
CREATE INDEX event_of ON event (robot, kind);
CREATE TABLE measure (
  robot TEXT NOT NULL, program TEXT NOT NULL, axis INTEGER NOT NULL, night TEXT NOT NULL,
  baseline TEXT NOT NULL, distance REAL, common REAL, effect REAL, harmless INTEGER NOT NULL,
  reason TEXT NOT NULL,
  PRIMARY KEY (robot, program, axis, night)
) WITHOUT ROWID;
CREATE TABLE night (
  robot TEXT NOT NULL, night TEXT NOT NULL, key TEXT NOT NULL, status TEXT NOT NULL,
  attempts INTEGER NOT NULL, why TEXT NOT NULL, notes TEXT NOT NULL,
  PRIMARY KEY (robot, night)
) WITHOUT ROWID;
CREATE TABLE file (
  path TEXT NOT NULL PRIMARY KEY, robot TEXT NOT NULL, night TEXT, size INTEGER NOT NULL,
  mtime_ns INTEGER NOT NULL, sha256 TEXT NOT NULL, facts TEXT NOT NULL
) WITHOUT ROWID;
CREATE INDEX file_of ON file (robot);
CREATE TABLE baseline (
  robot TEXT NOT NULL, program TEXT NOT NULL, condition TEXT NOT NULL, since TEXT NOT NULL,
  night TEXT NOT NULL, PRIMARY KEY (robot, program, condition, since, night)
) WITHOUT ROWID;
CREATE TABLE declared (
  time TEXT NOT NULL, robot TEXT NOT NULL, axis INTEGER, kind TEXT NOT NULL, night TEXT NOT NULL,
  why TEXT NOT NULL
);
CREATE TABLE alarm (
  robot TEXT NOT NULL, program TEXT NOT NULL, axis INTEGER NOT NULL, raised TEXT NOT NULL,
  since TEXT NOT NULL, cleared TEXT, acknowledged TEXT, text TEXT NOT NULL, trend TEXT NOT NULL,
  PRIMARY KEY (robot, program, axis, raised)
) WITHOUT ROWID;
CREATE TABLE told (
  robot TEXT NOT NULL, axis INTEGER NOT NULL, kind TEXT NOT NULL, time TEXT NOT NULL,
  PRIMARY KEY (robot, axis, kind, time)
) WITHOUT ROWID;
CREATE TABLE rule (hash TEXT NOT NULL);
CREATE TABLE stale (robot TEXT NOT NULL PRIMARY KEY) WITHOUT ROWID;
"""


@dataclass(frozen=True)
class NightKey:
    """What a night was judged from."""

    version: str
    config: str
    baseline: str
    files: list[str]
    members: str = ""


@dataclass(frozen=True)
class Trend:
    """Where a joint under alarm is heading, as far as it is looked at again."""

    reach: list[int] | None = None


DOCUMENTS: Mapping[type, tuple[str, Any]] = {
    NightRow: ("key", NightKey),
    FileRow: ("facts", Facts),
    AlarmRow: ("trend", Trend),
}
"""Columns that hold JSON, and what it has to be."""


ADAPTERS = {document: TypeAdapter(document) for _, document in DOCUMENTS.values()}
"""Readers of these."""


def _columns() -> dict[str, tuple[type, ...]]:
    """Return what may stand in each column, by its name, in whatever table it is."""
    found: dict[str, tuple[type, ...]] = {}
    for row in (VerdictRow, MeasureRow, NightRow, FileRow, Event, Declared, AlarmRow):
        for name, hint in get_type_hints(row).items():
            kinds = get_args(hint) or (hint,)
            found[name] = (*found.get(name, ()), *kinds, *((int,) if float in kinds else ()))
    return found


COLUMNS = _columns()

WORDS = {
    "state": ("healthy", "changed", "fault", "insufficient-data"),
    "status": ("done", "partial", "baseline", "failed", "broken"),
}
"""All that may stand in a column."""

NIGHT = re.compile(r"\d{4}-\d\d-\d\d|")


def layout_of(db: sqlite3.Connection) -> set[tuple[str, str]]:
    """Return how each table and index was made."""
    query = "SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL"
    return {(str(name), " ".join(str(sql).split())) for name, sql in db.execute(query)}
