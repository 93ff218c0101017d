"""What speaks for a change between sessions, and how far each lies from the others by it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.significance.spread import Spread
from opamc_cli.decision.witnesses.departure import Block, Distances, distances

FloatArray = NDArray[np.float64]
Kind = Literal["orthogonal", "score"]


class Evidence(Protocol):
    """One way of telling sessions apart; sessions are numbered, baseline first."""

    @property
    def kinds(self) -> Sequence[Kind]:
        """Which of its distances are asked: beyond what healthy sessions differ by, or along it."""

    @property
    def healthy_spread(self) -> Spread:
        """Expected spread of a healthy session's log distance beyond."""

    @property
    def weight(self) -> float:
        """How much each of its distances counts for among all witnesses'."""

    @property
    def tells_conditions(self) -> bool:
        """Whether its distance along says how unusual the conditions of a session were."""

    @property
    def depends_on_conditions(self) -> bool:
        """Whether unusual conditions move its distance beyond by more than its error allows for."""

    @property
    def cells(self) -> Sequence[object]:
        """What it rests on, one for each motion; nothing is known without any."""

    def blocks(self) -> Sequence[Block]:
        """Return the numbers that it knows of each session, motion by motion."""

    def effect(self) -> float:
        """Return the relative change beyond the baseline's own; NaN if unknown."""


class WitnessEvidence(Evidence, Protocol):
    """That of a witness beside the patterns."""

    def change(self) -> float:
        """Return the relative change beyond the noise of cycles; NaN if it tells no such."""

    def of_sessions(self, baseline: Sequence[int], target: Sequence[int]) -> "WitnessEvidence":
        """Return the same with some of its sessions as the baseline and some as the target."""


@dataclass(frozen=True)
class SessionDistances:
    """Log distances of one axis's sessions, of one kind."""

    own: FloatArray
    """Of baseline session i from the other baseline sessions; shape (B,)."""
    target: FloatArray
    """Of each target session from the baseline without session i: the two numbers of a pair differ
    in nothing but the session, same rest, same finite-sample bias; shape (B, T)."""
    each: FloatArray
    """Of every session from all others, the first target session last: all on the same footing, so
    that the target's rank among them is that of any healthy session; shape (B + 1,)."""

    @property
    def known(self) -> bool:
        """Whether no session lacks its distance, nor differs from three or more that are the same.

        As those of few patterns may be: whether a difference is much is then not known.
        """
        agree = len(self.own) > 2 and np.ptp(self.own) == 0
        if agree and (self.target != self.own[:, np.newaxis]).any():
            return False
        return all(np.isfinite(part).all() for part in (self.own, self.target, self.each))

    def log_ratio(self, kind: Kind) -> float:
        """Log of the target's distance over a baseline session's.

        Of distances beyond the geometric means are compared, of those along, which are squares of
        the same few influences, the arithmetic ones.
        """
        if kind == "orthogonal":
            return float(np.mean(self.target) - np.mean(self.own))
        largest = max(float(self.target.max()), float(self.own.max()))
        target, own = (np.exp(part - largest).mean() for part in (self.target, self.own))
        return float(np.log(target) - np.log(own))


def session_distances(
    evidence: Evidence, n_baseline: int, n_target: int
) -> dict[Kind, SessionDistances]:
    """Hold each session against the rest.

    Parameters
    ----------
    evidence : Evidence
        Of one axis.
    n_baseline, n_target : int
        Numbers of its sessions; at least two of the baseline.

    Returns
    -------
    dict of str to SessionDistances
        Of both kinds.

    Notes
    -----
    `own` and `target` are the pairs of the jackknife+ of R. F. Barber et al., Ann. Statist. 49
    (2021); `each` is full conformal prediction (V. Vovk et al., Algorithmic Learning in a Random
    World, 2005).
    """
    n = n_baseline + n_target
    sessions = np.eye(n, dtype=bool)
    in_baseline = np.arange(n) < n_baseline
    units, rests = [], []
    for i in range(n_baseline):
        # each baseline session, and every target session beside it, against the same rest
        units += [sessions[i], *sessions[n_baseline:]]
        rests += [in_baseline & ~sessions[i]] * (1 + n_target)
    everyone = in_baseline | sessions[n_baseline]
    for i in range(n_baseline + 1):
        units.append(sessions[i])
        rests.append(everyone & ~sessions[i])
    found = distances(evidence.blocks(), np.array(units), np.array(rests))
    by_kind: dict[Kind, SessionDistances] = {}
    for kind in ("orthogonal", "score"):
        values = getattr(found, kind)
        pairs = values[: -(n_baseline + 1)].reshape(n_baseline, 1 + n_target)
        by_kind[kind] = SessionDistances(pairs[:, 0], pairs[:, 1:], values[-(n_baseline + 1) :])
    return by_kind


def labelled_distances(evidence: Evidence, is_target: NDArray[np.bool_]) -> Distances:
    """Return the log distances between two groups of sessions under every labelling, (L, S).

    They are in units of the scatter of all sessions, which no labelling changes.
    """
    everyone = np.ones((1, is_target.shape[1]), dtype=bool)
    return distances(evidence.blocks(), is_target, ~is_target, everyone)


def soft_maximum(values: FloatArray, weights: Sequence[float]) -> FloatArray:
    """Log of the weighted mean of exponentials.

    Parameters
    ----------
    values : ndarray, shape (V, ...)
        Standardised, one row for each voice.
    weights : sequence of float, shape (V,)
        Positive.

    Returns
    -------
    ndarray, shape (...)
        Between the mean and the largest value: what one witness sees is not outvoted by those that
        do not see it, and what several see counts for more.
    """
    largest = values.max(axis=0)
    mean = np.average(np.exp(values - largest), axis=0, weights=weights)
    return np.asarray(largest + np.log(mean))
