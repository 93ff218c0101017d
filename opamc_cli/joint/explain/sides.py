"""On which side of the torque axis strokes lie, asked again of a model that has names."""

import numpy as np

from opamc_cli.joint.fit.frozen import apply_frozen
from opamc_cli.joint.fit.model import Fit
from opamc_cli.joint.motion.track import Bools, Floats, Ints, Track
from opamc_cli.signal.transform.least_squares import inverse

MUCH = 0.9
"""Of the squared error: what is turned has to leave less, or nothing is: by any less a row leaves
0.146 instead of 0.109 A (656000)."""
ALIKE_S = 0.05
"""Within which the same stroke of two cycles begins; if each is turned alone, one row of 17 leaves
0.147 instead of 0.096 A."""


def turned_by(fit: Fit, track: Track) -> Floats | None:
    """Tell which strokes of a whole track a model would turn, fitted to some of it; -1 or 1, (n,).

    What else a joint has than friction, inertia and a smooth function of the place may have put
    a stroke on the other side, in every cycle alike. None where turning explains no more.
    """
    grid = fit.dataset.fine
    rows = np.flatnonzero(grid.fit)
    blocks = [grid.spread(fit.dataset.columns(term, fine=True))[rows] for term in fit.terms]
    columns, current = np.concatenate(blocks, axis=1), grid.track.current_a[rows]
    _, firsts = np.unique(_strokes(grid.track.moving)[rows], return_index=True)
    moments = np.add.reduceat(columns * current[:, None], firsts)
    solving, power = inverse(columns.T @ columns), float(current @ current)
    groups = _alike(grid.track.run_time_s[rows[firsts]], grid.track.period_s)
    signs, whole = np.ones(firsts.size), moments.sum(axis=0)
    first = least = power - float(whole @ solving @ whole)
    for _ in groups:  # each way once at most
        turned = np.where(groups, -signs, signs)
        left = power - np.sum(turned @ moments @ solving * (turned @ moments), axis=1)
        best = int(np.argmin(left))
        if left[best] >= least:
            break
        signs, least = turned[best], float(left[best])
    if least > MUCH * first:
        return None
    widths = [block.shape[1] for block in blocks]
    values = np.split(solving @ (signs @ moments), np.cumsum(widths)[:-1])
    applied = apply_frozen(track, fit.terms, values)
    every = _strokes(track.moving)
    works = np.bincount(every, applied.current_a * (applied.current_a - applied.residual_a))
    return np.where(track.moving & (works[every] < 0), -1.0, 1.0)


def _strokes(moving: Bools) -> Ints:
    """Count the strokes up to each sample, (n,): where a joint rests its current may slip."""
    return np.cumsum(np.diff(moving, prepend=False) & moving)


def _alike(begins_s: Floats, period_s: float) -> Bools:
    """Each of s strokes by itself, and with those as long after a cycle's beginning; (g, s)."""
    apart = begins_s[:, None] - begins_s
    if np.isfinite(period_s):
        apart = apart - period_s * np.round(apart / period_s)
    return np.unique(np.concatenate([np.eye(begins_s.size) > 0, np.abs(apart) < ALIKE_S]), axis=0)
