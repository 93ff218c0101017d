"""What changed between two sets of recordings of one joint, as an effect of the library."""

from dataclasses import dataclass, replace

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.effects.library import Library, built_in_library, effect_named
from opamc_cli.joint.kinematics import Recording
from opamc_cli.joint.loop import close_loop, declared_fit
from opamc_cli.joint.model import Fit, fit_terms, open_session
from opamc_cli.joint.recordings import grouped_track, is_moving
from opamc_cli.joint.trace import Gate
from opamc_cli.joint.track import Bools, Floats, Joint, Track

BENIGN = frozenset({"thermal_viscous", "warmup", "payload_change"})
"""Causes that are no fault of the joint."""

WITHOUT_TARGET = frozenset({"inertia", "gravity"})
"""In the target alone these two are one thing: a changed payload."""

FOLLOWS_ITS_OWN_COVARIATE = frozenset({"thermal_viscous"})
"""The temperature itself tells baseline from target; nothing else may."""

MOST_BASELINE_STEPS = 8
MOST_CAUSES = 4


@dataclass(frozen=True)
class Cause:
    """One effect that the target has and the baseline has not, or has less of.

    Attributes
    ----------
    effect, domain : str
        From the library.
    parameters : dict
        Non-linear parameters.
    interpretation : str
        What it means to a maintainer.
    share : float
        Share of the change in mean square residual that it explains, 0 to 1, jointly with the
        causes before it.
    p_value, gain : float
        As in the loop.
    ties : tuple of str
        Effects that explain the change as well.
    benign : bool
        True where it is no fault of the joint (temperature, warm-up, payload).
    """

    effect: str
    domain: str
    parameters: Parameters
    interpretation: str
    share: float
    p_value: float
    gain: float
    ties: tuple[str, ...]
    benign: bool


@dataclass(frozen=True)
class Change:
    """What `explain_change` found.

    Attributes
    ----------
    causes : tuple of Cause
        In the order in which they were found; empty where nothing passed the gate.
    excess_a : float
        Root of how much larger the mean square residual of the target is than the baseline's,
        under the baseline's model.
    explained_share : float
        Share of that excess which all causes explain together.
    benign : bool
        True where causes explain at least 80 % of the excess and none of them is a fault.
    domain : str or None
        Where an unexplained rest is structured, if it is.
    why_not : str or None
        Why nothing could be said, where nothing could.
    """

    causes: tuple[Cause, ...]
    excess_a: float
    explained_share: float
    benign: bool
    domain: str | None = None
    why_not: str | None = None


class InTarget(Effect):
    """An effect of the library that acts in the target recordings alone."""

    static = False

    def __init__(self, effect: Effect, since_s: float) -> None:
        self.effect = effect
        self.since_s = since_s
        self.name = effect.name
        self.domain = effect.domain
        self.meaning = effect.meaning
        self.needs = effect.needs
        self.fast = effect.fast
        # The model may hold the effect already: what is sought is more of it.
        self.several = True
        self.flags_choose_columns = effect.flags_choose_columns

    def untestable(self, track: Track) -> str | None:
        """As the effect itself."""
        return self.effect.untestable(track)

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """As the effect itself, from the target's residual."""
        inside = np.where(self._target(track), residual, 0.0)
        return self.effect.guesses(track, inside)

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """As the effect itself."""
        return self.effect.limits(track)

    def is_constant(self, parameters: Parameters) -> bool:
        """As the effect itself."""
        return self.effect.is_constant(parameters)

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Regressors of the effect, zero in the baseline."""
        return self.effect.columns(track, parameters) * self._target(track)[:, None]

    def variants(self, parameters: Parameters) -> list[tuple[Parameters, tuple[int, ...]]]:
        """As the effect itself."""
        return self.effect.variants(parameters)

    def settled(self, parameters: Parameters, track: Track) -> Parameters:
        """As the effect itself."""
        return self.effect.settled(parameters, track)

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """As the effect itself."""
        return self.effect.interpretation(parameters, track)

    def _target(self, track: Track) -> Bools:
        inside: Bools = track.time_s >= self.since_s
        return inside


def explain_change(
    baseline: list[Recording],
    target: list[Recording],
    joint: Joint,
    declared: tuple[str, ...] = ("inertia", "gravity", "coulomb", "viscous"),
    library: Library | None = None,
    seed: int = 0,
) -> Change:
    """Trace what changed between a baseline and a target of one joint.

    The loop is closed on the baseline; its model is fitted to both together; then every effect of
    the library is tried in the target alone, by the same gate as in the loop.

    Parameters
    ----------
    baseline, target : list of Recording
        Recordings of one joint at one rate, each with a signed current and its motion, or three
        phases.
    joint : Joint
        Gear ratio and pole pairs, where known.
    declared : tuple of str
        Effects of the baseline's model; those that the recordings cannot show are left out.
    library : Library, optional
        Effects that may be causes; the built-in ones by default.
    seed : int
        For the decoys.

    Returns
    -------
    Change
    """
    library = library or built_in_library()
    own, grouping = grouped_track([replace(r, started_s=None) for r in baseline], joint)
    if not is_moving(own) or grouping is None:
        return Change((), 0.0, 0.0, False, why_not="too little motion in the baseline")
    effects = [effect_named(library, name) for name in declared]
    usable = tuple((e, None) for e in effects if e.untestable(own) is None)
    before = declared_fit(open_session(own, grouping), usable)
    model = close_loop(before, library, seed, most_steps=MOST_BASELINE_STEPS).after

    both = [replace(r, started_s=None) for r in (*baseline, *target)]
    track, grouping = grouped_track(both, joint)
    since = float(track.time_s[track.bounds[len(baseline)][0]])
    rows = track.moving & (track.time_s >= since)
    if grouping is None or np.count_nonzero(rows) < 50:
        return Change((), 0.0, 0.0, False, why_not="too little motion in the target")
    common = fit_terms(open_session(track, grouping), model.terms)
    loop = close_loop(common, _in_target(library, since), seed, Gate(), most_steps=MOST_CAUSES)

    excess = _excess(common, model, since)
    causes = []
    terms = common.terms
    explained = 0.0
    for step in loop.steps:
        terms = (*terms, step.term)
        rest = _excess(fit_terms(common.session, terms), None, since)
        now = float(np.clip(1.0 - rest / excess, 0.0, 1.0)) if excess > 0 else 0.0
        name, ties = _harmless_first(step.term.effect.name, step.ties)
        effect = library[name]
        same = name == step.term.effect.name
        causes.append(
            Cause(
                effect=name,
                domain=effect.domain,
                parameters=step.term.parameters if same else {},
                interpretation=step.interpretation if same else effect.meaning,
                share=max(now - explained, 0.0),
                p_value=step.p_value,
                gain=step.gain,
                ties=ties,
                benign=name in BENIGN,
            )
        )
        explained = max(now, explained)
    return Change(
        causes=tuple(causes),
        excess_a=float(np.sqrt(max(excess, 0.0))),
        explained_share=explained,
        benign=bool(causes) and explained >= 0.8 and all(cause.benign for cause in causes),
        domain=loop.remaining_domain,
    )


def _harmless_first(name: str, ties: tuple[str, ...]) -> tuple[str, tuple[str, ...]]:
    """Where a measured temperature or a payload explains as much, it is no fault."""
    for tie in ties:
        if name not in BENIGN and tie in ("thermal_viscous", "payload_change"):
            return tie, (name, *(other for other in ties if other != tie))
    return name, ties


def _in_target(library: Library, since_s: float) -> Library:
    return {
        name: effect if name in FOLLOWS_ITS_OWN_COVARIATE else InTarget(effect, since_s)
        for name, effect in library.items()
        if name not in WITHOUT_TARGET
    }


def _excess(fitted: Fit, baseline: Fit | None, since_s: float) -> float:
    """Mean square residual of the target less the baseline's; by the baseline's own fit if given.

    Coefficients fitted to the baseline alone show the whole change; those fitted to both have
    taken a part of it.
    """
    track = fitted.session.fine.track
    residual = fitted.residual_a
    if baseline is not None:
        residual = track.current_a.copy()
        for term, values in zip(baseline.terms, baseline.coefficients, strict=True):
            residual -= term.columns(track) @ values
    member = track.moving & (track.group >= 0)
    new = member & (track.time_s >= since_s)
    old = member & (track.time_s < since_s)
    return float(np.mean(residual[new] ** 2) - np.mean(residual[old] ** 2))
