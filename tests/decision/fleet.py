"""Made-up pattern counts of a robot's joints, with sessions that differ and joints that fail."""

from dataclasses import dataclass

import numpy as np

from opamc_cli.decision import judge as decision
from opamc_cli.decision.judge import Bundle, Judgement, Policy
from opamc_cli.decision.witnesses.deviation import variance_within_sessions
from opamc_cli.decision.witnesses.patterns import Cell, inflation_within_sessions
from opamc_cli.decision.witnesses.spectra import SpectrumCell, SpectrumEvidence


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
    louder: float = 0.0
    """Relative change of the fluctuations' size on the faulty axis in the target's sessions."""


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


def spectra(
    plan: Fleet, seed: int, n_target_cycles: int | None = None
) -> dict[int, list[SpectrumCell]]:
    """Draw log powers of the same fleet: periodograms of noise whose level drifts by session."""
    rng = np.random.default_rng([seed, 1])
    n_sessions = plan.n_baseline + plan.n_target
    is_target = np.arange(n_sessions) >= plan.n_baseline
    n_cycles = np.where(is_target, n_target_cycles or plan.n_cycles, plan.n_cycles)
    result: dict[int, list[SpectrumCell]] = {}
    for axis in range(1, plan.n_axes + 1):
        drift = rng.normal(size=(n_sessions, plan.influences))
        result[axis] = []
        for motion in range(plan.n_motions):
            loads = rng.normal(size=(plan.influences, 64))
            level = drift @ loads * plan.between_sessions / np.sqrt(plan.influences)
            level[is_target] += plan.common * rng.normal(size=64)
            if axis == plan.faulty:
                level[is_target] += plan.severity * rng.normal(size=64) + 2 * plan.louder
            labels = np.repeat(np.arange(n_sessions), n_cycles)
            cycles = level[labels] + np.log(rng.exponential(size=(len(labels), 64)))
            means = np.array([cycles[labels == s].mean(axis=0) for s in range(n_sessions)])
            result[axis].append(
                SpectrumCell(
                    motion=motion,
                    sessions=means,
                    cycles=n_cycles.astype(np.float64),
                    within=variance_within_sessions(cycles, labels),
                    frames=8,
                    bins=8,
                    bin_hz=5.0,
                )
            )
    return result


def judge(
    cells_by_axis: dict[int, list[Cell]],
    policy: Policy | None = None,
    spectra_by_axis: dict[int, list[SpectrumCell]] | None = None,
) -> dict[int, Judgement]:
    """Judge by patterns, and by spectra if there are any."""
    return decision.judge(
        {
            axis: Bundle(
                own,
                {"spectrum": SpectrumEvidence(spectra_by_axis[axis], len(own[0].baseline))}
                if spectra_by_axis
                else {},
            )
            for axis, own in cells_by_axis.items()
        },
        policy or Policy(),
    )
