"""A fleet without chance: its sessions differ by the golden ratio's multiples, on every machine."""

import numpy as np

from opamc_cli.decision.judge import Bundle, Judgement, judge
from opamc_cli.decision.witnesses.deviation import variance_within_sessions
from opamc_cli.decision.witnesses.patterns import Cell, inflation_within_sessions
from opamc_cli.decision.witnesses.profiles import ProfileEvidence, profile_cell
from opamc_cli.decision.witnesses.spectra import SpectrumCell, SpectrumEvidence

GOLDEN = (np.sqrt(5) - 1) / 2
CYCLES, PATTERNS, BINS = 4, 24, 12

PLANS = {
    "six sessions": (6, 1, (), 0.0),
    "six sessions, two lack a motion": (6, 1, (0, 4), 0.0),
    "six sessions, all joints move": (6, 1, (), 0.5),
    "two sessions": (2, 1, (), 0.0),
    "one session": (1, 1, (), 0.0),
    "three and two": (3, 2, (), 0.0),
    "four and two, one lacks a motion": (4, 2, (1,), 0.0),
    "nine and three": (9, 3, (), 0.0),
}
"""Sessions of baseline and target, those that lack the second motion, and how all patterns move."""


def spread(*shape: int, start: int = 1) -> np.ndarray:
    """Return numbers between -1 and 1 that fill it evenly, whatever their number."""
    return 2 * np.modf((np.arange(np.prod(shape)) + start) * GOLDEN)[0].reshape(shape) - 1


def bundle(
    axis: int, n_baseline: int, n_target: int, lacking: tuple[int, ...], common: float
) -> Bundle:
    """Axis 2 changes its patterns, 3 its spectrum, 4 its course; 5 next to nothing."""
    n = n_baseline + n_target
    is_target = np.arange(n) >= n_baseline
    session = np.repeat(np.arange(n), CYCLES)
    cells, spectra, profiles = [], [], []
    for motion in range(2):
        start = 1000 * axis + 100 * motion
        present = np.array([not (motion and s in lacking) for s in range(n)])
        drift = spread(n, start=start)[:, np.newaxis] * spread(PATTERNS, start=start + 7)
        moved = is_target[:, np.newaxis] * spread(PATTERNS, start=start + 3)
        level = 5 + 0.3 * drift + moved * {2: 0.9, 5: 0.1}.get(axis, common)
        level = np.repeat(level, CYCLES, axis=0) + 0.1 * spread(n * CYCLES, PATTERNS, start=start)
        counts = np.round(np.exp(level)) * np.repeat(present, CYCLES)[:, np.newaxis]
        sums = np.add.reduceat(counts, np.arange(0, n * CYCLES, CYCLES))
        own = counts[: n_baseline * CYCLES]
        inflation = inflation_within_sessions(own, session[: n_baseline * CYCLES])
        cells.append(
            Cell(motion, 4, 3, sums[~is_target], sums[is_target], own,
                 counts[n_baseline * CYCLES :], inflation)
        )  # fmt: skip
        power = 0.3 * spread(n, start=start)[:, np.newaxis] * spread(BINS, start=start + 5)
        power += is_target[:, np.newaxis] * {3: 0.8, 5: 0.05}.get(axis, 0.0)
        cycles = np.repeat(power, CYCLES, axis=0) + 0.5 * spread(n * CYCLES, BINS, start=start)
        means = np.where(
            present[:, np.newaxis], cycles.reshape(n, CYCLES, BINS).mean(axis=1), np.nan
        )
        known = np.repeat(present, CYCLES)
        within = variance_within_sessions(cycles[known], session[known])
        spectra.append(
            SpectrumCell(motion, means, np.where(present, CYCLES, 0.0), within, 3, 4, 5.0)
        )
        course = np.sin(np.arange(BINS)) * (1 + 0.1 * spread(n, start=start)[:, np.newaxis])
        course = course + 0.05 * spread(n, BINS, start=start)
        course[is_target, 3:6] += {4: 0.4}.get(axis, 0.0)
        course = np.repeat(course, CYCLES, axis=0) + 0.05 * spread(n * CYCLES, BINS, start=start)
        profiles.append(profile_cell(motion, 2.0 * course[known], session[known], n))
    return Bundle(
        cells,
        {
            "spectrum": SpectrumEvidence(spectra, n_baseline),
            "profile": ProfileEvidence(profiles, n_baseline),
        },
    )


def judged(name: str) -> dict[int, Judgement]:
    """Return the judgements of a plan's axes 1 to 5."""
    n_baseline, n_target, lacking, common = PLANS[name]
    return judge({k: bundle(k, n_baseline, n_target, lacking, common) for k in range(1, 6)})
