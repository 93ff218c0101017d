"""A fitted model applied to other recordings: nothing is estimated."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.fit.model import (
    MOST_ROUNDS,
    SETTLED,
    Fit,
    Term,
    currents,
    dataset_of,
    r2_of,
    rmse_of,
    static_terms,
)
from opamc_cli.joint.motion.groups import Grouping
from opamc_cli.joint.motion.track import Bools, Floats, Track

PLACED = ("motor-angle", "joint-angle")
"""Domains whose coefficients need an angle that begins at the same place in every recording."""


@dataclass(frozen=True)
class Applied:
    """What a frozen model says of recordings."""

    track: Track
    residual_a: Floats
    current_a: Floats
    """With `residual_a`: current, and current less model; next to a corner of the motion both as
    smooth as the motion; (n,) each."""
    judged: Bools
    """Samples at which it means something: the joint moves; bool array of shape (n,)."""
    terms: tuple[Term, ...] = ()
    """What was applied."""

    def rmse(self, among: Bools | bool = True) -> float:
        """Root mean square residual on the judged samples, or on those that are `among` them."""
        return rmse_of(self.residual_a[self.judged & among])

    def r2(self, among: Bools | bool = True) -> float:
        """Share of the current's variance that the model explains; negative if it adds to it."""
        rows = self.judged & among
        return r2_of(self.current_a[rows], self.residual_a[rows])


def why_not_applied(term: Term, track: Track) -> str | None:
    """Say why a term's coefficients mean nothing on other recordings; None where they do."""
    told = "per_kg" in term.parameters
    if told and track.payload_kg is None:
        return "payload_kg is not in the metadata of every run"
    if term.effect.of_its_recordings and not told:
        return "its coefficients are of the recordings that it was fitted to"
    if term.effect.domain in PLACED and "logged" not in track.channels:
        return "the phases tell how far the joint turns, but not where it begins: log the position"
    # A resonance above half the rate is a filter that never settles.
    reach = max((v for k, v in term.parameters.items() if k.endswith("_hz")), default=0.0)
    if reach >= track.rate_hz / 2:
        return (
            f"it reaches up to {reach:.4g} Hz, runs of {track.rate_hz:g} Hz to half of their rate"
        )
    # load_friction asks for a load, which comes with the model
    return None if term.effect.name == "load_friction" else term.effect.untestable(track)


def may_extrapolate(effect: Effect) -> bool:
    """Whether another motion may ask for more of an effect: a line is as high everywhere."""
    return effect.carries_load or not effect.fast


def apply_frozen(track: Track, terms: Sequence[Term], coefficients: Sequence[Floats]) -> Applied:
    """Apply terms with known coefficients; where some follow the model, until that settles.

    The track holds other recordings, at the full rate, with the reference that the terms were
    fitted with.
    """
    circular = not all(term.is_constant for term in terms)
    total = np.zeros(track.size)
    for _ in range(MOST_ROUNDS if circular else 1):
        before, pairs = total, zip(terms, coefficients, strict=True)
        parts = (term.columns(track) @ values for term, values in pairs)
        total, model, load = currents(terms, parts, track.size)
        if np.abs(total - before).max() <= SETTLED * max(np.abs(total).max(), 1e-12):
            break
        track = track.with_model(load, model, static_terms(terms))
    # One open group: nothing is fitted, but errors are judged as those of a fit.
    whole = Grouping(np.zeros(track.size, dtype=np.int64), ("all",), (), "recordings")
    dataset = dataset_of(track, whole, track.size).with_model(load, model, static_terms(terms))
    found = Fit(tuple(terms), tuple(coefficients), dataset, track.current_a - total).judged
    judged = found.open if found.open.any() else track.moving
    return Applied(track, found.residual_a, found.current_a, judged, tuple(terms))
