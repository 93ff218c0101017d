"""Which slow effects of the library acted in the target alone."""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from opamc_cli.joint.change.reading import Cause
from opamc_cli.joint.change.slow import Population, Shift, left_by, shifts
from opamc_cli.joint.change.units import Compared, own_fit
from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.effects.library import Library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.track import Floats, Track
from opamc_cli.joint.name.search import guessed

NO_CAUSE_OF_CHANGE = frozenset(
    {"inertia", "gravity", "elasticity", "time_delay", "thermal_viscous", "warmup", "stribeck"}
)
"""Alone in the target, inertia and gravity are one thing: a changed payload. The temperature has
a test of its own; a warm-up and a Stribeck curve are friction whose form a change is too small
to show."""

PLACE_BOUND = frozenset({"spring", "hysteresis"})
"""Not sought where the phases alone give the place: it has no zero there."""

EXPECTED = {
    "payload_change": 0.1, "offset": 0.1, "viscous": 0.4, "coulomb": 0.4, "current_scale": 1.0
}  # fmt: skip
"""What most often changes, and each one's part of the level: friction differs most from day to day
and needs the larger parts; payload and offset, where there are any, are seen at once; a scale has
all of it, for it must explain more than all others (at 0.1 three of nine currents off by 8 to 18 %
had no cause). Of effects that explain a change equally well, the first of these is named."""

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

LEAST_HELD = 0.25
"""Of what the model holds of the baseline: 0.08 of noise in a current's place, 0.99 of cracks."""

AS_GOOD, NEARLY_AS_GOOD = 0.95, 0.85

MOST_CAUSES = 3
STEEPEST_PER_C = 0.06
"""Viscosity halves over 12 degrees at most."""

SMALLEST_WARMTH_C, LARGEST_COLD_FACTOR = 2.0, 2.0


class Scale(Effect):
    """All of the current in one proportion, which one recording by itself cannot show."""

    name = "current_scale"
    domain = "load"
    meaning = (
        "a current that is all in one proportion to what it was, friction and load alike: magnets "
        "that have weakened, or a sensor or log of another scale"
    )
    per = ("current",)
    needs = ()

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Return the baseline's mean model."""
        return np.asarray(track.model_a)[:, None]


SCALE = Scale()
LESS_FRICTION = "less friction, and no logged warmth that explains it: a lost preload, or wear-in"


@dataclass(frozen=True, kw_only=True)
class SlowCause(Cause):
    """A slow effect that changed; for the temperature its parameters say how much warmer it was."""

    shift: Shift
    """Jointly with the causes before it."""


@dataclass(frozen=True)
class Grease:
    """How friction has changed, beside the temperature."""

    logged: bool
    """Whether there is a temperature."""
    warmer_c: float | None
    """How much warmer the target was, where that lies outside the baseline's own range."""
    dry: float
    wet: float
    """With `dry`: relative changes of dry and of viscous friction."""
    whole: float
    """Of both together, as root mean square at the speeds that occur."""
    scatter: float
    """Standard deviation of the baseline's own, of the mean; with two units at least."""

    @classmethod
    def of(cls, compared: Compared, population: Population) -> "Grease":
        """Compare both sides' friction and temperatures."""
        late, degrees = compared.after, compared.track.temperature_c
        warmer = None
        if degrees is not None:
            parts = compared.dataset.fine.parts
            warmth = degrees[parts.rows]
            means = np.array([warmth[start:stop].mean() for start, stop in parts.slices])
            difference = float(means[late].mean() - means[~late].mean())
            usual = max(2 * float(np.std(means[~late], ddof=1)), SMALLEST_WARMTH_C)
            warmer = difference if abs(difference) > usual else None
        own = own_fit(compared, population.terms)[0]
        mean = own[late].mean(axis=0)
        changes = {"coulomb": 0.0, "viscous": 0.0}
        for name, before, after in zip(population.names, population.mean, mean, strict=True):
            if name in changes and before > 0:  # of a negative friction a share says nothing
                changes[name] = float(after / before - 1)
        rubs = np.array([name in changes for name in population.names])
        products = compared.sums(population.terms).gram.sum(axis=0)
        sizes = rubs * np.vstack([population.mean, mean, own[~late]])
        before, after, *each = np.sqrt(np.einsum("uj,jk,uk->u", sizes, products, sizes))
        whole = float(after / before) - 1 if before > 0 else 0.0
        scatter = float(np.std(each, ddof=1) / np.mean(each)) if before > 0 else 0.0
        wet = changes["viscous"]
        return cls(degrees is not None, warmer, changes["coulomb"], wet, whole, scatter)

    @property
    def mostly_wet(self) -> bool:
        """Whether friction changed as grease of another temperature changes it."""
        return abs(self.wet) > 2 * abs(self.dry)

    @property
    def plausible(self) -> bool:
        """Whether another temperature explains it: stiffer when colder, by no more than grease is.

        Where none is logged, mostly viscous friction by no more than a factor of two.
        """
        if self.warmer_c is not None:
            return self.wet * self.warmer_c < 0 and self._within(self.wet, self.whole)
        little = 1 / LARGEST_COLD_FACTOR < 1 + self.wet < LARGEST_COLD_FACTOR
        return not self.logged and self.mostly_wet and little

    def _within(self, *changes: float) -> bool:
        """Whether a logged difference of temperature is enough for relative changes."""
        factors = np.maximum(1 + np.array(changes), 1e-3)
        return bool(np.all(abs(np.log(factors)) < STEEPEST_PER_C * abs(self.warmer_c or 0.0)))

    def warms(self, shift: Shift) -> bool:
        """Whether friction falls by a shift, and warmth may be behind it, as far as is known.

        Where no temperature is logged, viscous friction must have fallen by half the share by which
        dry friction fell: 0.9 of it or more where all fell alike, 0.2 at most where a preload did.
        """
        thinner = not self.logged and self.wet < min(self.dry / 2, 0.0)
        logged = self.warmer_c is not None and self.warmer_c > 0 and self._within(self.whole)
        return (thinner if self.warmer_c is None else logged) and shift.falls > 0

    def cause(self, shift: Shift, p_value: float, ties: tuple[str, ...]) -> SlowCause:
        """Name it."""
        parameters: Parameters = {} if self.warmer_c is None else {"warmer_c": self.warmer_c}
        meaning = (
            "colder or warmer grease: friction that grows with speed has changed (no temperature "
            "was logged: compare at equal temperature, and look at the grease if it remains)"
        )
        if shift.falls:
            meaning = (
                "less friction, as in warmer grease or a joint that has run in (no temperature was "
                "logged: compare at equal temperature, and look for a lost preload if it remains)"
            )
        if self.warmer_c is not None:
            word = f"{'warmer' if self.warmer_c > 0 else 'colder'} grease"
            meaning = f"{word} (by {abs(self.warmer_c):.0f} °C; stiffer when cold), not a fault"
        return SlowCause(
            effect="thermal_viscous",
            parameters=parameters,
            interpretation=meaning,
            shift=shift,
            p_value=p_value,
            ties=ties,
        )


def find_slow_causes(
    compared: Compared, population: Population, library: Library
) -> list[SlowCause]:
    """Add effects one by one while the target lies outside what the baseline's units show."""
    dataset, channels, late = compared.dataset, compared.track.channels, compared.after
    sums = compared.sums(population.terms)
    left = own_fit(compared, population.terms)[1] * sums.parts.counts
    held = 1 - left / np.maximum(sums.power, 1e-300)
    if np.median(held[late]) < LEAST_HELD * np.median(held[~late]):
        return []
    candidates = [
        term
        for name, effect in library.items()
        if not effect.fast
        and name not in NO_CAUSE_OF_CHANGE | {"payload_change"}
        and ("logged" in channels or name not in PLACE_BOUND)
        and effect.untestable(dataset.coarse.track) is None
        for term in guessed(effect, dataset)
        if term.keep is None
    ]
    payload = library.get("payload_change")
    if payload is not None:
        # Without a scale of the joint angle a payload is inertia.
        shown = None if "scale" in channels else (2,)
        candidates.append(Term(payload, {"since_s": -1.0}, shown))
    grease = Grease.of(compared, population)
    found: list[SlowCause] = []
    gone: set[str] = set()
    for _ in range(MOST_CAUSES):
        before = found[-1].shift if found else None
        cause = _next(compared, population, before, candidates, library, grease)
        if cause is None:
            break
        last = cause.shift.terms[-1].effect.name
        own = cause.shift.coefficients[-1]
        change = grease.whole if last in FRICTION else own  # of dry and viscous friction together
        if last == SCALE.name or (last in FRICTION and change * own > 0):
            cause = replace(cause, evidence={"relative_change": change})
        found.append(cause)
        gone |= {cause.effect, last, *cause.ties}
        gone |= GREASE if cause.effect == "thermal_viscous" else set()
        candidates = [term for term in candidates if term.effect.name not in gone]
    return _one_grease(found, grease)


def _one_grease(found: list[SlowCause], grease: Grease) -> list[SlowCause]:
    """Cold grease stiffens dry friction too, if less than viscous friction: that is one cause."""
    names = [cause.effect for cause in found]
    alike = {"thermal_viscous", "coulomb"} if grease.mostly_wet else {"thermal_viscous"}
    places = [place for place, name in enumerate(names) if name in alike]
    if len(places) < 2 or "thermal_viscous" not in names:
        return found
    first, last, one = places[0], places[1], [*found]
    one[first] = replace(found[names.index("thermal_viscous")], shift=found[first].shift)
    # Each cause's shift holds those before it: what comes before the later one takes it over.
    one[last - 1] = replace(one[last - 1], shift=found[last].shift)
    return [*one[:last], *one[last + 1 :]]


def _next(
    compared: Compared,
    population: Population,
    before: Shift | None,
    candidates: list[Term],
    library: Library,
    grease: Grease,
) -> SlowCause | None:
    chosen = before.terms if before is not None else ()
    best = _likeliest(compared, population, chosen, candidates)
    if not chosen and "viscous" in best and grease.warmer_c is not None and grease.plausible:
        # What is expected of another temperature needs less proof than what is not.
        shift = best["viscous"][1]
        others = best.keys() - FRICTION - {SCALE.name}
        other = min((best[name][0] for name in others), default=1.0)
        if shift.p_value <= PLANNED_P and other >= min(shift.p_value, LARGEST_P):
            return grease.cause(shift, shift.p_value, ("viscous",))
    sure = {name: entry for name, entry in best.items() if entry[0] <= LARGEST_P}
    late = compared.after
    left = float(np.mean(left_by(compared, population, before)[late]))

    def gain(shift: Shift) -> float:
        return left - float(np.mean(left_by(compared, population, shift)[late]))

    gains = {name: gain(shift) for name, (_, shift) in sure.items()}
    # What friction of both kinds, or another payload, explains as well is no scale; nor is what
    # both together, which may happen to one joint at another temperature, explain better. Where
    # nothing else is sure by itself it is named, if in a tie with friction.
    scale, rubs = gains.pop(SCALE.name, 0.0), ("coulomb", "viscous")
    both = [term for term in candidates if term.effect.name in rubs]
    loads = [term for term in candidates if term.effect.name == "payload_change"]
    alike: tuple[str, ...] = ()
    if scale > 0 and len(both) == 2 and loads and grease.warmer_c is None:
        alone, beside = (
            gain(one)
            for first in ((), loads)
            for one in shifts(compared, population, (*chosen, *first, both[0]), both[1:])
        )
        clear = NEARLY_AS_GOOD * scale > max([*gains.values(), alone]) and scale > AS_GOOD * beside
        if clear or (not gains and scale > NEARLY_AS_GOOD * alone):
            gains = {SCALE.name: scale}
            alike = rubs if alone >= NEARLY_AS_GOOD * scale else ()
    if not gains:
        return None
    most = max(gains.values())
    usual = float(np.mean(left_by(compared, population)[~late]))
    if most < SMALLEST_GAIN * max(left - usual, 0.0) or most <= 0:
        # Friction differs most between sessions, and what they differ by may happen to hide it.
        surest = min(sure, key=lambda name: sure[name][0])
        if chosen or surest not in rubs or sure[surest][0] > HIDDEN_P:
            return None
        gains, most = {surest: 0.0}, 0.0
    # Among those that explain the change equally well, the simplest is named.
    rank = [*EXPECTED, *gains].index
    ordered = sorted(gains, key=lambda one: (sure[one][1].width, rank(one), sure[one][0]))
    first = next(name for name in ordered if gains[name] >= AS_GOOD * most)
    near = NEARLY_AS_GOOD * gains[first]
    ties = alike + tuple(name for name in gains if name != first and gains[name] >= near)
    if first == "spring" and "payload_change" in ties:
        # Over a short travel another weight looks like a spring, and is what changes.
        ties = ("spring", *(tie for tie in ties if tie != "payload_change"))
        first = "payload_change"
    if first != SCALE.name and scale >= gains[first]:
        ties += (SCALE.name,)
    p_value, shift = sure[first]
    wet = not GREASE.isdisjoint((first, *ties)) and grease.plausible
    if "thermal_viscous" in library and (wet or grease.warms(shift)):
        return grease.cause(shift, p_value, (first, *ties))
    parameters = dict(shift.terms[-1].parameters)
    meaning = library[first].interpretation(parameters, compared.track)
    if first == "payload_change":
        parameters, meaning = {}, "another payload (check the tool, not the gear)"
    return SlowCause(
        effect=first,
        parameters=parameters,
        interpretation=LESS_FRICTION if shift.falls else meaning,
        shift=shift,
        p_value=p_value,
        ties=ties,
    )


def _likeliest(
    compared: Compared, population: Population, chosen: tuple[Term, ...], candidates: list[Term]
) -> dict[str, tuple[float, Shift]]:
    """Return each effect's likeliest shift, with its p over its part of the level."""
    guesses = Counter(term.effect.name for term in candidates)
    best: dict[str, tuple[float, Shift]] = {}
    declared = dict(zip(population.names, population.mean, strict=True))
    for shift in shifts(compared, population, chosen, candidates):
        name = shift.terms[-1].effect.name
        # What falls by more than there was of it is no friction.
        if name in best or shift.falls > max(declared.get(name, np.inf), 0.0):
            continue
        part = EXPECTED.get(name, UNEXPECTED / (guesses[name] * len(guesses)))
        best[name] = (min(shift.p_value / part, 1.0), shift)
    return best
