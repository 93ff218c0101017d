"""What changed between two sets of recordings of one joint, as effects of the library."""

from dataclasses import dataclass, replace

import numpy as np

from opamc_cli.decision.measurement.gear import told
from opamc_cli.joint.change.energy import rest_growth
from opamc_cli.joint.change.lines import fast_residuals, order_spectra
from opamc_cli.joint.change.periodic import OF_THE_GEAR, find_periodic
from opamc_cli.joint.change.reading import Cause, Reading
from opamc_cli.joint.change.search import SCALE, Grease, find_slow_causes
from opamc_cli.joint.change.slow import (
    FRICTION_SPREAD,
    Population,
    learn,
    left_by,
    shift_power,
    with_model,
)
from opamc_cli.joint.change.units import Compared, Follow, follow, read_side, side_by_side, turned
from opamc_cli.joint.effects.library import Library, built_in_library, effect_named
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Joint, Track, by_motor

DECLARED = ("inertia", "gravity", "coulomb", "viscous", "offset")
"""The joint's model; what the recordings cannot show of it is left out."""

FEWEST_SESSIONS = 3
"""Fewer baseline recordings say nothing of how sessions differ: their cycles stand for them."""

SESSIONS_DIFFER = 0.02**2
LINES_DIFFER = 0.3**2
"""What is then allowed for: 2 % of the slow current, 0.3 in the logarithm of a line's power."""

SMALLEST_POWER = 1e-12
SMALLEST_SHARE = 0.03
"""What explains less of the change is not worth a maintainer's time."""

HARMLESS_SHARE = 0.5
FAULT_SHARE = 0.2
GROWTH, CLEAR_GROWTH = 4.0, 10.0
"""A mesh's ripple of twice the amplitude, four times the power, is a fault however much more cold
grease changed; where the payload has changed, which moves a healthy gear's ripple too, any ripple
has to grow tenfold in power. Nothing else does that to it: such a ripple is clear. Nor does
grease let what no effect holds grow fourfold."""


@dataclass(frozen=True)
class Change:
    """What `explain_change` found."""

    causes: tuple[Cause, ...]
    """Serious ones first, then by share; empty where healthy units show as much."""
    explained_share: float
    """Share that all causes explain together of how much larger the mean square residual is in the
    target than in the baseline, beyond the sessions' own differences."""
    harmless: bool
    """True where harmless causes explain at least half of the excess and no cause is serious."""
    units: tuple[int, int] = (0, 0)
    """Baseline and target units that were compared."""
    sessions: bool = False
    """True where these are recordings, False where they are cycles."""
    angle: str = "motor"
    """What orders are counted by: a revolution of the "motor", of the "joint", or "electrical"."""
    why_not: str | None = None
    """Why nothing could be said, where nothing could."""
    told: Joint | None = None
    """Gear or motor, as far as the baseline's own lines had to tell it."""


def explain_change(
    baseline: list[Recording],
    target: list[Recording],
    joint: Joint,
    library: Library | None = None,
    follow: Follow = follow,
) -> Change:
    """Trace what changed between a baseline and a target of one joint.

    Every recording is fitted by itself: its coefficients, and its power by motor order, are one
    sample. An effect is a cause where the target's samples lie outside what the baseline's differ
    by. With fewer than three baseline recordings their cycles are the samples, and an allowance
    is made for what sessions differ by. Recordings are of one joint at one rate, each with a signed
    current and its motion, or three phases; effects of the library, by default the built-in one,
    may be causes; `follow` tells how the baseline's are followed, or remembers it.
    """
    library = {SCALE.name: SCALE} | (library or built_in_library())
    cycles = len(baseline) < FEWEST_SESSIONS
    sides = [read_side(baseline, joint, cycles, follow), read_side(target, joint, cycles)]
    if not all(sides):
        side = "target" if sides[0] else "baseline"
        return Change((), 0.0, False, why_not=f"too little motion in the {side}")
    return _explained(sides, cycles, library)


def friction_change(
    baseline: list[Recording], target: list[Recording], joint: Joint, follow: Follow = follow
) -> float | None:
    """Tell by how much friction differs, of 1; None without three baseline sessions or a model.

    Nor where these differ by more than twice what sessions do: an upright joint's, from phases
    that do not tell the side of its torque, by 17 %, beside which a healthy sibling's stood out.
    """
    sides = [read_side(baseline, joint, False, follow), read_side(target, joint, False)]
    laid = _laid_out(sides, False, built_in_library()) if all(sides) and len(sides[0]) > 2 else ""
    if isinstance(laid, str):
        return None
    found = Grease.of(laid[0], laid[2])
    return found.whole if found.scatter <= 2 * FRICTION_SPREAD else None


def _laid_out(
    sides: list[list[Track]], cycles: bool, library: Library
) -> tuple[Compared, Compared, Population, tuple[Term, ...]] | str:
    """Lay both sides beside the baseline's model, less what repeats and with it; or say why not."""
    compared = side_by_side(*sides)
    declared = [effect_named(library, name) for name in DECLARED]
    terms = tuple(Term(one, {}) for one in declared if one.untestable(compared.track) is None)
    compared = turned(compared, terms)
    late = compared.after
    if np.count_nonzero(~late) < 2 or not late.any():
        return "too few cycles or recordings with enough motion"
    if not compared.sums(()).power[~late].any():
        return "no current in the baseline"
    population = learn(compared, terms, SESSIONS_DIFFER if cycles else 0.0)
    compared = plain = with_model(compared, population)
    if not cycles:
        compared = compared.less_repeated(terms)
        population = learn(compared, terms)
        compared = with_model(compared, population)
    return compared, plain, population, terms


def _explained(sides: list[list[Track]], cycles: bool, library: Library) -> Change:
    laid = _laid_out(sides, cycles, library)
    if isinstance(laid, str):
        return Change((), 0.0, False, why_not=laid)
    compared, plain, population, terms = laid
    late = compared.after
    joint = _told(compared, terms)
    if joint is not None:
        sides = [[by_motor(track, joint) for track in side] for side in sides]
        return replace(_explained(sides, cycles, library), told=joint)

    slow = find_slow_causes(compared, population, library)
    residual = fast_residuals(compared, terms, slow[-1].shift if slow else None)
    squares = np.bincount(compared.track.group + 1, residual**2, late.size + 1)[1:]
    left = squares / compared.dataset.fine.parts.counts
    fast = float(np.median(left[late]) - np.median(left[~late]))
    periodic = find_periodic(compared, residual, LINES_DIFFER if cycles else 0.0)
    # What each slow cause takes from the target's distance to the baseline's mean, in their order.
    apart = [left_by(compared, population, one) for one in (None, *(one.shift for one in slow))]
    rests = np.minimum.accumulate([float(np.mean(one[late])) for one in apart])
    gains = -np.diff(rests)
    if slow and not gains.any():
        # What sessions differ by hides it: its own power is what there is of it.
        gains[-1] = shift_power(compared, slow[-1].shift)
    # Coefficients that do not lie outside the baseline's differ as healthy sessions' do.
    moved = max(float(rests[0] - np.mean(apart[0][~late])), float(gains.sum())) if slow else 0.0
    whole = max(moved + max([fast, *(one.power for one in periodic)]), SMALLEST_POWER)
    causes = [
        _weighed(found, gain / whole, library, serious=gain >= FAULT_SHARE * whole)
        for found, gain in zip(slow, gains, strict=True)
    ]
    causes += _of_lines(periodic, whole, any(one.origin == "load" for one in causes), library)
    # A fault is named before what happened to the joint besides, however much that explains.
    causes = sorted(
        (cause for cause in causes if cause.serious or cause.share >= SMALLEST_SHARE),
        key=lambda one: (not one.serious, not one.clear, -one.share),
    )
    serious = any(cause.serious for cause in causes)
    others = [cause for cause in causes if cause.origin != "environment"]
    excused = len(others) < len(causes) and not serious
    if excused and rest_growth(plain, population, slow[-1].shift if slow else None) >= GROWTH:
        causes = others
    harmless = sum(cause.share for cause in causes if cause.harmless)
    return Change(
        causes=tuple(causes),
        explained_share=min(sum(cause.share for cause in causes), 1.0),
        harmless=harmless >= HARMLESS_SHARE and not serious,
        units=(int(np.count_nonzero(~late)), int(np.count_nonzero(late))),
        sessions=not cycles,
        angle=compared.track.angle_kind,
    )


def _told(compared: Compared, terms: tuple[Term, ...]) -> Joint | None:
    """Tell by the baseline's own lines what turns the angle that is known into the motor's."""
    kind = compared.track.angle_kind
    if kind == "motor":
        return None
    seen = order_spectra(compared, fast_residuals(compared, terms, None), tapered=True)
    found = Joint(*told(kind, seen.orders, seen.before, seen.resolution))
    return None if found == Joint() else found


def _of_lines(periodic: list[Reading], whole: float, loaded: bool, library: Library) -> list[Cause]:
    """Make one cause of what grew, of `whole` A^2 in all; of a `loaded` joint more is asked."""
    named = []
    for one in periodic:
        if one.effect in library:
            ratio, share = one.evidence["power_ratio"], one.power / whole
            grown, doubled = ratio >= CLEAR_GROWTH, one.kind in OF_THE_GEAR and ratio >= GROWTH
            clear = one.kind == "mesh" and grown
            enough = share >= FAULT_SHARE and (grown or not loaded)
            serious = clear or enough or (doubled and not loaded)
            named.append(_weighed(one, share, library, serious, clear))
    if not named:
        return []
    most = ("share", "serious", "clear")
    return [replace(named[0], **{one: max(getattr(n, one) for n in named) for one in most})]


def _weighed(
    found: Cause, share: float, library: Library, serious: bool, clear: bool = False
) -> Cause:
    effect = library[found.effect]
    return replace(
        found,
        domain=effect.domain,
        origin=effect.origin,
        share=float(np.clip(share, 0.0, 1.0)),
        serious=serious and effect.origin == "joint",
        clear=clear,
    )
