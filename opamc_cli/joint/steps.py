"""What the rounds of the loop add, reject and cannot test."""

from dataclasses import dataclass, field

from opamc_cli.joint.effects.base import Parameters
from opamc_cli.joint.model import Term
from opamc_cli.joint.search import Candidate
from opamc_cli.joint.trace import Untestable


@dataclass(frozen=True)
class Step:
    """An effect that was added, with what spoke for it."""

    term: Term
    interpretation: str
    gain: float
    p_value: float
    decoy_gain: float
    t_value: float
    consistency: float
    ties: tuple[str, ...]
    experiment: str | None
    rmse_before_a: float
    rmse_after_a: float


@dataclass(frozen=True)
class Rejected:
    """The best form of an effect that was not added, and why."""

    effect: str
    domain: str
    parameters: Parameters
    gain: float
    p_value: float
    why: str


@dataclass
class Progress:
    """What the rounds collect.

    Attributes
    ----------
    nameless : Candidate or None
        What would have passed the gate in the last round, had a plain form not done as well.
    """

    steps: list[Step] = field(default_factory=list)
    candidates: list[tuple[int, Candidate]] = field(default_factory=list)
    rejected: dict[str, Rejected] = field(default_factory=dict)
    untestable: dict[str, Untestable] = field(default_factory=dict)
    nameless: Candidate | None = None

    def take_back(self, step: Step, why: str) -> None:
        """Note that an effect that had been added is not there, and why."""
        effect = step.term.effect
        self.rejected[effect.name] = Rejected(
            effect.name, effect.domain, step.term.parameters, step.gain, step.p_value, why
        )
