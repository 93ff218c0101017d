"""A model of the current: terms, their regressors on both grids, and the joint fit."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.groups import Grouping
from opamc_cli.joint.kept import Kept
from opamc_cli.joint.normal import Normal, normal_equations, solve
from opamc_cli.joint.thinning import MOST_SAMPLES, cut, thinned, whole_groups
from opamc_cli.joint.track import Bools, Floats, Track, averaged, block_mean, coarsen

COARSE_RATE_HZ = 100.0
COARSE_SAMPLES = 20_000
COARSE_OF_LONG = 12_000
"""Likewise of a long recording, of which a sample stands for all: every round costs as many."""
MOST_ROUNDS = 12
SETTLED = 1e-4
"""Share of the error by which a fit of terms that follow the fitted load may still change."""
SMALLEST_KERNEL = 5
"""A moving average of up to 5 samples needs no counterpart."""


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

    def updated(self, columns: Floats, track: Track) -> Floats:
        """Regressors after the fitted model has changed, from those before."""
        if self.keep is not None:
            return self.columns(track)
        return self.effect.updated(columns, track, self.parameters)


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

    @property
    def rows(self) -> list[NDArray[np.int64]]:
        """Places of each open group's `fit` samples on the grid."""
        places = np.flatnonzero(self.fit)
        return [places[start:stop] for start, stop in self.slices]


@dataclass(frozen=True)
class Session:
    """Everything the loop works on: the fine and the coarse grid of the same recordings.

    Attributes
    ----------
    fine, coarse : Grid
        At the full rate and averaged; of a long recording, a sample of the open groups.
    opened : Session or None
        The same open samples with all sealed groups beside them, where `fine` has none.
    factor : int
        Fine samples per coarse one.
    grouping : Grouping
    fit_groups : tuple of int
        Groups that may be looked at before the end.
    kept : Kept
        What fits share.
    """

    fine: Grid
    coarse: Grid
    factor: int
    grouping: Grouping
    fit_groups: tuple[int, ...]
    opened: "Session | None" = None
    kept: Kept = field(default_factory=Kept, repr=False, compare=False)

    @cached_property
    def sharp(self) -> Grid:
        """The fine grid without the samples whose acceleration the smoothing has spoilt.

        All samples are fitted, since some effects live there; residuals are looked at on these.
        """
        track = self.fine.track
        if track.clear[self.fine.fit | self.fine.sealed].all():
            return self.fine
        track = replace(track, moving=track.moving & track.clear)
        return _grid(track, self.fit_groups, self.grouping.sealed)

    def columns(self, term: Term, fine: bool) -> Floats:
        """Regressors of a term on one of the grids; fast ones are averaged, not resampled."""
        fine = fine or self.coarse is self.fine
        follows = None if term.effect.is_constant(term.parameters) else self.fine.track
        return self.kept.columns(term, fine, follows, lambda old: self._columns(term, fine, old))

    def _columns(self, term: Term, fine: bool, old: Floats | None) -> Floats:
        track = self.fine.track
        if fine:
            return term.columns(track) if old is None else term.updated(old, track)
        if term.effect.fast:
            smooth = averaged(self.columns(term, fine=True), track.bounds, track.kernel)
            return block_mean(smooth, track.bounds, self.factor)
        return term.columns(self.coarse.track)

    def grid(self, fine: bool) -> Grid:
        """Return the grid on which fast effects are searched, or the coarse one."""
        return self.sharp if fine else self.coarse

    def with_model(self, load: Floats, model: Floats, static: tuple[Term, ...]) -> "Session":
        """Put the fitted load and model currents, given at the full rate, on both grids."""
        fine = replace(self.fine, track=self.fine.track.with_model(load, model, static))
        if self.coarse is self.fine:
            return replace(self, fine=fine, coarse=fine)
        coarse = replace(self.coarse, track=self.coarse.track.with_model(load, model, static))
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
    if track.kernel.size <= SMALLEST_KERNEL:
        track = replace(track, kernel=np.ones(1))
    groups = tuple(g for g in range(len(grouping.names)) if g not in grouping.sealed)
    if int(np.count_nonzero(track.moving & (track.group >= 0))) <= MOST_SAMPLES:
        return _session(track, grouping, groups)
    pieces = thinned(track, grouping, groups)
    sealed = whole_groups(track, grouping.sealed)
    grid = _grid(cut(track, sorted((*pieces, *sealed))), groups, grouping.sealed)
    opened = Session(grid, grid, 1, grouping, groups, kept=Kept(storing=False))
    session = _session(cut(track, pieces), grouping, groups, COARSE_OF_LONG)
    return replace(session, opened=opened)


def _session(
    track: Track, grouping: Grouping, groups: tuple[int, ...], coarse_samples: int = COARSE_SAMPLES
) -> Session:
    inside = int(np.count_nonzero(track.moving & (track.group >= 0)))
    by_rate = int(track.rate_hz // COARSE_RATE_HZ)
    factor = max(min(by_rate, inside // coarse_samples), 1)
    # With shorter blocks the whitening would amplify what the average has taken away.
    width = 1.0 / float(np.sum(track.kernel**2))
    factor = max(factor, int(0.8 * width), track.quiet)
    coarse_track = coarsen(track, factor)
    fine = _grid(track, groups, grouping.sealed)
    coarse = fine if coarse_track is track else _grid(coarse_track, groups, grouping.sealed)
    return Session(fine, coarse, factor, grouping, groups)


def _grid(track: Track, groups: tuple[int, ...], sealed: tuple[int, ...]) -> Grid:
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

    @cached_property
    def opened(self) -> "Fit":
        """The same fit with the sealed samples beside the open ones: itself, if they are there.

        Of a long recording the fine grid holds a sample of the open groups alone; the terms are
        fitted once more, to the same samples, where all sealed groups can be predicted.
        """
        session = self.session.opened
        if session is None:
            return self
        # This is the end: what the loop has kept would only take memory from here on.
        self.session.kept.clear()
        return fit_terms(session, self.terms)

    def rmse(self, sealed: bool) -> float:
        """Root mean square residual on the open or on the sealed samples."""
        fit = self.opened if sealed else self
        grid = fit.session.sharp
        values = fit.residual_a[grid.sealed if sealed else grid.fit]
        return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def fit_terms(session: Session, terms: tuple[Term, ...]) -> Fit:
    """Fit all terms jointly; where some scale with the load or the model, until that settles.

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
    circular = not all(term.effect.is_constant(term.parameters) for term in terms)
    plain = not np.any(session.fine.track.model_a)
    fewest = 3 if plain else 2
    session.kept.keep(terms)
    before = np.inf
    for number in range(1, MOST_ROUNDS + 1):
        fitted = _fit_once(session, terms)
        error = fitted.rmse(sealed=False)
        settled = number >= fewest and abs(before - error) <= SETTLED * error
        if not circular or settled:
            break
        session, before = fitted.session, error
    return fitted


def _fit_once(session: Session, terms: tuple[Term, ...]) -> Fit:
    grid = session.fine
    current = grid.track.current_a
    normal, widths = _products(session, terms)
    solution = solve(normal.gram.sum(axis=0), normal.moment.sum(axis=0))
    coefficients = tuple(np.split(solution, np.cumsum(widths)[:-1])) if terms else ()
    total = np.zeros(grid.track.size)
    model = np.zeros(grid.track.size)
    load = np.zeros(grid.track.size)
    static = []
    for term, values in zip(terms, coefficients, strict=True):
        block = session.columns(term, fine=True)
        part = block @ values
        total += part
        if term.effect.static and not term.effect.fast:
            model += part
            static.append(term)
        if term.effect.carries_load:
            load += part
    session = session.with_model(load, model, tuple(static))
    return Fit(terms, coefficients, session, current - total, normal)


def _products(session: Session, terms: tuple[Term, ...]) -> tuple[Normal, list[int]]:
    """Sum products of the current and all regressors on the open samples; count each term's."""
    grid = session.fine
    current = grid.track.current_a
    if session.kept.storing:
        columns = [session.columns(term, fine=True) for term in terms]
        widths = [block.shape[1] for block in columns]
        return session.kept.products(columns, current, grid.rows), widths
    blocks = [session.columns(term, fine=True)[grid.fit] for term in terms]
    widths = [block.shape[1] for block in blocks]
    design = np.empty((int(grid.fit.sum()), sum(widths)))
    for stop in np.cumsum(widths)[::-1]:
        block = blocks.pop()
        design[:, stop - block.shape[1] : stop] = block
    return normal_equations(design, current[grid.fit], grid.slices), widths
