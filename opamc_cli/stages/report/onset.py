"""Since when: the first target segment that diverges more than the baseline ever did."""

from dataclasses import dataclass

import numpy as np

from opamc_cli.stages.report.focus import axis_scores
from opamc_cli.stages.report.results.inputs import ReportInputs, time_order


@dataclass(frozen=True)
class Onset:
    """How many target segments lie above the baseline's highest of the same motion."""

    n_above: int
    n_target: int
    """With `n_above`: segments above, and all."""
    first_run: str | None
    first_cycle: int | None
    """With `first_run`: where the first one lies; None where none does."""
    first_started_at: str | None
    """When that run began, if it says so."""


def find_onset(inputs: ReportInputs, axis: int, order: int) -> Onset:
    """Count the target's segments above the baseline's range, and find the first."""
    baseline = axis_scores(inputs, axis, order, "baseline")
    target = axis_scores(inputs, axis, order, "target")
    highest = {
        int(motion): float(baseline["jsd"][baseline["motion"] == motion].max())
        for motion in np.unique(baseline["motion"])
    }
    limit = np.array([highest.get(int(motion), np.inf) for motion in target["motion"]])
    above = target["jsd"] > limit
    sequence = time_order(target, inputs.roles["target"].run_rank())
    late = [row for row in sequence if above[row]]
    if not late:
        return Onset(0, int(above.size), None, None, None)
    run = str(target["run"][late[0]])
    started = {s.name: s.info.started_at for s in inputs.roles["target"].sources}
    return Onset(
        n_above=int(above.sum()),
        n_target=int(above.size),
        first_run=run,
        first_cycle=int(target["cycle"][late[0]]),
        first_started_at=started.get(run),
    )
