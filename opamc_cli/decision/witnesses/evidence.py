"""What speaks for a change between sessions, and how several such things are weighed together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.significance.median_deviation import MAD_TO_SIGMA

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEAST_RATIO = 1e-6
"""Identical recordings have distance zero; a millionth of a healthy one stands for it."""

LEAST_SCALE = 0.01
"""Distances that agree to a percent agree: none weighs infinitely."""


class Evidence(Protocol):
    """One way of telling sessions apart; sessions are numbered, baseline first."""

    @property
    def ranks(self) -> bool:
        """Whether sessions are ranked by it; if not, it counts where it is sure by itself."""

    @property
    def cells(self) -> Sequence[object]:
        """What it rests on, one for each motion; nothing is known without any."""

    def log_distances(self, units: IntArray, rest: IntArray) -> FloatArray:
        """Return the log distance of each of some sessions from the others."""

    def pooled(self, is_target: NDArray[np.bool_]) -> FloatArray:
        """Return the distance between two groups of sessions, one for each labelling."""

    def effect(self) -> float:
        """Return the relative change beyond the baseline's own; NaN if unknown."""


@dataclass(frozen=True)
class SessionDistances:
    """Log distances of one axis's sessions."""

    own: FloatArray
    """Of baseline session i from the other baseline sessions; shape (B,)."""
    target: FloatArray
    """Of each target session from the baseline without session i: the two numbers of a pair differ
    in nothing but the session, same pool, same level, same finite-sample bias; shape (B, T)."""
    each: FloatArray
    """Of every session from all others, the first target session last: all on the same footing, so
    that the target's rank among them is that of any healthy session; shape (B + 1,)."""

    @property
    def known(self) -> bool:
        """Whether no session lacks its distance."""
        return all(np.isfinite(part).all() for part in (self.own, self.target, self.each))


def session_distances(evidence: Evidence, n_baseline: int, n_target: int) -> SessionDistances:
    """Hold each session against the rest.

    Parameters
    ----------
    evidence : Evidence
        Of one axis.
    n_baseline, n_target : int
        Numbers of its sessions; at least two of the baseline.

    Returns
    -------
    SessionDistances

    Notes
    -----
    `own` and `target` are the pairs of the jackknife+ of R. F. Barber et al., Ann. Statist. 49
    (2021); `each` is full conformal prediction (V. Vovk et al., Algorithmic Learning in a Random
    World, 2005).
    """
    baseline = np.arange(n_baseline)
    targets = np.arange(n_baseline, n_baseline + n_target)
    pairs = np.array(
        [
            evidence.log_distances(np.concatenate([[i], targets]), np.delete(baseline, i))
            for i in baseline
        ]
    )
    everyone = np.arange(n_baseline + 1)
    each = [evidence.log_distances(everyone[[i]], np.delete(everyone, i))[0] for i in everyone]
    return SessionDistances(pairs[:, 0], pairs[:, 1:], np.array(each))


def weigh_together(
    by_axis: Mapping[int, Mapping[str, SessionDistances]],
) -> dict[int, SessionDistances]:
    """Combine the distances by several witnesses into one for each axis.

    Parameters
    ----------
    by_axis : mapping of int to mapping of str to SessionDistances
        By axis and witness; the first witness of an axis stands in where none is complete.

    Returns
    -------
    dict of int to SessionDistances
        Soft maximum of the log distances, each from its own middle and in units of its own scatter
        between sessions: in the middle over all axes for the scatter, of the axis for the middle.
        A witness that lacks a session is left out.

    Notes
    -----
    A fault that one witness sees must not be outvoted by those that do not see it, as in a mean:
    there each further witness costs all others. Middle and scatter are those of all sessions, the
    target among them, by median and median absolute deviation: taken from the baseline alone they
    would favour the witness by which the target is odd, and the target would rank first too often.
    """
    scatter: dict[str, list[float]] = {}
    for kinds in by_axis.values():
        for name, one in kinds.items():
            if one.known:
                scatter.setdefault(name, []).append(_robust_scale(one.each))
    scale = {name: max(float(np.median(s)), LEAST_SCALE) for name, s in scatter.items()}
    combined = {}
    for axis, kinds in by_axis.items():
        used = {name: one for name, one in kinds.items() if one.known}
        if len(used) < 2:
            combined[axis] = next(iter((used or kinds).values()))
            continue
        scales = np.array([scale[name] for name in used])
        middles = np.array([np.median(one.each) for one in used.values()])
        combined[axis] = SessionDistances(
            *(
                soft_maximum([getattr(one, part) for one in used.values()], middles, scales)
                for part in ("own", "target", "each")
            )
        )
    return combined


def pooled_together(logs: Sequence[FloatArray]) -> FloatArray:
    """Distance between two groups of sessions by several witnesses.

    Parameters
    ----------
    logs : sequence of ndarray, shape (R,)
        Log of each witness's `Evidence.pooled`, one value per labelling.

    Returns
    -------
    ndarray, shape (R,)
        Soft maximum, as in `weigh_together`, over middle and scatter of all labellings.
    """
    known = [log for log in logs if np.isfinite(log).all()] or logs[:1]
    if len(known) < 2:
        return np.asarray(np.exp(known[0]))
    scales = np.array([max(_robust_scale(log), LEAST_SCALE) for log in known])
    middles = np.array([np.median(log) for log in known])
    return np.asarray(np.exp(soft_maximum(known, middles, scales)))


def soft_maximum(
    values: Sequence[FloatArray], middles: FloatArray, scales: FloatArray
) -> FloatArray:
    """Log of the mean of the exponentials of standardised values, in the scales' harmonic mean.

    Parameters
    ----------
    values : sequence of ndarray, each of one shape
        By each witness.
    middles, scales : ndarray, shape (number of witnesses,)
        Of each.

    Returns
    -------
    ndarray
        Of the values' shape; 0 if all are at their middle.
    """
    z = np.array([(v - m) / s for v, m, s in zip(values, middles, scales, strict=True)])
    largest = z.max(axis=0)
    mean = np.exp(z - largest).mean(axis=0)
    return np.asarray((largest + np.log(mean)) / np.mean(1 / scales))


def _robust_scale(values: FloatArray) -> float:
    return MAD_TO_SIGMA * float(np.median(np.abs(values - np.median(values))))


def log_mean(ratios: FloatArray) -> FloatArray:
    """Log of the mean of the known values along the last axis; NaN without any."""
    known = np.isfinite(ratios)
    total = np.where(known, ratios, 0.0).sum(axis=-1)
    n = known.sum(axis=-1)
    mean = np.divide(total, n, out=np.full(total.shape, np.nan), where=n > 0)
    return np.asarray(np.log(np.maximum(mean, LEAST_RATIO)))
