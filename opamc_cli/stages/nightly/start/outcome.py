"""What is asked of a start, and what it did."""

from dataclasses import dataclass, field

from opamc_cli.stages.nightly.plan.planned import PlannedNight
from opamc_cli.stages.nightly.summary import Summary
from opamc_cli.storage.history.rows import UNJUDGED, Event, NightRow


@dataclass(frozen=True)
class Wanted:
    """Which nights are asked for; None: all."""

    night: str | None = None
    since: str | None = None
    """YYYY-MM-DD, as `night`."""
    robots: tuple[str, ...] | None = None
    """Names."""

    def has(self, night: str) -> bool:
        """Whether a night is asked for."""
        return self.night in (None, night) and (self.since is None or night >= self.since)


@dataclass
class CellOutcome:
    """What a start did."""

    planned: dict[tuple[str, str], PlannedNight] = field(default_factory=dict)
    """Every night that was looked at by robot and night, with why it was to be done."""
    done: list[tuple[str, str]] = field(default_factory=list)
    """Robot and night of those that were judged or taken into a baseline."""
    failed: list[tuple[str, str, str]] = field(default_factory=list)
    """Robot, night and why; of nights that were judged in part as well."""
    unjudged: set[tuple[str, str]] = field(default_factory=set)
    """Robot and night of those with a joint that could not be judged."""
    absent: list[str] = field(default_factory=list)
    """Sentences that say of what was asked for that there is no recording of it."""
    thinned: list[Event] = field(default_factory=list)
    """Baselines that have lost recordings."""
    gathering: dict[str, list[Event]] = field(default_factory=dict)
    """Conditions of which no night is judged yet, by robot."""
    strays: list[Event] = field(default_factory=list)
    """Recordings that lie in the place of a night and are called otherwise."""
    unnamed: list[Event] = field(default_factory=list)
    """Robots with recordings that the cell's file does not name."""
    ended: str = ""
    """Why the start came to an end before all was done; empty if it did not."""
    robots: tuple[str, ...] = ()
    """Those that were looked at."""
    summary: Summary = field(default_factory=lambda: Summary(()))
    """How all robots of the cell stand now."""

    def plan(self, night: PlannedNight) -> None:
        """Note that a night is looked at, perhaps again in the light of others."""
        place = (night.robot, night.night)
        if place in self.planned:
            if not night.why:
                return
            self.done = [one for one in self.done if one != place]
            self.failed = [one for one in self.failed if one[:2] != place]
        self.planned[place] = night

    def note(self, row: NightRow) -> None:
        """Note what became of a night."""
        if row.status not in UNJUDGED:
            self.done.append((row.robot, row.night))
        if row.why:
            self.failed.append((row.robot, row.night, row.why))
