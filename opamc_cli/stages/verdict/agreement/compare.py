"""The questions of this package in the order of a diagnosis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from opamc_cli.config.models import IdentifyConfig
from opamc_cli.stages.chain.compared.speeds import OTHER_SPEEDS, TWO_SPEEDS
from opamc_cli.stages.chain.cycles.axis import match_rule
from opamc_cli.stages.chain.segment import SegmentOutcome
from opamc_cli.stages.processes.kept import KeptResults
from opamc_cli.stages.verdict.agreement.exchanged import exchanged
from opamc_cli.stages.verdict.agreement.findings import Finding, Reference, findings, reference_of
from opamc_cli.stages.verdict.agreement.measured import Measured, measure
from opamc_cli.stages.verdict.agreement.unjudged import (
    Side,
    Unjudged,
    refuse_all,
    sentence,
    unjudged,
)
from opamc_cli.stages.verdict.agreement.whole import not_whole, of_odd_warmth, with_gaps
from opamc_cli.storage.schemas.tables import MOTIONS
from opamc_cli.storage.sources import read_sources
from opamc_cli.storage.tables import read_table, record_at


@dataclass
class Agreement:
    """What is known so far of both sides: first the baseline's runs, then the target's."""

    config: IdentifyConfig
    """When segments are a cycle."""
    measured: dict[str, Sequence[Measured]] = field(default_factory=dict)
    found: dict[str, Sequence[Finding]] = field(default_factory=dict)
    missing: dict[str, Mapping[tuple[str, int], int]] = field(default_factory=dict)
    """With `measured`, `found`: by role."""
    _reference: Reference | None = None

    def check(
        self,
        role: str,
        segmented: SegmentOutcome,
        motions: Path | None = None,
        kept: KeptResults | None = None,
    ) -> set[tuple[str, int]]:
        """Return run and axis of the segments that cannot be compared with the baseline.

        Parameters
        ----------
        role
            "baseline", then "target".
        segmented
            Segments of its runs.
        motions
            Motion table with the reference cycles, once there is one.
        kept
            Where results of the same work may lie.

        Raises
        ------
        NotEnoughDataError
            If nothing is left.
        """
        own = measure(read_sources(segmented.path), segmented.table, kept)
        if self._reference is None:
            self._reference = reference_of(own)
        self.measured[role], self.missing[role] = own, segmented.missing
        found = findings(own, self._reference)
        if motions is not None:
            table = read_table(motions, "identify", MOTIONS)
            cycles = table.filter(table["reference"])
            found += exchanged(own, segmented.table, cycles, self.config)
        self.found[role] = found
        moving = {(each.run, each.axis) for each in own if each.moves}
        if moving <= {(finding.run, finding.axis) for finding in self.found[role]}:
            refuse_all({f.axis: (sentence(role, f.why),) for f in found})
        return {(finding.run, finding.axis) for finding in self.found[role]}

    def unjudged(self, baseline: Path, target: Path) -> Unjudged:
        """Return what is left out, or missing, once the motions of both sides are identified.

        Parameters
        ----------
        baseline, target
            Tables of stage `identify`.
        """
        sides = [
            Side(
                role,
                self.measured[role],
                self.found[role],
                read_table(path, "identify", MOTIONS),
                record_at(path).get(OTHER_SPEEDS, {}),
                match_rule(self.config),
                record_at(path).get(TWO_SPEEDS, ()),
                self.missing[role],
            )
            for role, path in (("baseline", baseline), ("target", target))
        ]
        found = unjudged(sides[0], sides[1])
        of_target = (*not_whole(*sides), *with_gaps(*sides), *of_odd_warmth(*sides))
        return replace(found, errors=(*found.errors, *of_target))
