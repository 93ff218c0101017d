"""A model of the current: terms, their regressors on both grids, and the joint fit."""

from dataclasses import dataclass, replace

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.groups import Grouping
from opamc_cli.joint.normal import Normal, normal_equations, solve
from opamc_cli.joint.track import Bools, Floats, Track, averaged, block_mean, coarsen

COARSE_RATE_HZ = 100.0
COARSE_SAMPLES = 20_000
SMALLEST_KERNEL = 5
"""A moving average of up to 5 samples needs no counterpart."""

FINE_SAMPLES = 250_000
"""Above this many moving samples at the full rate, evenly spread whole groups stand for all."""


@dataclass(frozen=True)
class Term:
    """An effect with its non-linear parameters; `keep` names the columns of a smaller form."""

    effect: Effect
    parameters: Parameters
    keep: tuple[int, ...] | None = None

    def columns(self, track: Track) -> Floats:
        """Regressors on the track's grid, shape (n, m)."""
        columns = self.effect.columns(track, self.parameters)
        return columns if self.keep is None else columns[:, self.keep]


@dataclass(frozen=True)
class Grid:
    """A track with the samples that the fit may look at, group after group.

    Attributes
    ----------
    track : Track
        At this grid's rate.
    fit, sealed : bool arrays of shape (n,)
        Moving samples of the groups that are open, and of those that are sealed.
    slices : tuple of (int, int)
        Half-open ranges of the open groups among the `fit` samples.
    """

    track: Track
    fit: Bools
    sealed: Bools
    slices: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Session:
    """Everything the loop works on: the fine and the coarse grid of the same recordings."""

    fine: Grid
    coarse: Grid
    factor: int
    grouping: Grouping
    fit_groups: tuple[int, ...]

    def columns(self, term: Term, fine: bool) -> Floats:
        """Regressors of a term on one of the grids; fast ones are averaged, not resampled."""
        track = self.fine.track
        if fine or self.coarse is self.fine:
            return term.columns(track)
        if term.effect.fast:
            smooth = averaged(term.columns(track), track.bounds, track.kernel)
            return block_mean(smooth, track.bounds, self.factor)
        return term.columns(self.coarse.track)

    def grid(self, fine: bool) -> Grid:
        """Return the fine or the coarse grid."""
        return self.fine if fine else self.coarse

    def with_model(self, load: Floats, model: Floats, static: Floats) -> "Session":
        """Put the fitted load and model currents, given at the full rate, on both grids."""
        bounds = self.fine.track.bounds
        fine = replace(self.fine, track=self.fine.track.with_model(load, model, static))
        if self.coarse is self.fine:
            return replace(self, fine=fine, coarse=fine)
        coarse = replace(
            self.coarse,
            track=self.coarse.track.with_model(
                block_mean(load, bounds, self.factor),
                block_mean(model, bounds, self.factor),
                block_mean(static, bounds, self.factor),
            ),
        )
        return replace(self, fine=fine, coarse=coarse)


def open_session(track: Track, grouping: Grouping) -> Session:
    """Arrange a track for the loop.

    Parameters
    ----------
    track : Track
        At the full rate.
    grouping : Grouping
        Groups, and which are sealed.

    Returns
    -------
    Session
    """
    track = replace(track, group=grouping.group)
    inside = int(np.count_nonzero(track.moving & (grouping.group >= 0)))
    by_rate = int(track.rate_hz // COARSE_RATE_HZ)
    factor = max(min(by_rate, inside // COARSE_SAMPLES), 1)
    if track.kernel.size <= SMALLEST_KERNEL:
        track = replace(track, kernel=np.ones(1))
    # With shorter blocks the whitening would amplify what the average has taken away.
    width = 1.0 / float(np.sum(track.kernel**2))
    factor = max(factor, int(0.8 * width), track.quiet)
    coarse_track = coarsen(track, factor)
    groups = [g for g in range(len(grouping.names)) if g not in grouping.sealed]
    share = FINE_SAMPLES / max(inside, 1)
    fine = _grid(track, _thinned(groups, share), _thinned(list(grouping.sealed), share))
    coarse = fine if coarse_track is track else _grid(coarse_track, groups, list(grouping.sealed))
    return Session(fine, coarse, factor, grouping, tuple(groups))


def _thinned(groups: list[int], share: float) -> list[int]:
    if share >= 1:
        return groups
    count = min(max(int(len(groups) * share), 4), len(groups))
    picks = np.unique(np.linspace(0, len(groups) - 1, count).round().astype(int))
    return [groups[i] for i in picks]


def _grid(track: Track, groups: list[int], sealed: list[int]) -> Grid:
    member = track.moving & (track.group >= 0)
    fit = member & np.isin(track.group, groups)
    counts = np.bincount(track.group[fit], minlength=max([*groups, 0]) + 1)
    stops = np.cumsum([counts[g] for g in groups])
    starts = np.concatenate([[0], stops[:-1]])
    slices = tuple((int(a), int(b)) for a, b in zip(starts, stops, strict=True) if b > a)
    track = replace(track, open_samples=fit)
    return Grid(track, fit, member & np.isin(track.group, sealed), slices)


@dataclass(frozen=True)
class Fit:
    """Joint least squares of all terms on the fine grid's open samples.

    Attributes
    ----------
    terms : tuple of Term
        What was fitted.
    coefficients : tuple of arrays
        One array per term.
    session : Session
        With the fitted load and model currents.
    residual_a : array of shape (n,)
        Current less model on the whole fine grid (it means something where samples move).
    normal : Normal
        Sums per open group.
    """

    terms: tuple[Term, ...]
    coefficients: tuple[Floats, ...]
    session: Session
    residual_a: Floats
    normal: Normal

    def rmse(self, sealed: bool) -> float:
        """Root mean square residual on the open or on the sealed samples."""
        grid = self.session.fine
        values = self.residual_a[grid.sealed if sealed else grid.fit]
        return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def fit_terms(session: Session, terms: tuple[Term, ...]) -> Fit:
    """Fit all terms jointly; terms that scale with the load or the model are fitted twice.

    Parameters
    ----------
    session : Session
        Recordings.
    terms : tuple of Term
        Model.

    Returns
    -------
    Fit
    """
    circular = any(
        term.effect.name
        in ("load_friction", "time_delay", "sensor_gain", "dead_time", "ripple", "payload_change")
        or not term.effect.static
        for term in terms
    )
    plain = not np.any(session.fine.track.model_a)
    rounds = 3 if circular and plain else 2 if circular else 1
    for _ in range(rounds):
        fitted = _fit_once(session, terms)
        session = fitted.session
    return fitted


def _fit_once(session: Session, terms: tuple[Term, ...]) -> Fit:
    grid = session.fine
    current = grid.track.current_a
    blocks = [term.columns(grid.track)[grid.fit] for term in terms]
    widths = [block.shape[1] for block in blocks]
    design = np.concatenate(blocks, axis=1) if blocks else np.zeros((int(grid.fit.sum()), 0))
    normal = normal_equations(design, current[grid.fit], grid.slices)
    del design, blocks
    solution = solve(normal.gram.sum(axis=0), normal.moment.sum(axis=0))
    coefficients = tuple(np.split(solution, np.cumsum(widths)[:-1])) if terms else ()
    total = np.zeros(grid.track.size)
    model = np.zeros(grid.track.size)
    load = np.zeros(grid.track.size)
    static = [np.zeros((grid.track.size, 0))]
    for term, values in zip(terms, coefficients, strict=True):
        columns = term.columns(grid.track)
        part = columns @ values
        total += part
        if term.effect.static and not term.effect.fast:
            model += part
            static.append(columns)
        if term.effect.carries_load:
            load += part
    session = session.with_model(load, model, np.concatenate(static, axis=1))
    return Fit(terms, coefficients, session, current - total, normal)
