"""Made-up pattern counts of a robot's joints, with sessions that differ and joints that fail."""

from dataclasses import dataclass

import numpy as np

from opamc_cli.stats.sessions import Cell, inflation_within_sessions


@dataclass(frozen=True)
class Fleet:
    """What to make up; all spreads are standard deviations of log pattern probabilities."""

    n_baseline: int = 6
    n_target: int = 1
    n_axes: int = 6
    n_motions: int = 3
    n_cycles: int = 4
    n_patterns: int = 24
    between_sessions: float = 0.1
    influences: int = 3
    between_cycles: float = 0.03
    common: float = 0.0
    """Shift of every axis in the target's sessions."""
    severity: float = 0.0
    faulty: int = 3
    independent: int = 300
    overlap: int = 8


def cells(plan: Fleet, seed: int) -> dict[int, list[Cell]]:
    """Draw pattern counts: probabilities that drift by session and cycle, patterns that overlap."""
    rng = np.random.default_rng(seed)
    n_sessions = plan.n_baseline + plan.n_target
    is_target = np.arange(n_sessions) >= plan.n_baseline
    result: dict[int, list[Cell]] = {}
    for axis in range(1, plan.n_axes + 1):
        drift = rng.normal(size=(n_sessions, plan.influences))
        result[axis] = []
        for motion in range(plan.n_motions):
            base = rng.normal(size=plan.n_patterns)
            loads = rng.normal(size=(plan.influences, plan.n_patterns))
            logits = base + drift @ loads * plan.between_sessions / np.sqrt(plan.influences)
            logits[is_target] += plan.common * rng.normal(size=plan.n_patterns)
            if axis == plan.faulty:
                logits[is_target] += plan.severity * rng.normal(size=plan.n_patterns)
            shape = (n_sessions, plan.n_cycles, plan.n_patterns)
            by_cycle = logits[:, np.newaxis] + plan.between_cycles * rng.normal(size=shape)
            pmf = np.exp(by_cycle)
            pmf /= pmf.sum(axis=-1, keepdims=True)
            counts = plan.overlap * rng.multinomial(plan.independent, pmf).astype(np.float64)
            cycles = counts[~is_target].reshape(-1, plan.n_patterns)
            session = np.repeat(np.arange(plan.n_baseline), plan.n_cycles)
            result[axis].append(
                Cell(
                    motion=motion,
                    order=4,
                    tau=3,
                    baseline=counts[~is_target].sum(axis=1),
                    target=counts[is_target].sum(axis=1),
                    cycles=cycles,
                    target_cycles=counts[is_target].reshape(-1, plan.n_patterns),
                    inflation=inflation_within_sessions(cycles, session),
                )
            )
    return result
