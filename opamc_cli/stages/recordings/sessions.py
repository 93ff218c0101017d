"""Which recordings belong to one recording session: those of one night are not independent."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import MAXYEAR, MINYEAR, UTC, date, datetime, timedelta
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # with it come the tables, which a look at a cell does without
    from opamc_cli.storage.sources import RunSource

BY_SESSION, BY_NIGHT, BY_FOLDER, BY_FILE = "session", "night", "folder", "file"


@dataclass(frozen=True)
class Sessions:
    """The recording sessions of one side of a diagnosis."""

    of_run: Mapping[str, str]
    """Session by run name."""
    told_by: tuple[str, ...]
    """How they were told apart, by preference: "session", "night", "folder", "file"."""
    wrong_clocks: int = 0
    """Recordings whose `started_at` is more than a day off the date of their folder."""
    unread_clocks: int = 0
    """Recordings whose `started_at` is in a year that no clock was set to."""

    def named(self, session: str) -> str:
        """Return a session's name with its kind: "night 2026-03-12"."""
        return f"{self.told_by[0]} {session}" if len(self.told_by) == 1 else session

    def __len__(self) -> int:
        """Return the number of sessions."""
        return len(set(self.of_run.values()))


def sessions_of(
    sources: "Sequence[RunSource]", day_starts_at_h: float | None, by_folder: bool = False
) -> Sessions:
    """Group recordings into sessions.

    Parameters
    ----------
    sources
        Recordings of one side.
    day_starts_at_h
        Hour of the day, UTC, at which one night ends and the next begins; None: a folder whose
        name is a date is a night, whatever `started_at` says.
    by_folder
        Whether the folders of recordings without session and time tell them apart; see
        `lie_in_folders`.

    Returns
    -------
    Sessions
        By metadata `session`, else the day of `started_at`, else the folder, else the file. A
        folder whose name is a date more than a day off comes before `started_at`: a clock that was
        never set would make one session of all.
    """
    told: dict[str, tuple[str, str]] = {}
    wrong_clocks = 0
    for source in sources:
        named = _date_of(source.path.parent.name)
        by_clock = day_starts_at_h is not None or named is None
        night = night_of(source.info.started_at, day_starts_at_h or 0.0) if by_clock else named
        if source.info.session is not None:
            told[source.name] = (BY_SESSION, source.info.session)
        elif night and named and abs((night - named).days) > 1:
            wrong_clocks += 1
            told[source.name] = (BY_FOLDER, source.path.parent.as_posix())
        elif night is not None:
            told[source.name] = (BY_NIGHT, night.isoformat())
        elif by_folder:
            told[source.name] = (BY_FOLDER, source.path.parent.as_posix())
        else:
            told[source.name] = (BY_FILE, source.name)
    kinds = {kind for kind, _ in told.values()}
    return Sessions(
        # a night and a folder may have the same name and are not the same session
        {run: name if len(kinds) == 1 else f"{kind} {name}" for run, (kind, name) in told.items()},
        tuple(kind for kind in (BY_SESSION, BY_NIGHT, BY_FOLDER, BY_FILE) if kind in kinds),
        wrong_clocks,
        sum(bool(s.info.started_at) and started(s.info.started_at) is None for s in sources),
    )


def _date_of(name: str) -> date | None:
    try:
        return date.fromisoformat(name)
    except ValueError:
        return None


def lie_in_folders(baseline: "Sequence[RunSource]") -> bool:
    """Tell whether folders are sessions: one folder for all is only where the baseline lies."""
    return len({source.path.parent for source in baseline}) > 1


def night_of(started_at: str | None, day_starts_at_h: float) -> date | None:
    """Return the day to which a recording counts, None if its time is unknown.

    A day that starts at noon has the whole of a night shift: 2026-03-02T03:00Z counts to
    2026-03-01.
    """
    time = started(started_at)
    return None if time is None else (time - timedelta(hours=day_starts_at_h)).date()


def started(text: str | None) -> datetime | None:
    """Return the time that ISO 8601 text states, UTC where it names no zone; None if it does not.

    A clock that was never set is none: a year without neighbours has no night before or after it.

    A zone other than UTC is turned into it, so that a night does not depend on how it was written.
    """
    if not text:
        return None
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        return None
    if not MINYEAR < time.year < MAXYEAR:
        return None
    return time.replace(tzinfo=UTC) if time.tzinfo is None else time.astimezone(UTC)


def in_words(baseline: Sessions, target: Sessions) -> list[str]:
    """Say what is worth knowing about how sessions were told apart."""
    notes = []
    for name, side in (("baseline", baseline), ("target", target)):
        told = {BY_SESSION: "their session", BY_NIGHT: "night", BY_FOLDER: "folder"}
        kinds = [told[kind] for kind in side.told_by if kind in told]
        if kinds and len(side) < len(side.of_run):
            notes.append(
                f"{name}: {len(side.of_run)} runs are {len(side)} "
                f"session{'' if len(side) == 1 else 's'}, told apart by {' and '.join(kinds)}"
            )
        if side.wrong_clocks:
            notes.append(
                f"{name}: started_at of {side.wrong_clocks} of {len(side.of_run)} runs is more "
                "than a day off the date of their folder, which counts; set the logger's clock"
            )
        if side.unread_clocks:
            notes.append(
                f"{name}: started_at of {side.unread_clocks} of {len(side.of_run)} runs is no time "
                "as 2026-03-01T22:00:00Z is, and tells no session"
            )
    alone = sum(len(side) for side in (baseline, target) if BY_FILE in side.told_by)
    if alone > 2:
        notes.append(
            "nothing says which runs were recorded together (no session or started_at in their "
            "metadata, no folders): each is taken for a session of its own"
        )
    shared = sorted(set(baseline.of_run.values()) & set(target.of_run.values()))
    if shared and set(baseline.told_by) & {BY_SESSION, BY_NIGHT}:
        notes.append(
            f"{shared[0]} is a session of both baseline and target: what it alone had counts on "
            "both sides"
        )
    return notes
