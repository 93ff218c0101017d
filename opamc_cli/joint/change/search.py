"""Which slow effects of the library acted in the target alone."""

from dataclasses import dataclass, replace

import numpy as np

from opamc_cli.joint.change.reading import Finding
from opamc_cli.joint.change.slow import (
    Population,
    Prepared,
    Shift,
    prepared,
    shift_current,
    shifts,
    slow_candidates,
)
from opamc_cli.joint.change.units import Unit, own_fit
from opamc_cli.joint.effects.base import Parameters
from opamc_cli.joint.effects.library import Library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.track import Floats

NO_CAUSE_OF_CHANGE = frozenset(
    {"inertia", "gravity", "elasticity", "time_delay", "thermal_viscous", "warmup", "stribeck"}
)
"""Alone in the target, inertia and gravity are one thing: a changed payload. The temperature has
a test of its own; a warm-up and a Stribeck curve are friction whose form a change is too small
to show."""

PLACE_BOUND = frozenset({"spring", "hysteresis"})
"""Not sought where the phases alone give the place: it has no zero there."""

EXPECTED = {"payload_change": 0.1, "offset": 0.1, "viscous": 0.4, "coulomb": 0.4}
"""What most often changes, and each one's part of the level: friction differs most from day to day
and needs the larger parts; payload and offset, where there are any, are seen at once. Of effects
that explain a change equally well, the first of these is named."""

UNEXPECTED = 0.5
"""All other effects' part, shared by as many as there are and by all their guesses."""

GREASE = frozenset({"viscous", "sublinear_friction", "quadratic_friction"})
FRICTION = GREASE | {"coulomb"}
"""How viscous friction grows with the speed is not known well enough to tell the first three apart
by a change of it."""

LARGEST_P = 0.015
PLANNED_P = 0.05
HIDDEN_P = 0.001
"""Below which dry or viscous friction counts as the first cause though the target lies no farther
from the baseline's mean than its own sessions do: what those differ by may happen to hide it."""

SMALLEST_GAIN = 0.03
"""What explains less of the slow change is not worth a maintainer's time."""

AS_GOOD, NEARLY_AS_GOOD = 0.95, 0.85
COLLINEAR = 0.6
SMALLEST_SHIFT = 0.01
"""A shift below this share of the slow current's root mean square is of no interest."""

MOST_CAUSES = 3
STEEPEST_PER_C = 0.06
"""Viscosity halves over 12 degrees at most."""

SMALLEST_WARMTH_C = 2.0
LARGEST_COLD_FACTOR = 2.0


@dataclass(frozen=True, kw_only=True)
class SlowCause(Finding):
    """A slow effect that changed; for the temperature its parameters say how much warmer it was."""

    shift: Shift
    """Jointly with the causes before it."""


def find_slow_causes(
    units: list[Unit], population: Population, library: Library
) -> list[SlowCause]:
    """Add effects one by one while the target lies outside what the baseline's units show."""
    logged = "logged" in units[0].fine.channels
    effects = [
        effect
        for name, effect in library.items()
        if not effect.fast
        and name not in NO_CAUSE_OF_CHANGE
        and name != "payload_change"
        and (logged or name not in PLACE_BOUND)
    ]
    candidates = slow_candidates(units, effects)
    payload = library.get("payload_change")
    if payload is not None:
        # Without a scale of the joint angle a payload is inertia.
        shown = None if "scale" in units[0].fine.channels else (2,)
        candidates.append(Term(payload, {"since_s": -1.0}, shown))
    ready = prepared(units, population)
    found: list[SlowCause] = []
    gone: set[str] = set()
    for _ in range(MOST_CAUSES):
        before = found[-1].shift if found else None
        cause = _next(ready, population, before, candidates, library)
        if cause is None:
            break
        found.append(cause)
        gone |= {cause.effect, cause.shift.terms[-1].effect.name, *cause.ties}
        if cause.effect == "thermal_viscous":
            gone |= GREASE
        candidates = [term for term in candidates if term.effect.name not in gone]
    return _one_grease(ready, population, found)


def _one_grease(
    ready: list[Prepared], population: Population, found: list[SlowCause]
) -> list[SlowCause]:
    """Cold grease stiffens dry friction too, if less than viscous friction: that is one cause."""
    names = [cause.effect for cause in found]
    pair = {"thermal_viscous", "coulomb"}
    if not pair <= set(names) or not _mostly_wet(*_relative(ready, population)):
        return found
    first, last = sorted(names.index(name) for name in pair)
    one = [*found]
    one[first] = replace(found[names.index("thermal_viscous")], shift=found[first].shift)
    # Each cause's shift holds those before it: what comes before the later one takes it over.
    one[last - 1] = replace(one[last - 1], shift=found[last].shift)
    return [*one[:last], *one[last + 1 :]]


def _next(
    ready: list[Prepared],
    population: Population,
    before: Shift | None,
    candidates: list[Term],
    library: Library,
) -> SlowCause | None:
    chosen = before.terms if before is not None else ()
    guesses: dict[str, int] = {}
    for term in candidates:
        guesses[term.effect.name] = guesses.get(term.effect.name, 0) + 1
    best: dict[str, tuple[float, Shift]] = {}
    for shift in shifts(ready, population, chosen, candidates):
        name = shift.terms[-1].effect.name
        part = EXPECTED.get(name, UNEXPECTED / (guesses[name] * len(guesses)))
        p_value = min(shift.p_value / part, 1.0)
        size = float(np.mean(_contribution(ready, shift) ** 2))
        if name not in best and size >= SMALLEST_SHIFT**2 * population.power:
            best[name] = (p_value, shift)
    if not best:
        return None
    expected = None if chosen else _expected(ready, population, best)
    if expected is not None:
        return expected
    sure = {name: entry for name, entry in best.items() if entry[0] <= LARGEST_P}
    if not sure:
        return None
    left = _left(ready, before)
    gains = {name: left - _left(ready, shift) for name, (_, shift) in sure.items()}
    most = max(gains.values())
    if most < SMALLEST_GAIN * max(left - _left(ready, None, after=False), 0.0) or most <= 0:
        # Friction differs most between sessions, and what they differ by may happen to hide it.
        surest = min(sure, key=lambda name: sure[name][0])
        if chosen or surest not in ("coulomb", "viscous") or sure[surest][0] > HIDDEN_P:
            return None
        gains, most = {surest: 0.0}, 0.0
    # Among those that explain the change equally well, the simplest is named.
    as_good = [name for name, gain in gains.items() if gain >= AS_GOOD * most]
    first = min(as_good, key=lambda name: (sure[name][1].width, _rank(name), sure[name][0]))
    own = _contribution(ready, sure[first][1])
    ties = tuple(
        name
        for name in gains
        if name != first
        and gains[name] >= NEARLY_AS_GOOD * gains[first]
        and _correlation(own, _contribution(ready, sure[name][1])) > COLLINEAR
    )
    if first == "spring" and "payload_change" in ties:
        # Over a short travel another weight looks like a spring, and is what changes.
        first, ties = (
            "payload_change",
            ("spring", *(tie for tie in ties if tie != "payload_change")),
        )
    p_value, shift = sure[first]
    parameters = dict(shift.terms[-1].parameters)
    meaning = library[first].interpretation(parameters, ready[-1].unit.fine)
    if first == "payload_change":
        parameters, meaning = {}, "another payload (check the tool, not the gear)"
    cause = SlowCause(
        effect=first,
        parameters=parameters,
        interpretation=meaning,
        shift=shift,
        p_value=p_value,
        ties=ties,
    )
    if {first, *ties} & GREASE:
        return _friction(ready, population, cause, library)
    return cause


def _expected(
    ready: list[Prepared], population: Population, best: dict[str, tuple[float, Shift]]
) -> SlowCause | None:
    """Grease of another temperature, where the logged one has left the baseline's range."""
    warmer = _warmer(ready)
    if warmer is None or "viscous" not in best:
        return None
    _, shift = best["viscous"]
    if shift.p_value > PLANNED_P or not _plausible(ready, population, shift, warmer):
        return None
    others = [p for name, (p, _) in best.items() if name not in FRICTION]
    if min(others, default=1.0) < min(shift.p_value, LARGEST_P):
        return None
    return _thermal(shift, shift.p_value, ("viscous",), warmer)


def _friction(
    ready: list[Prepared], population: Population, cause: SlowCause, library: Library
) -> SlowCause:
    """Where grease of another temperature explains a change of friction, it is no fault."""
    if "thermal_viscous" not in library:
        return cause
    ties = (cause.effect, *cause.ties)
    warmer = _warmer(ready)
    if warmer is not None:
        if _plausible(ready, population, cause.shift, warmer):
            return _thermal(cause.shift, cause.p_value, ties, warmer)
        return cause
    if ready[0].unit.fine.temperature_c is not None:
        return cause  # as warm as ever
    dry, wet = _relative(ready, population)
    if _mostly_wet(dry, wet) and 1 / LARGEST_COLD_FACTOR < 1 + wet < LARGEST_COLD_FACTOR:
        return _thermal(cause.shift, cause.p_value, ties, None)
    return cause


def _thermal(
    shift: Shift, p_value: float, ties: tuple[str, ...], warmer: float | None
) -> SlowCause:
    parameters: Parameters = {}
    meaning = (
        "colder or warmer grease: friction that grows with the speed has changed (no temperature "
        "was logged: compare at equal temperature, and look at the grease if it remains)"
    )
    if warmer is not None:
        parameters = {"warmer_c": warmer}
        word = "warmer" if warmer > 0 else "colder"
        meaning = f"{word} grease (by {abs(warmer):.0f} °C; it is stiffer when cold), not a fault"
    return SlowCause(
        effect="thermal_viscous",
        parameters=parameters,
        interpretation=meaning,
        shift=shift,
        p_value=p_value,
        ties=ties,
    )


def _warmer(ready: list[Prepared]) -> float | None:
    """How much warmer the target was, where that lies outside the baseline's own range."""
    means: dict[bool, list[float]] = {False: [], True: []}
    for one in ready:
        degrees = one.unit.fine.temperature_c
        if degrees is None:
            return None
        means[one.unit.after].append(float(np.mean(degrees[one.unit.fine_rows])))
    difference = float(np.mean(means[True]) - np.mean(means[False]))
    usual = max(2 * float(np.std(means[False], ddof=1)), SMALLEST_WARMTH_C)
    return difference if abs(difference) > usual else None


def _plausible(ready: list[Prepared], population: Population, shift: Shift, warmer: float) -> bool:
    """Stiffer when colder, and by no more than grease is."""
    _, wet = _relative(ready, population)
    return wet * warmer < 0 and abs(np.log(max(1 + wet, 1e-3))) < STEEPEST_PER_C * abs(warmer)


def _relative(ready: list[Prepared], population: Population) -> tuple[float, float]:
    """Relative changes of dry and of viscous friction."""
    mean = np.mean(
        [own_fit(one.unit, population.terms)[0] for one in ready if one.unit.after], axis=0
    )
    changes = {"coulomb": 0.0, "viscous": 0.0}
    for name, before, after in zip(population.names, population.mean, mean, strict=True):
        if name in changes and before != 0:
            changes[name] = float(after / before - 1)
    return changes["coulomb"], changes["viscous"]


def _mostly_wet(dry: float, wet: float) -> bool:
    """Tell whether friction changed as grease of another temperature changes it."""
    return abs(wet) > 2 * abs(dry)


def _contribution(ready: list[Prepared], shift: Shift) -> Floats:
    """Compute the last term's current in the target's units, one after the other."""
    last = shift.terms[-1]
    parts = []
    for one in ready:
        if one.unit.after:
            columns = one.unit.columns(last)
            parts.append(columns @ shift.coefficients[-columns.shape[1] :])
    return np.concatenate(parts)


def _correlation(one: Floats, other: Floats) -> float:
    product = float(np.sqrt(np.dot(one, one) * np.dot(other, other)))
    return float(np.dot(one, other)) / product if product > 0 else 0.0


def _left(ready: list[Prepared], shift: Shift | None, after: bool = True) -> float:
    """Mean square of one side's units beyond the baseline's mean model and a shift."""
    rests = [
        one.residual - shift_current(one.unit, shift) for one in ready if one.unit.after == after
    ]
    return float(np.mean([np.mean(rest**2) for rest in rests]))


def _rank(name: str) -> int:
    names = tuple(EXPECTED)
    return names.index(name) if name in names else len(names)
