"""A model of the current: terms, their regressors on both grids, and the joint fit."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from opamc_cli.errors import ConfigError
from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.fit.parts import Parts, Sums, parts_of, whole_parts
from opamc_cli.joint.fit.regressor_cache import RegressorCache
from opamc_cli.joint.fit.thinning import MOST_SAMPLES, cut, thinned
from opamc_cli.joint.motion.groups import Grouping
from opamc_cli.joint.motion.kinematics import Smoothing
from opamc_cli.joint.motion.track import Bools, Floats, Ints, Track, coarsen
from opamc_cli.signal.motion.smoothing import averaged, block_mean, widened
from opamc_cli.signal.transform.least_squares import solve

COARSE_RATE_HZ = 100.0
COARSE_SAMPLES = 8_000
"""Slow effects are searched on averages at 100 Hz, or finer, until there are so many moving ones:
every round costs as many. Twice as many take a tenth more time and name the same."""
MOST_ROUNDS = 12
SETTLED = 1e-4
"""Share of the error by which a fit of terms that follow the fitted load may still change."""
NEARLY = 0.01
"""Likewise where Newton steps find the load: by less they were near, and moved nothing again."""
LOAD_SAMPLES = 10_000
"""Samples by which a load is found that friction follows; all are fitted beside it."""


@dataclass(frozen=True)
class Term:
    """An effect with its non-linear parameters; `keep` names the columns of a smaller form."""

    effect: Effect
    parameters: Parameters
    keep: tuple[int, ...] | None = None

    def columns(self, track: Track, rows: Ints | None = None) -> Floats:
        """Regressors at all samples, or some; (n, m). ConfigError if it lacks one that it keeps."""
        effect, given = self.effect, self.parameters
        found = (
            effect.columns(track, given) if rows is None else effect.columns_at(track, given, rows)
        )
        if self.keep is None:
            return found
        count = found.shape[1]
        if max(self.keep, default=0) >= count:
            msg = f"effect {effect.name!r} has no column {max(self.keep)}; its {count} count from 0"
            raise ConfigError(msg)
        return found[:, self.keep]

    @cached_property
    def key(self) -> tuple[object, ...]:
        """What makes two terms the same."""
        return (self.effect.name, tuple(sorted(self.parameters.items())), self.keep)

    @property
    def form(self) -> str:
        """Which of its effect's forms it is."""
        return self.effect.form_of(self.parameters)

    @property
    def is_constant(self) -> bool:
        """Whether the regressors stay the same whatever the fitted model is."""
        return self.effect.is_constant(self.parameters)


@dataclass(frozen=True)
class Grid:
    """A track with the samples that the fit may look at, group after group."""

    track: Track
    """At this grid's rate."""
    fit: Bools
    sealed: Bools
    """With `fit`: moving samples of groups that are open, and of sealed ones; bool, shape (n,)."""
    parts: Parts
    """The `fit` samples in parts."""
    near: Ints
    """Where anybody asks for fast terms: places of the parts' rows, of sealed ones, and of what a
    moving average takes into a coarse one, in this order; or of all samples; int array."""

    def spread(self, part: Floats) -> Floats:
        """Put what a term has at all samples, or at those `near`, on the grid; (n,) or (n, k)."""
        if len(part) == self.track.size:
            return part
        whole = np.zeros((self.track.size, *part.shape[1:]))
        whole[self.near] = part
        return whole


@dataclass(frozen=True)
class Dataset:
    """Everything the loop works on: the fine and the coarse grid of the same recordings."""

    fine: Grid
    coarse: Grid
    """With `fine`: full rate and averaged; of a long recording, a sample of the open groups."""
    factor: int
    """Fine samples per coarse one."""
    grouping: Grouping
    """What is left out as one, and what is sealed."""
    smoothing: Smoothing | None = None
    """How the motion was differentiated; None: as the noise of each path asks for."""
    opened: "Dataset | None" = None
    """The same open samples with some of every sealed group beside them, where `fine` has none."""
    held: bool = True
    """Whether effects of many regressors are fitted with their ridge."""
    cache: RegressorCache = field(default_factory=RegressorCache, repr=False, compare=False)
    """Regressors and products that fits share."""

    @cached_property
    def sharp(self) -> Grid:
        """The fine grid without the samples whose acceleration the smoothing has spoilt.

        All samples are fitted, since some effects live there; residuals are looked at on these, if
        there are any among the open ones and among the sealed ones.
        """
        grid, clear = self.fine, self.fine.track.clear
        kept = [clear[some] for some in (grid.fit, grid.sealed) if some.any()]
        if all(some.all() for some in kept) or not all(some.any() for some in kept):
            return grid
        fit, track = grid.fit & clear, grid.track
        track = replace(track, moving=track.moving & clear, open_samples=fit)
        return replace(grid, track=track, fit=fit, sealed=grid.sealed & clear)

    @property
    def parts(self) -> tuple[Parts, Parts]:
        """Open samples of the fine and of the coarse grid, in parts."""
        return self.fine.parts, self.coarse.parts

    def columns(self, term: Term, fine: bool) -> Floats:
        """Regressors of a term on one of the grids; of fast ones, at the full rate, those `near`.

        Of the hundred columns of a drive's answer that is a third: they stay in the cache.
        """
        grid = self.grid_of(fine)
        track = grid.track
        fine = track is self.fine.track
        rows = grid.near if term.effect.fast and fine else None
        beside = track.static_terms if term.effect.from_terms else ()
        if not all(one.is_constant for one in (beside or (term,))):
            return term.columns(track, rows)
        key = term.key, fine, *(one.key for one in beside)
        return self.cache.columns(key, lambda: term.columns(track, rows))

    def sums(
        self, terms: Sequence[Term], fine: bool, *beside: Floats, blocks: Sequence[Floats] = ()
    ) -> Sums:
        """Products of terms' regressors, and others beside, with one another and the current.

        Over each part; on the whole grid the others, (n, k), and the terms' if they are at hand.
        """
        fine = fine or self.coarse is self.fine
        grid = self.grid_of(fine)
        blocks = blocks or [self.columns(term, fine) for term in terms]
        sums = self.cache.sums([*blocks, *beside], grid.track.current_a, grid.parts, fine)
        ridges = [self.held * term.effect.ridge(term.parameters) for term in terms]
        ridge = np.repeat(ridges, [block.shape[1] for block in blocks])
        sums.ridge[: ridge.size] = ridge
        return sums

    def grid_of(self, fine: bool) -> Grid:
        """Return the fine or the coarse grid."""
        return self.fine if fine else self.coarse

    def with_model(self, load: Floats, model: Floats, static: tuple[Term, ...]) -> "Dataset":
        """Put the fitted load and model currents, given at the full rate, on both grids."""
        given = load, model, static, self.cache.laid
        fine = replace(self.fine, track=self.fine.track.with_model(*given))
        if self.coarse is self.fine:
            return replace(self, fine=fine, coarse=fine)
        coarse = replace(self.coarse, track=self.coarse.track.with_model(*given))
        return replace(self, fine=fine, coarse=coarse)


def dataset_of(
    track: Track, grouping: Grouping, most: int = MOST_SAMPLES, ends: bool = True
) -> Dataset:
    """Arrange a track for the loop; of more than so many moving samples by some of them.

    Of sealed ones as well if this `ends` in opening them.
    """
    track = replace(track, group=grouping.group)
    if int(np.count_nonzero(track.moving & (track.group >= 0))) <= most:
        return _dataset(track, grouping)
    pieces = thinned(track, grouping, grouping.open, most)
    if not ends:
        return _dataset(cut(track, pieces), grouping)
    both = cut(track, sorted((*pieces, *thinned(track, grouping, grouping.sealed, most))))
    return replace(_dataset(cut(track, pieces), grouping), opened=_dataset(both, grouping))


def _dataset(track: Track, grouping: Grouping) -> Dataset:
    inside = int(np.count_nonzero(track.moving & (track.group >= 0)))
    factor = max(min(int(track.rate_hz // COARSE_RATE_HZ), inside // COARSE_SAMPLES), 1)
    coarse_track = coarsen(track, factor)
    fine = coarse = grid_of(track, grouping.sealed)
    if coarse_track is not track:
        # The moving average must not carry sealed samples into open ones.
        sealed = widened(np.isin(track.group, grouping.sealed), track.kernel.size // 2)
        touched = block_mean(sealed.astype(float), track.bounds, factor) > 0
        locked = np.isin(coarse_track.group, grouping.sealed)
        moving = coarse_track.moving & (locked | ~touched)
        # Of a second of motion a long moving average may leave nothing.
        if np.any(moving & ~locked & (coarse_track.group >= 0)):
            coarse = grid_of(replace(coarse_track, moving=moving), grouping.sealed)
    return Dataset(fine, coarse, factor, grouping)


def grid_of(track: Track, sealed: tuple[int, ...] = (), whole: bool = False) -> Grid:
    """Tell the samples of a track's groups, but for the sealed ones, in parts.

    A group is one part where it is to stay `whole`.
    """
    member = track.moving & (track.group >= 0)
    locked = np.isin(track.group, sealed)
    fit = member & ~locked
    places = np.flatnonzero(fit)
    groups = np.split(places, np.flatnonzero(np.diff(track.group[places])) + 1)
    parts = whole_parts(groups, track.size) if whole else parts_of(groups, track.clear)
    beside = widened(member, track.kernel.size // 2) & ~fit
    near = np.concatenate([parts.rows, np.flatnonzero(beside)])
    near = near if near.size < track.size else np.arange(track.size)
    return Grid(replace(track, open_samples=fit), fit, member & locked, parts, near)


@dataclass(frozen=True)
class Judged:
    """What a fit leaves of every moving sample, each counted once; (n,) on the fine grid."""

    residual_a: Floats
    current_a: Floats
    open: Bools
    sealed: Bools
    """With `open`: samples at which the residual means something."""


@dataclass(frozen=True)
class Fit:
    """Joint least squares of all terms on the fine grid's open samples."""

    terms: tuple[Term, ...]
    """What was fitted."""
    coefficients: tuple[Floats, ...]
    """One array per term."""
    dataset: Dataset
    """With the fitted load and model currents."""
    residual_a: Floats
    """Current less model on the whole fine grid (it means something where samples move); (n,)."""

    @cached_property
    def sums(self) -> Sums:
        """Products of all terms on the fine grid's open samples."""
        return self.dataset.sums(self.terms, True)

    @cached_property
    def coarse_sums(self) -> tuple[Sums, list[Floats], Floats]:
        """Products of the slow terms on the coarse grid, their regressors, and the fast current.

        What the fast terms hold of the current is taken as fitted: of a ripple next to nothing is
        left in the averages of the coarse grid, by which nobody could fit it.
        """
        dataset, track = self.dataset, self.dataset.fine.track
        fast = np.zeros(track.size)
        for term, values in zip(self.terms, self.coefficients, strict=True):
            if term.effect.fast:
                fast += dataset.fine.spread(dataset.columns(term, True) @ values)
        smooth = averaged(fast, track.bounds, track.kernel)
        slow = [dataset.columns(term, False) for term in self.terms if not term.effect.fast]
        fast = block_mean(smooth, track.bounds, dataset.factor)
        return dataset.sums((), False, *slow, fast[:, None]).less_last(), slow, fast

    @cached_property
    def drift_free_error(self) -> Floats:
        """Held-out error of each part, where every part has an offset of its own."""
        grid = self.dataset.fine
        ones = self.dataset.cache.columns("ones", lambda: np.ones((grid.track.size, 1)))
        sums = self.dataset.sums(self.terms, True, ones)
        return sums.without_drift(grid.parts.stretches(grid.track.direction)).held_out()

    @cached_property
    def unsmoothed_error(self) -> Floats:
        """Held-out error of each part, with the difference to other windows beside the terms."""
        blur = self.dataset.fine.track.blur
        beside = [] if blur is None else [self.dataset.cache.columns("blur", lambda: blur)]
        return self.dataset.sums(self.terms, True, *beside).held_out()

    def forget(self) -> None:
        """Drop what is computed again where it is asked for: a search keeps many fits."""
        self.dataset.fine.track.forget()
        self.dataset.coarse.track.forget()
        for name in ("sums", "coarse_sums"):
            self.__dict__.pop(name, None)

    @cached_property
    def opened(self) -> "Fit":
        """The same fit with the sealed samples beside the open ones: itself, if they are there.

        Of a long recording the fine grid holds a sample of the open groups alone; the terms are
        fitted once more, to the same samples, where some of every sealed group can be predicted.
        """
        dataset = self.dataset.opened
        if dataset is None:
            return self
        # This is the end: what is kept would only take memory from here on.
        self.dataset.cache.clear()
        return fit_terms(replace(dataset, held=self.dataset.held), self.terms)

    @property
    def judged(self) -> Judged:
        """Residuals at the full rate where the motion is clear of corners, as of `sharp`.

        Else as smooth as the acceleration: what the terms that follow it hold of the current is
        smooth already, all else is put through the same moving average, over its own samples.
        """
        dataset, track, grid = self.dataset, self.dataset.fine.track, self.dataset.fine
        residual, current, sharp = self.residual_a, track.current_a, dataset.sharp
        if sharp is grid or dataset.coarse is grid:
            return Judged(residual, current, sharp.fit, sharp.sealed)
        smooth = np.zeros(track.size)
        for term, values in zip(self.terms, self.coefficients, strict=True):
            if term.effect.domain == "acceleration":
                smooth += grid.spread(dataset.columns(term, True) @ values)
        whole = np.stack([residual + smooth, current, np.ones(track.size)], axis=1)
        found = np.stack([residual, current], axis=1)
        for some, others in ((grid.fit, grid.sealed), (grid.sealed, grid.fit)):
            means = averaged(np.where(others[:, None], 0.0, whole), track.bounds, track.kernel)
            unclear = some & ~track.clear
            found[unclear] = means[unclear, :2] / means[unclear, 2:]
            found[unclear, 0] -= smooth[unclear]
        return Judged(found[:, 0], found[:, 1], grid.fit, grid.sealed)

    def rmse(self, sealed: bool) -> float:
        """Root mean square error of the open or of the sealed samples."""
        found = (self.opened if sealed else self).judged
        return rmse_of(found.residual_a[found.sealed if sealed else found.open])

    @property
    def sealed_r2(self) -> float:
        """Share of the current's variance on the sealed samples that the fit predicts."""
        found = self.opened.judged
        return r2_of(found.current_a[found.sealed], found.residual_a[found.sealed])


def rmse_of(residual: Floats) -> float:
    """Root mean square, 0 of nothing."""
    return float(np.sqrt(np.mean(residual**2))) if residual.size else 0.0


def r2_of(current: Floats, residual: Floats) -> float:
    """Share of a current's variance, (n,), that is not in the residual; below 0 if that adds."""
    variance = float(np.var(current)) if current.size else 0.0
    return 1.0 - rmse_of(residual) ** 2 / variance if variance > 0 else 0.0


def fit_terms(dataset: Dataset, terms: tuple[Term, ...], rounds: int = MOST_ROUNDS) -> Fit:
    """Fit all terms jointly; what follows the load or the model, until no error falls."""
    following = [t for t in terms if not (t.is_constant or t.effect.from_terms)]
    names, kept, track = frozenset(t.key for t in terms), dataset.cache.settled, dataset.fine.track
    # A set of terms that was met before, in another order, begins where it ended.
    rounds = 1 if names in kept or not following else rounds
    load_a, model_a = kept.get(names, (track.load_a, track.model_a))
    dataset = dataset.with_model(load_a, model_a, static_terms(terms))
    fewest = 2 if np.any(dataset.fine.track.model_a) else 3
    settled = NEARLY if all(term.effect.follows_load for term in following) else SETTLED
    best, least = dataset, np.inf
    for number in range(1, rounds + 1):
        fitted = _fit_once(dataset, terms)
        error = rmse_of(fitted.residual_a[fitted.dataset.sharp.fit]) if following else 0.0
        falls = error < (1 - settled) * least
        if falls or number <= fewest:
            best, least, found = dataset, error, fitted
        if number == rounds or (number >= fewest and not falls):
            break
        dataset = _with_newton_load(fitted)
    if rounds > 1:
        kept[names] = best.fine.track.load_a, best.fine.track.model_a
    return found


def _with_newton_load(fitted: Fit) -> Dataset:
    """Return the dataset with the load that Gauss-Newton steps through it find.

    To fit anew beside the last load alone may stay where it is: a gravity and an offset that have
    taken up the friction which grows with the load leave that load's zero in the wrong place.
    """
    dataset, track, parts = fitted.dataset, fitted.dataset.fine.track, fitted.dataset.fine.parts
    # All else, of which a drive's answers to ripples have hundreds of columns, stays as it is.
    moves = [one.effect.carries_load or one.effect.follows_load for one in fitted.terms]
    order = np.argsort(np.logical_not(moves), kind="stable")
    terms, known = ([some[i] for i in order] for some in (fitted.terms, fitted.coefficients))
    roles = [(term.effect.carries_load, term.effect.follows_load) for term in terms]
    # What carried the load may have been taken out again.
    if not all(map(any, zip(*roles, strict=True))):
        return dataset
    every = max(parts.rows.size // LOAD_SAMPLES, 1)
    rows = parts.rows[::every]
    count, widths = sum(moves), [values.size for values in known]
    blocks = [dataset.columns(term, fine=True) for term in terms]
    some = [dataset.cache.rows(block, parts, True, every)[: rows.size] for block in blocks]
    columns, others = np.concatenate(some[:count], axis=1), some[count:]
    kept = dataset.sums((), True, *blocks[count:]).gram.sum(axis=0) / every
    carries, follows = np.repeat(roles[:count], widths[:count], axis=0).T
    carriers = np.concatenate([dataset.fine.spread(b) for b in blocks[:count]], axis=1)[:, carries]
    followers = [term for term in terms if term.effect.follows_load]
    beside = [t.effect.beside(track, t.parameters, carriers, rows) for t in followers]
    values = start = np.concatenate(known)
    least, step = np.inf, 0.0 * values
    for _ in range(MOST_ROUNDS):
        own, *held = np.split(values, np.cumsum(widths)[count - 1 : -1])
        laid = [by_load(own[carries]) for by_load in beside]
        columns[:, follows] = np.stack([regressor for regressor, _ in laid], axis=1)
        rest = track.current_a[rows] - columns @ own - sum(map(np.matmul, others, held))
        error = float(rest @ rest)
        falls, settled = error < least, abs(least - error) <= SETTLED * least < np.inf
        if falls:
            least, start = error, values
        if settled:
            break
        if falls:
            jacobian = columns.copy()
            for (_, slopes), value in zip(laid, own[follows], strict=True):
                jacobian[:, carries] += value * slopes
            asked = np.concatenate([jacobian, rest[:, None]], axis=1)
            found = np.concatenate([block.T @ asked for block in (jacobian, *others)])
            of_held = np.concatenate([found[own.size :, :-1].T, kept])
            step = 2 * solve(np.block([found[:, :-1], of_held]), found[:, -1])
        # A step that was too long is halved.
        step = step / 2
        values = start + step
    load = carriers @ start[: own.size][carries]
    return dataset.with_model(load, track.model_a, static_terms(fitted.terms))


def _fit_once(dataset: Dataset, terms: tuple[Term, ...]) -> Fit:
    grid = dataset.fine
    current = grid.track.current_a
    blocks = [dataset.columns(term, fine=True) for term in terms]
    widths = [block.shape[1] for block in blocks]
    sums = dataset.sums(terms, True, blocks=blocks)
    solution = solve(sums.damped(sums.gram.sum(axis=0)), sums.moment.sum(axis=0))
    coefficients = tuple(np.split(solution, np.cumsum(widths)[:-1])) if terms else ()
    pairs = zip(blocks, coefficients, strict=True)
    parts = (grid.spread(block @ values) for block, values in pairs)
    total, model, load = currents(terms, parts, current.size)
    dataset = dataset.with_model(load, model, static_terms(terms))
    fitted = Fit(terms, coefficients, dataset, current - total)
    fitted.__dict__["sums"] = sums  # until it is forgotten
    return fitted


def static_terms(terms: Sequence[Term]) -> tuple[Term, ...]:
    """Terms that make up the model which others shift, scale or ripple with."""
    return tuple(term for term in terms if term.effect.static and not term.effect.fast)


def currents(
    terms: Sequence[Term], parts: Iterable[Floats], size: int
) -> tuple[Floats, Floats, Floats]:
    """Add up all terms' currents, (n,) each, the static ones', and those of the load."""
    total, model, load = np.zeros(size), np.zeros(size), np.zeros(size)
    for term, part in zip(terms, parts, strict=True):
        total += part
        if term.effect.static and not term.effect.fast:
            model += part
        if term.effect.carries_load:
            load += part
    return total, model, load
