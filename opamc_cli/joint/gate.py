"""What a candidate must show before it is added: held-out gain, consistency, decoys."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.stats import norm

from opamc_cli.joint.model import Fit, Session, Term
from opamc_cli.joint.normal import (
    Normal,
    appended,
    halves,
    held_out_error,
    normal_equations,
    solve,
)
from opamc_cli.joint.search import Candidate, Shared, search
from opamc_cli.joint.track import Bools, Floats
from opamc_cli.joint.view import BLOCKS_PER_GROUP, View, blocks_of, noise_of, residual_on
from opamc_cli.joint.whitening import whitening_with_gaps

DECOY_BLOCKS_PER_GROUP = 2
UNLUCKY = 1.0
"""Standard deviations that one in six falls short of the mean."""


@dataclass(frozen=True)
class Gate:
    """What a candidate must show before it is added."""

    smallest_gain: float = 0.01
    smallest_t: float = 2.0
    smallest_consistency: float = 0.7
    decoy_ratio: float = 2.0
    largest_p: float = 1e-2
    decoys: int = 5


def refusal(candidate: Candidate, gate: Gate) -> str | None:
    """Say why a candidate does not pass the gate, or None where it passes."""
    if candidate.p_value > gate.largest_p:
        return f"p = {candidate.p_value:.2g}, above {gate.largest_p:g}"
    if candidate.gain < gate.smallest_gain:
        return f"held-out gain {candidate.gain:.2%}, below {gate.smallest_gain:.0%}"
    if candidate.t_value < gate.smallest_t:
        return f"t = {candidate.t_value:.1f} over blocks, below {gate.smallest_t:g}"
    least = min(gate.smallest_consistency, candidate.expected_consistency)
    if candidate.consistency < least:
        return f"better in {candidate.consistency:.0%} of the groups, below {least:.0%}"
    return None


@dataclass(frozen=True)
class Held:
    """What leaving groups out needs of the model itself, once per round.

    Attributes
    ----------
    base : array of shape (n, k)
        The model's regressors on the open samples of one grid.
    residual : array of shape (n,)
        Likewise.
    normal : Normal
        Their sums per group.
    """

    base: Floats
    residual: Floats
    normal: Normal


def prepare_held(fit: Fit, fine: bool) -> Held:
    """Collect the model's regressors and residual on the open samples of one grid."""
    grid = fit.session.grid(fine)
    base = _model_rows(fit, fine)
    residual = residual_on(fit, fine)[grid.fit]
    return Held(base, residual, normal_equations(base, residual, grid.slices))


def _model_rows(fit: Fit, fine: bool) -> Floats:
    session = fit.session
    rows = session.grid(fine).fit
    blocks = [session.columns(term, fine) for term in fit.terms]
    blur = session.grid(fine).track.blur
    if fine and blur is not None:
        blocks.append(blur)
    # Filled block by block: to put copies side by side would take twice the memory.
    base = np.empty((int(np.count_nonzero(rows)), sum(block.shape[1] for block in blocks)))
    stop = 0
    for block in blocks:
        start, stop = stop, stop + block.shape[1]
        base[:, start:stop] = block[rows]
    return base


def held_out(fit: Fit, candidate: Candidate, held: Held | None = None) -> Candidate:
    """Refit a candidate jointly with the model, each group left out in turn.

    Parameters
    ----------
    fit : Fit
        The model so far.
    candidate : Candidate
        Found by `search`.
    held : Held, optional
        From `prepare_held`, on the candidate's grid.

    Returns
    -------
    Candidate
        With its gain.
    """
    session = fit.session
    grid = session.grid(candidate.fine)
    held = held or prepare_held(fit, candidate.fine)
    own = session.columns(candidate.term, candidate.fine)[grid.fit]
    known, slices = held.normal, grid.slices
    if _in_one_group(session, candidate.term):
        slices = halves(slices)
        known = normal_equations(held.base, held.residual, slices)
    normal = appended(known, held.base, own, held.residual, slices)
    before = held_out_error(known)
    falls = before - held_out_error(normal)
    return replace(candidate, gain=float(falls.sum() / max(before.sum(), 1e-300)))


def removal_gains(fit: Fit, places: Sequence[int]) -> list[float]:
    """Held-out share of the mean square that each of some terms of a fit takes off.

    Parameters
    ----------
    fit : Fit
        The model.
    places : sequence of int
        Which of its terms.

    Returns
    -------
    list of float
        As `held_out` finds for the term where all others are fitted; fast terms on the fine
        grid, others on the coarse one.
    """
    session = fit.session
    normals: dict[bool, Normal] = {}
    owner = np.repeat(np.arange(len(fit.terms)), [values.size for values in fit.coefficients])
    once = any(_in_one_group(session, term) for term in fit.terms)
    gains = []
    for place in places:
        fine = fit.terms[place].effect.fast
        if fine not in normals:
            grid = session.grid(fine)
            signal = grid.track.current_a[grid.fit]
            slices = halves(grid.slices) if once else grid.slices
            normals[fine] = normal_equations(_model_rows(fit, fine), signal, slices)
        normal = normals[fine]
        others = [k for k in range(normal.moment.shape[1]) if k >= owner.size or owner[k] != place]
        before = held_out_error(normal.taken(others)).sum()
        after = held_out_error(normal).sum()
        gains.append(float((before - after) / max(before, 1e-300)))
    return gains


def with_consistency(session: Session, view: View, candidate: Candidate) -> Candidate:
    """Find the share of groups that a candidate explains better when it is fitted to the others.

    Parameters
    ----------
    session : Session
        Recordings.
    view : View
        Whitened residual: a slow drift inside a group would drown what the candidate explains.
    candidate : Candidate
        From `search`.

    Returns
    -------
    Candidate
        With that share, every group counted with the energy of what the candidate adds there, and
        with the share that an effect of its size has at least, but for one time in six: where
        it explains little of each group, noise hides it in some.
    """
    base = view.span.shape[1]
    own = view.whitened_rows(session.columns(candidate.term, candidate.fine))
    edges = np.flatnonzero(np.diff(view.grid.track.group[view.rows])) + 1
    slices = tuple(pairwise([0, *edges.tolist(), view.rows.size]))
    if _in_one_group(session, candidate.term):
        slices = halves(slices)
    model = normal_equations(view.span, view.values, slices)
    normal = appended(model, view.span, own, view.values, slices)
    falls = held_out_error(model) - held_out_error(normal)
    energy = _excitation(normal, base)
    weights = energy / max(float(energy.sum()), 1e-300)
    # What a known effect of energy e explains of a group is e, give or take twice its root.
    better = norm.cdf(0.5 * np.sqrt(energy / view.variance))
    spread = float(np.sqrt(np.sum(weights**2 * better * (1 - better))))
    return replace(
        candidate,
        consistency=float(np.sum(weights * (falls > 0))),
        expected_consistency=float(weights @ better) - UNLUCKY * spread,
    )


def _excitation(normal: Normal, base: int) -> Floats:
    """Energy per group of the candidate's contribution that the model cannot make."""
    gram = normal.gram.sum(axis=0)
    whole = solve(gram, normal.moment.sum(axis=0))[base:]
    inside = solve(
        np.broadcast_to(gram[:base, :base], (1, base, base)),
        (gram[:base, base:] @ whole)[None, :],
    )[0]
    direction = np.concatenate([-inside, whole])
    energy: Floats = np.einsum("i,gij,j->g", direction, normal.gram, direction)
    return energy


def decoy_likelihood(
    fit: Fit,
    view: View,
    candidate: Candidate,
    generator: np.random.Generator,
    count: int,
    enough: float = np.inf,
) -> float:
    """Best likelihood that the same search finds where the candidate's effect is not.

    The candidate's contribution is taken out of the residual, every group is cut into two
    blocks (eight for fast effects, since other lines of a spectrum would survive in long ones),
    and their signs are drawn at random: what is left has the noise's size and colour,
    slow drifts included, but follows no covariate. A chance candidate takes out little, so its
    decoys do as well as it did.

    Parameters
    ----------
    fit : Fit
        The model so far.
    view : View
        Whitened residual.
    candidate : Candidate
        Whose form is searched again.
    generator : numpy Generator
        For the signs.
    count : int
        Decoys.
    enough : float
        A decoy that reaches more is the last.

    Returns
    -------
    float
        Largest likelihood.
    """
    worst = 0.0
    rest = view.values - candidate.contribution
    fast = candidate.term.effect.fast
    blocks = blocks_of(view, BLOCKS_PER_GROUP if fast else DECOY_BLOCKS_PER_GROUP)
    # Fast effects guess from the residual, all others the same every time.
    shared: Shared | None = None if fast else {}
    for _ in range(count):
        values = rest.copy()
        for block in blocks:
            values[block] *= generator.choice([-1.0, 1.0])
        values -= view.span @ (view.span.T @ values)
        shuffled = np.zeros_like(view.residual)
        shuffled[view.valid] = values
        decoy = replace(view, residual=shuffled)
        found, _tried = search(fit.session, decoy, candidate.term.effect, shared=shared)
        if found is not None:
            worst = max(worst, found.likelihood)
        if worst > enough:
            break
    return worst


@dataclass(frozen=True)
class SealedFall:
    """Fall of the sealed square error from one fit to another.

    Attributes
    ----------
    plain : float
        Share of the error before.
    likelihood : float
        Of the whitened error, in units of the noise's variance.
    """

    plain: float
    likelihood: float


def sealed_fall(before: Fit, after: Fit) -> SealedFall:
    """Compare two fits on the sealed data.

    Parameters
    ----------
    before, after : Fit
        Of the same recordings. The noise's colour is the open groups' under `before`. A group
        in which something happened once does not judge: nothing open tells when.
    """
    track = before.opened.session.sharp.track
    sealed = _judging(after)
    usable = track.moving & (track.group >= 0)
    first, last = (fit.opened.residual_a[sealed] for fit in (before, after))
    error = float(first @ first)
    plain = 1.0 - float(last @ last) / error if error > 0 else 0.0
    noise = noise_of(before, True, before.residual_a)
    whitening = whitening_with_gaps(noise, usable, track.bounds, sealed)
    errors = [float(np.sum(whitening(fit.opened.residual_a) ** 2)) for fit in (before, after)]
    variance = min(errors) / max(whitening.rows.size, 1)
    likelihood = (errors[0] - errors[1]) / variance if variance > 0 else 0.0
    return SealedFall(plain, likelihood)


def _in_one_group(session: Session, term: Term) -> bool:
    return term.effect.in_one_group(session.fine.track, term.parameters)


def _judging(fit: Fit) -> Bools:
    """Sealed samples, without the groups in which an effect began, if any are left."""
    grid = fit.opened.session.sharp
    judging = grid.sealed.copy()
    for term in fit.terms:
        if "since_s" in term.parameters:
            at = int(np.searchsorted(grid.track.time_s, term.parameters["since_s"]))
            judging &= grid.track.group != grid.track.group[min(at, grid.track.size - 1)]
    return judging if judging.any() else grid.sealed
