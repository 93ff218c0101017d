"""What a plan is made of, and what it is made from."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from opamc_cli.config.cell import BaselineConfig
from opamc_cli.stages.nightly.inputs.recordings import Recording
from opamc_cli.storage.history.rows import AlarmSpan, NightRow


@dataclass(frozen=True)
class Comparison:
    """The recordings of one program in one night, and those that they are held against."""

    program: str
    condition: str
    """With `program`: what they have in common."""
    targets: tuple[Recording, ...]
    """Recordings of the night."""
    baseline: tuple[Recording, ...] = ()
    """Recordings of the healthy state; empty while it is being recorded."""
    baseline_name: str = ""
    """Name of the baseline; the series of nights begins anew where it changes."""
    missing: str = ""
    """Why there is nothing to compare with; empty if there is."""
    members: tuple[str, ...] = ()
    """Nights of a baseline that is complete, with or without their recordings."""
    lost: bool = False
    """Whether some of these have none any more."""
    gone: tuple[Recording, ...] = ()
    """Recordings that the others once had beside those that are left."""
    picked: bool = False
    """Whether the baseline is of recordings that a user has named, not of nights."""

    absent: tuple[str, ...] = ()
    """Other programs that each night of the baseline has, and this one has not."""
    running: bool = False
    """Whether more may be recorded in the night."""

    @property
    def lacking(self) -> Iterator[str]:
        """Say that the night has fewer recordings than each of the baseline's, if it has.

        Fewer by more than these differ among themselves. Of a baseline of one night, or of
        recordings that a user has picked, nobody knows how many there are to be.
        """
        if self.running:
            return
        for program in self.absent:
            yield f"no recording of program {program!r} where each night of the baseline has one"
        nights = Counter(one.night for one in (*self.baseline, *self.gone))
        have = len(self.targets)
        if self.picked or len(nights) < 2:
            return
        least, most = min(nights.values()), max(nights.values())
        if have >= least - (most - least):
            return
        recordings = "1 recording" if have == 1 else f"{have} recordings"
        program = f" of program {self.program!r}" * bool(self.program)
        usual = f"{least}" if least == most else f"{least} to {most}"
        yield f"{recordings}{program} where each night of the baseline has {usual}"


@dataclass(frozen=True)
class PlannedNight:
    """One robot's night."""

    robot: str
    night: str
    comparisons: tuple[Comparison, ...]
    """One for each program."""
    broken: tuple[Recording, ...]
    """Recordings that cannot be used."""
    notes: tuple[str, ...]
    """What is worth knowing besides."""
    key: str
    """Hash of everything that the result depends on."""
    why: str
    """Why it is to be done; empty if it is done."""

    @property
    def in_baseline(self) -> bool:
        """Whether nothing is judged: the night is, or will be, part of the healthy state."""
        return bool(self.comparisons) and not any(
            one.baseline or one.missing for one in self.comparisons
        )


@dataclass(frozen=True)
class Situation:
    """What is known of a robot beside its recordings."""

    baseline: BaselineConfig
    """How the cell tells the healthy state."""
    fixed: Sequence[Recording]
    """Recordings that `baseline.runs` names."""
    gone: Sequence[Recording]
    """Recordings that are there no more."""
    gone_fixed: Sequence[Recording]
    """Those that `baseline.runs` names."""
    begun: Sequence[str]
    """Nights from which a baseline was declared to begin anew, ascending."""
    pinned: Mapping[tuple[str, str, str], Sequence[str]]
    """Nights of baselines that were complete before, by program, condition and since."""
    recorded: Mapping[str, NightRow]
    """What became of the robot's nights."""
    removed: Sequence[str]
    """Nights whose results somebody has removed."""
    config_hash: str
    """Of the options of its diagnosis."""
    alarms: Sequence[AlarmSpan] = ()
    """Its alarms, by the night in which they were raised."""
    is_to_come: Callable[[str], bool] = bool
    """Whether this start will judge a night if it has to be."""
    is_running: Callable[[str], bool] = lambda _: False
    """Whether more may be recorded in a night."""


@dataclass(frozen=True)
class RobotPlan:
    """All nights of a robot, and the baselines that are complete by now."""

    nights: tuple[PlannedNight, ...]
    complete: Mapping[tuple[str, str, str], tuple[str, ...]]
    thinned: tuple[tuple[str, str], ...] = ()
    """Of baselines that lost recordings: what is gone, and a sentence."""
    gathering: tuple[tuple[str, str], ...] = ()
    """Of conditions without a baseline beside others that have one: first night, and a sentence."""
    waiting: bool = False
    """Whether there is more to do once these nights are judged and alarms are known."""

    @property
    def several_conditions(self) -> bool:
        """Whether the robot has nights of more than one program or condition."""
        all_of = (
            (one.program, one.condition) for night in self.nights for one in night.comparisons
        )
        return len(set(all_of)) > 1
