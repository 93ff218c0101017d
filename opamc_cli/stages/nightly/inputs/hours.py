"""At what hour a robot's nights are usually recorded: a night that goes on has lost nothing."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from opamc_cli.decision.trend.alarm import LATELY
from opamc_cli.stages.nightly.inputs.recordings import Recording
from opamc_cli.stages.recordings.sessions import started


@dataclass(frozen=True)
class Hours:
    """The latest hours of a robot's last nights, from the midnight, UTC, of a night's date."""

    first: timedelta | None = None
    """At which a night's first recording began; None where no time is stated."""
    last: timedelta | None = None
    """At which its last one did."""

    def may_begin(self, night: str, now: datetime) -> bool:
        """Whether a night without a recording may have its first one later than now."""
        return _is_before(night, self.first, now)

    def may_go_on(self, night: str, now: datetime) -> bool:
        """Whether a night may have more recordings later than now."""
        return _is_before(night, self.last, now)


def usual_hours(recordings: Sequence[Recording]) -> Hours:
    """Return a robot's hours in its last nights but the very last, which may go on."""
    times: dict[str, list[timedelta]] = {}
    for one in recordings:
        began = started(one.facts.started_at)
        if one.night and began is not None:
            times.setdefault(one.night, []).append(began - _midnight(one.night))
    lately = [times[night] for night in sorted(times)[-LATELY - 1 : -1]]
    if not lately:
        return Hours()
    return Hours(max(map(min, lately)), max(map(max, lately)))


def _midnight(night: str) -> datetime:
    return datetime.fromisoformat(night).replace(tzinfo=UTC)


def _is_before(night: str, hour: timedelta | None, now: datetime) -> bool:
    return bool(night) and hour is not None and now < _midnight(night) + hour
