"""What the history knows of a cell's robots when a start looks at them."""

from pathlib import Path

from opamc_cli.config.cell import CellConfig
from opamc_cli.stages.nightly.plan.planned import PlannedNight
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import NightRow, begun_anew
from opamc_cli.storage.schemas import files


class Past:
    """What the history knows, by robot."""

    def __init__(self, cell: CellConfig, history: History) -> None:
        self.recorded: dict[str, dict[str, NightRow]] = {}
        for (robot, night), row in history.nights().items():
            self.recorded.setdefault(robot, {})[night] = row
        self.pinned: dict[str, dict[tuple[str, str, str], list[str]]] = {}
        for (robot, *key), nights in history.baselines().items():
            self.pinned.setdefault(robot, {})[key[0], key[1], key[2]] = nights
        self.begun: dict[str, list[str]] = {}
        for robot, night in begun_anew(history.declared()):
            self.begun.setdefault(robot, []).append(night)
        self.alarms = history.spans()
        self.removed: dict[str, list[str]] = {}
        for robot, reports in history.reports().items():
            # those of before are pruned, by a start that may have been killed at it
            for night in list(reports)[-cell.keep.reports :]:
                places = [cell.out / report for report in reports[night]]
                files_of = [p for at in places for p in (at, at.with_name(files.VERDICT))]
                if not all(map(Path.is_file, files_of)):
                    self.removed.setdefault(robot, []).append(night)

    def attempts_at(self, night: PlannedNight) -> int:
        """Return in how many starts a night of the same inputs broke."""
        last = self.recorded.get(night.robot, {}).get(night.night)
        return last.attempts if last and last.key == night.key else 0
