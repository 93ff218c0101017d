"""The history of a cell: one SQLite file, every night that was judged, and what was said of it.

The tables `verdict` and `event` are for everybody; the others hold what the next start needs. All
that one start learns of one robot's night is one transaction: after a kill or a power cut it is
there or it is not. Nothing in the file depends on the order in which nights were computed, nor on
the clock, but the times at which a user acknowledged or declared something.
"""

import json
import os
import sqlite3
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import astuple
from pathlib import Path
from typing import Any, NoReturn, Self, TypeVar

from pydantic import ValidationError

from opamc_cli.errors import InputError, UsageError
from opamc_cli.storage.files.atomic import ensure_directory
from opamc_cli.storage.history.layout import (
    ADAPTERS,
    COLUMNS,
    DOCUMENTS,
    NIGHT,
    SCHEMA,
    SCHEMA_VERSION,
    WORDS,
    layout_of,
)
from opamc_cli.storage.history.rows import (
    OF_ROBOT,
    AlarmRow,
    AlarmSpan,
    Declared,
    Event,
    FileRow,
    MeasureRow,
    NightRow,
    VerdictRow,
)

BUSY_S = 60.0
"""Another process may be writing: its transactions last milliseconds."""

UNTOLD = "DELETE FROM told WHERE (robot, axis, kind, time) = (?, ?, ?, ?)"
"""What makes news of an event again, by its key."""

Row = TypeVar("Row")


def _writable(path: Path) -> bool:
    return all(os.access(one, os.W_OK) for one in (path, path.parent))


def _to_read(path: Path) -> str:
    """Return the address of a history that may only be read, such as a colleague's.

    Where nobody has it open there is no log beside it, and what does not change needs none.
    """
    logged = path.with_name(f"{path.name}-wal").exists()
    return f"{path.absolute().as_uri()}?{'mode=ro' if logged else 'immutable=1'}"


class History:
    """An open history.

    Parameters
    ----------
    path
        The file; made if it is not there, unless `read_only`.
    read_only
        For those who look only.

    Raises
    ------
    InputError
        If there is no history, or the file is none of ours.
    UsageError
        If the file cannot be opened or written.
    """

    def __init__(self, path: Path, *, read_only: bool = False) -> None:
        self.path = path
        self._nights: tuple[tuple[int, ...], dict[tuple[str, str], NightRow]] = ((), {})
        if read_only and not path.is_file():
            msg = f"{path}: no history here yet; `opamc nightly` writes it"
            raise InputError(msg)
        if not read_only:
            ensure_directory(path.parent)
        with self._errors():
            if read_only and not _writable(path):
                self._db = sqlite3.connect(_to_read(path), uri=True, isolation_level=None)
            else:
                # WAL needs to write beside the file even to read it; a reader locks nobody out
                self._db = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
                self._db.execute("PRAGMA journal_mode = WAL")
                self._db.execute("PRAGMA synchronous = FULL")
            self._prepare(read_only)

    def _prepare(self, read_only: bool) -> None:
        version = self._db.execute("PRAGMA user_version").fetchone()[0]
        if version == 0 and read_only:
            msg = f"{self.path}: holds no history of opamc; `opamc nightly` writes one"
            raise InputError(msg)
        if version == 0:
            with self.transaction():
                # another process may have been first
                if self._db.execute("PRAGMA user_version").fetchone()[0] == 0:
                    if layout_of(self._db):
                        msg = f"{self.path}: is a database of something else; move it away"
                        raise InputError(msg)
                    for statement in SCHEMA.split(";"):
                        self._db.execute(statement)
                    self._db.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        elif version != SCHEMA_VERSION:
            msg = (
                f"{self.path}: is a history of layout {version}, this opamc knows "
                f"{SCHEMA_VERSION}; use the version that wrote it, or another `out`"
            )
            raise InputError(msg)
        else:
            with closing(sqlite3.connect(":memory:")) as new:
                new.executescript(SCHEMA)
                if layout_of(new) != layout_of(self._db):
                    msg = (
                        f"{self.path}: its tables are not as opamc makes them; move the file away, "
                        "nights are judged again"
                    )
                    raise InputError(msg)

    def __enter__(self) -> Self:
        """Return the history itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._db.close()

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
            # of a damaged file even the name of what is wrong may be no text
            if any(word in str(error) for word in ("not a database", "malformed", "decode")):
                msg = f"{self.path}: is no history of opamc ({error}); move it away"
                raise InputError(msg) from error
            advice = "check space and permissions"
            if "locked" in str(error):  # another opamc would hold the lock of `out`
                advice = "another program has it open; close that one, or wait, and start again"
            msg = f"{self.path}: cannot be written or read ({error}); {advice}"
            raise UsageError(msg) from error

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Make what is written inside whole or absent."""
        with self._errors():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield
            except BaseException:
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")
                raise
            self._db.execute("COMMIT")

    def rows(self, query: str, values: Sequence[Any] = ()) -> list[dict[str, Any]]:
        """Return all rows of a query, each by its columns' names.

        Raises
        ------
        InputError
            If a value is none of its column's: somebody else wrote it.
        """
        with self._errors():
            cursor = self._db.execute(query, values)
            names = [column[0] for column in cursor.description]
            found = [dict(zip(names, row, strict=True)) for row in cursor]
        for name in COLUMNS.keys() & set(names):
            for row in found:
                known = row[name] in WORDS[name] if name in WORDS else True
                if name == "night" and isinstance(row[name], str):
                    known = NIGHT.fullmatch(row[name]) is not None
                if not (known and isinstance(row[name], COLUMNS[name])):
                    self._refuse(name, f"{row[name]!r:.60}")
        return found

    def _refuse(self, column: str, why: str) -> NoReturn:
        msg = (
            f"{self.path}: column {column} holds what opamc did not write ({why}); move the file "
            "away, nights are judged again"
        )
        raise InputError(msg)

    def _read(self, kind: type[Row], query: str) -> list[Row]:
        """Return all rows of a query as what they have to be.

        Raises
        ------
        InputError
            If one is something else: it was edited.
        """
        found = [kind(**row) for row in self.rows(query)]
        if kind in DOCUMENTS:
            column, document = DOCUMENTS[kind]
            for row in found:
                try:
                    ADAPTERS[document].validate_json(getattr(row, column))
                except ValidationError as error:
                    first = error.errors(include_url=False)[0]
                    place = ".".join(str(part) for part in first["loc"])
                    self._refuse(column, f"{place} {first['msg']}".strip()[:200])
        return found

    # -- what the next start needs -----------------------------------------------------------

    def files(self) -> dict[str, FileRow]:
        """Return every recording that is remembered, by path."""
        return {row.path: row for row in self._read(FileRow, "SELECT * FROM file")}

    def remember_files(self, files: Iterable[FileRow]) -> None:
        """Remember recordings that were read."""
        with self.transaction():
            self._put("file", files)

    def is_new(self) -> bool:
        """Whether no start has looked at a recording yet."""
        return not self.rows("SELECT path FROM file LIMIT 1") and not self.nights()

    def nights(self) -> dict[tuple[str, str], NightRow]:
        """Return what became of every robot's night.

        A start asks five times; to read thousands of nights once is a twelfth of one without news.
        """
        with self._errors():
            others = self._db.execute("PRAGMA data_version").fetchone()
        now = (self._db.total_changes, *others)
        then, found = self._nights
        passing = self._db.in_transaction  # to take it back counts as no change
        if passing or then != now:
            rows = self._read(NightRow, "SELECT * FROM night")
            found = {(row.robot, row.night): row for row in rows}
            self._nights = (() if passing else now), found
        return dict(found)

    def baselines(self) -> dict[tuple[str, str, str, str], list[str]]:
        """Return the nights of every complete baseline, by robot, program, condition and since."""
        found: dict[tuple[str, str, str, str], list[str]] = {}
        for row in self.rows("SELECT * FROM baseline ORDER BY night"):
            key = (row["robot"], row["program"], row["condition"], row["since"])
            found.setdefault(key, []).append(row["night"])
        return found

    def pin_baseline(self, key: tuple[str, str, str, str], nights: Iterable[str]) -> None:
        """Remember the nights of a baseline that is complete: other recordings do not move it."""
        with self.transaction():
            self._db.execute(
                "DELETE FROM baseline "
                "WHERE robot = ? AND program = ? AND condition = ? AND since = ?",
                key,
            )
            self._db.executemany(
                "INSERT OR REPLACE INTO baseline VALUES (?, ?, ?, ?, ?)",
                [(*key, night) for night in nights],
            )

    def record_night(
        self,
        night: NightRow,
        verdicts: Iterable[VerdictRow] = (),
        measures: Iterable[MeasureRow] = (),
        events: Iterable[Event] = (),
    ) -> None:
        """Record a robot's night, in the place of what was known of it; said again is no news."""
        with self.transaction():
            place = (night.robot, night.night)
            # another reason than the one that was told is news; a night that was judged before and
            # is not now may be of a row of nights that is told by its first one
            of = "kind IN ('failed', 'partial') AND robot = ? AND time"
            self._db.execute(
                f"DELETE FROM told WHERE {of} = (SELECT max(time) FROM told WHERE {of} <= ?) AND "
                "EXISTS (SELECT * FROM night WHERE robot = ? AND night = ? AND ? NOT IN ('', why))",
                (night.robot, *place, *place, night.why),
            )
            if self._begins_anew(night):  # an alarm that it raises is another one, and is news
                of = "WHERE robot = ? AND substr(time, 1, 10) = ? AND kind"
                self._db.execute(f"DELETE FROM told {of} = 'reminder'", place)
                self._db.execute(
                    f"UPDATE OR REPLACE told SET kind = 'known' {of} = 'stands'", place
                )
            for table in ("verdict", "measure"):
                self._db.execute(f"DELETE FROM {table} WHERE robot = ? AND night = ?", place)
            self._put("night", [night])
            self._put("verdict", verdicts)
            self._put("measure", measures)
            # of an axis each of several programs may have some
            news: dict[tuple[Any, ...], list[Event]] = {}
            for one in events:
                news.setdefault(_key(one), []).append(one)
            for of_key in news.values():
                self._put_news(of_key, replaces=of_key[0].time == night.night)
            self._db.execute("INSERT OR IGNORE INTO stale VALUES (?)", (night.robot,))

    def _begins_anew(self, night: NightRow) -> bool:
        """Whether a night was judged by other nights before a user began a new baseline."""
        place, members = (night.robot, night.night), json.loads(night.key).get("members")
        return bool(
            self.rows(
                "SELECT key FROM night n JOIN declared d USING (robot) WHERE robot = ? AND "
                "n.night = ? AND d.kind = 'rebaselined' AND d.night <= n.night AND "
                "json_extract(key, '$.members') IS NOT ? LIMIT 1",
                (*place, members),
            )
        )

    def _put_news(self, events: Sequence[Event], *, replaces: bool) -> None:
        """Keep events of one key; it is news if one of them is."""
        where = "(robot, ifnull(axis, 0), kind, time) = (?, ?, ?, ?)"
        key = _key(events[0])
        said = self._db.execute(f"SELECT text FROM event WHERE {where}", key).fetchall()
        new = [one for one in events if (one.text,) not in said]
        if not new:
            return
        if replaces:
            self._db.execute(f"DELETE FROM event WHERE {where}", key)
        self._db.execute(UNTOLD, key)
        self._put("event", events if replaces else new)

    def record_news(self, event: Event) -> None:
        """Keep what somebody is to be told, whichever start comes to it."""
        with self.transaction():
            self._put_news([event], replaces=False)

    def forget_nights(self, robot: str, nights: Iterable[str]) -> None:
        """Forget nights of which nothing could be judged: their files are mended, or gone."""
        places = [(robot, night) for night in nights]
        with self.transaction():
            self._db.executemany("DELETE FROM night WHERE robot = ? AND night = ?", places)
            self._db.execute("INSERT OR IGNORE INTO stale VALUES (?)", (robot,))

    # -- trend and alarm ---------------------------------------------------------------------

    def stale(self) -> list[str]:
        """Return the robots whose alarms do not take all nights into account yet."""
        return [row["robot"] for row in self.rows("SELECT robot FROM stale ORDER BY robot")]

    def apply_rule(self, rule: str) -> None:
        """Have all alarms found anew if the rule for them has changed."""
        if [row["hash"] for row in self.rows("SELECT hash FROM rule")] == [rule]:
            return
        with self.transaction():
            self._db.execute("DELETE FROM rule")
            self._db.execute("INSERT INTO rule VALUES (?)", (rule,))
            self._db.execute("INSERT OR IGNORE INTO stale SELECT DISTINCT robot FROM night")

    def series(self, robot: str) -> list[dict[str, Any]]:
        """Return verdicts and measures of a robot by program, axis and night."""
        return self.rows(
            "SELECT v.*, m.baseline, m.distance, m.common, m.effect, m.harmless, m.reason "
            "FROM verdict v JOIN measure m USING (robot, program, axis, night) "
            "WHERE robot = ? ORDER BY program, axis, night",
            (robot,),
        )

    def settle(
        self,
        robot: str,
        alarms: Iterable[AlarmRow],
        standing: Iterable[tuple[str, int, str]],
        events: Iterable[Event],
    ) -> None:
        """Replace what follows from a robot's nights.

        Parameters
        ----------
        robot
            Its name.
        alarms
            All its alarms.
        standing
            Program, axis and night of every night in which the alarm rule stands.
        events
            What is worth saying.
        """
        found, values = list(events), (robot, *OF_ROBOT)
        of = f"WHERE robot = ? AND kind IN ({_marks(OF_ROBOT)})"
        said = [Event(**row) for row in self.rows(f"SELECT * FROM event {of}", values)]
        with self.transaction():
            self._db.execute("DELETE FROM alarm WHERE robot = ?", (robot,))
            self._db.execute(f"DELETE FROM event {of}", values)
            self._db.execute("UPDATE verdict SET alarm = 0 WHERE robot = ? AND alarm", (robot,))
            self._db.executemany(
                "UPDATE verdict SET alarm = 1 "
                "WHERE robot = ? AND program = ? AND axis = ? AND night = ?",
                [(robot, *place) for place in standing],
            )
            self._put("alarm", alarms)
            self._put("event", found)
            self._forget_told(OF_ROBOT, robot)
            # programs share their axis' key: what one of them says later is news
            before, after = Counter(map(_key, said)), Counter(map(_key, found))
            joined = [key for key, n in after.items() if n > before[key] > 0]
            self._db.executemany(UNTOLD, joined)
            self._db.execute("DELETE FROM stale WHERE robot = ?", (robot,))

    def replace_missing(self, events: Iterable[Event]) -> None:
        """Replace what is said of nights without files; it depends on all robots."""
        found = sorted(events, key=lambda one: (one.time, one.robot))
        if found == [one for one in self.events() if one.kind == "missing"]:
            return
        with self.transaction():
            self._db.execute("DELETE FROM event WHERE kind = 'missing'")
            self._put("event", found)
            self._forget_told(("missing",))

    def _forget_told(self, kinds: Sequence[str], robot: str | None = None) -> None:
        """Forget that somebody was told what is not so any more: once more it is news."""
        self._db.execute(
            f"DELETE FROM told WHERE kind IN ({_marks(kinds)}) AND robot = ifnull(?, robot) "
            "AND NOT EXISTS (SELECT * FROM event e WHERE (e.robot, ifnull(e.axis, 0), e.kind, "
            "e.time) = (told.robot, told.axis, told.kind, told.time))",
            (*kinds, robot),
        )

    def alarms(self, *, standing: bool = False) -> list[AlarmRow]:
        """Return all alarms, or those that stand, by robot, program, axis and night."""
        where = "WHERE cleared IS NULL" if standing else ""
        query = f"SELECT * FROM alarm {where} ORDER BY robot, axis, raised"
        return self._read(AlarmRow, query)

    def spans(self) -> dict[str, list[AlarmSpan]]:
        """Return from which night to which each alarm stands, and of what baseline, by robot."""
        found: dict[str, list[AlarmSpan]] = {}
        query = (
            "SELECT a.robot, a.program, a.axis, a.raised, a.cleared, m.baseline FROM alarm a "
            "JOIN measure m ON (a.robot, a.program, a.axis, a.raised) "
            "= (m.robot, m.program, m.axis, m.night) ORDER BY a.raised, a.axis, a.program"
        )
        for row in self.rows(query):
            robot, until = row.pop("robot"), row.pop("cleared") or "9999"
            found.setdefault(robot, []).append(AlarmSpan(**row, cleared=until))
        return found

    def declared(self, robot: str | None = None) -> list[Declared]:
        """Return what users declared, in the order in which they did."""
        found = self._read(Declared, "SELECT * FROM declared ORDER BY rowid")
        return [one for one in found if robot in (None, one.robot)]

    def declare(self, said: Declared, text: str) -> None:
        """Keep what a user declared, and the event that it is."""
        with self.transaction():
            self._put("declared", [said])
            self._put("event", [Event(said.time, said.robot, said.axis, said.kind, text)])
            if said.kind == "acknowledged":  # if nights raise it once more, that is news
                self._db.execute(
                    "UPDATE OR REPLACE told SET kind = 'known' "
                    "WHERE (robot, axis, kind) = (?, ?, 'stands')",
                    (said.robot, said.axis),
                )
            self._db.execute("INSERT OR IGNORE INTO stale VALUES (?)", (said.robot,))

    def events(self, *, untold: bool = False) -> list[Event]:
        """Return events in time order, or those that nobody was told of."""
        query = "SELECT * FROM event ORDER BY time, robot, axis, kind, text"
        found = self._read(Event, query)
        return self.untold(found) if untold else found

    def untold(self, events: Sequence[Event]) -> list[Event]:
        """Return those of some events that nobody was told of."""
        known = {tuple(row.values()) for row in self.rows("SELECT * FROM told")}
        return [one for one in events if _key(one) not in known]

    def told(self, kinds: Sequence[str]) -> list[Event]:
        """Return what somebody was told of some kinds, without its words."""
        query = f"SELECT * FROM told WHERE kind IN ({_marks(kinds)})"
        return [Event(**row, text="") for row in self.rows(query, kinds)]

    def tell(self, events: Iterable[Event], no_more: Iterable[Event] = ()) -> None:
        """Remember that somebody was told, and that something is so `no_more`."""
        told, over = ([_key(one) for one in said] for said in (events, no_more))
        with self.transaction():
            self._db.executemany(UNTOLD, over)
            self._db.executemany("INSERT OR IGNORE INTO told VALUES (?, ?, ?, ?)", told)

    def reports(self) -> dict[str, dict[str, list[str]]]:
        """Return where reports lie, by robot and night, in time order."""
        found: dict[str, dict[str, list[str]]] = {}
        query = "SELECT DISTINCT robot, night, report FROM verdict WHERE report IS NOT NULL"
        for row in self.rows(f"{query} ORDER BY night, report"):
            found.setdefault(row["robot"], {}).setdefault(row["night"], []).append(row["report"])
        return found

    def forget_reports(
        self, robot: str, nights: Iterable[str], events: Iterable[Event] = ()
    ) -> None:
        """Forget where the reports of nights lay that have been removed, and keep it as news."""
        with self.transaction():
            self._db.executemany(
                "UPDATE verdict SET report = NULL WHERE robot = ? AND night = ?",
                [(robot, night) for night in nights],
            )
            for one in events:
                self._put_news([one], replaces=False)

    def _put(self, table: str, rows: Iterable[Any]) -> None:
        values = [astuple(row) for row in rows]
        if values:
            self._db.executemany(
                f"INSERT OR REPLACE INTO {table} VALUES ({_marks(values[0])})", values
            )


def _key(event: Event) -> tuple[str, int, str, str]:
    """Return what is remembered of an event that somebody was told."""
    return event.robot, event.axis or 0, event.kind, event.time


def _marks(values: Sequence[object]) -> str:
    return ", ".join("?" * len(values))
