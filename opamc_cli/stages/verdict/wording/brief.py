"""The verdict on a joint in a few words: what to do first, what speaks for it and what against."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from opamc_cli.decision.judge import PATTERNS, Bundle, Judgement
from opamc_cli.decision.witnesses.amplitudes import AmplitudeEvidence, clearest_amplitude
from opamc_cli.decision.witnesses.patterns import effect_by_cell
from opamc_cli.decision.witnesses.profiles import ProfileEvidence, clearest_course
from opamc_cli.decision.witnesses.spectra import SpectrumEvidence, clearest_change, typical_ratio
from opamc_cli.stages.verdict.wording.reasons import (
    COMMON,
    CURRENT_LAG,
    IN_SPIKES,
    IN_THE_SUM,
    OF_SENSORS,
    SENSOR_NOISE,
    SMALLER_PART,
    called,
    effect_in_words,
    excuses_little,
    explains_little,
    lies_outside,
)

MOST_EVIDENCE = 2
FEW_SESSIONS = 4
"""Fewer say little of how much healthy ones differ."""

SMOOTHER = 0.5
"""Of the baseline's fluctuations: a run-in or a warmer gear takes some per cent, a filter most."""

GEAR = "Inspect the gear: backlash by hand, teeth, wave generator bearing, grease; then brake."

AGAIN = (
    "Record again with the baseline's tool, as it was mounted, payload and warmth; if it is still "
    f"there, {GEAR[0].lower()}{GEAR[1:]}"
)
"""Of what is no fault yet, and nothing explains: of ten such joints of two draws by a stranger two
were at fault, five shaken by another, three healthy (a tool 1 cm off, another start)."""

BY_FAR = 100.0
"""Times as far as any other: of 48 strangers' pairs joints that were shaken lay 42 times as far as
the one at fault at most, and that one 430 times as far where a neighbour's current changed more."""

BEYOND_COMMON = 10.0
"""Times as far as all joints have moved, from which that is no reason against a fault."""

SLIGHT = 0.02
"""By which a size differs that is said last: nobody looks for 1.01 times, however sure it is."""

SMALLEST_PART = 0.03
HARDLY_ANY = "There is besides, if hardly any of the change: {}."
"""A line of the mesh that has grown for sure is told however little it is: early damage is. It was
"a smaller part of the change" where its share was 0 %."""

SHAKEN = "Axis {}, which is at fault, may shake it: see to that one first."

UNLIKE = (
    "Record again under the baseline's conditions: {}, which moves a healthy joint's current, too."
)


def brief(
    judgement: Judgement,
    bundle: Bundle,
    cause: Mapping[str, Any] | None,
    unit: str = "A",
    which: str | None = None,
    *,
    in_vain: bool = False,
    unlike: str = "",
) -> dict[str, Any] | None:
    """Return what a maintainer needs of an unhealthy joint; None for any other.

    `which` says which of several target sessions show it; `in_vain`, that a cause was sought;
    `unlike`, which declared conditions are not the baseline's.

    Returns
    -------
    dict or None
        `inspect`: what to do first; `evidence`: the strongest pieces, at most two; `against`:
        what speaks against a fault.
    """
    if judgement.state not in ("changed", "fault"):
        return None
    return {
        "inspect": _inspect(cause, judgement, bundle, unlike),
        "evidence": [*([which] if which else []), *_evidence(judgement, bundle, unit)][
            :MOST_EVIDENCE
        ],
        "against": f"{_against(judgement, cause, in_vain)} {_tie(cause)}".strip(),
    }


def foremost(axes: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Return the entry of verdict.json to look at first; None where no axis is unhealthy.

    A joint at fault shakes its neighbours, and a quiet one may lie far from its baseline by next
    to nothing: first comes the one that is farthest out by far, else the one whose current has
    changed most, but for what has changed by a load or the weather.
    """
    found = sorted(filter(_unhealthy, axes), key=_index)
    if len(found) > 1 and _index(found[-1]) <= BY_FAR * max(_index(found[-2]), 0.0):
        # of joints judged without course and spectrum nobody knows
        known = None not in map(_changed_a, found)
        found.sort(key=lambda one: (not _from_outside(one), (_changed_a(one) or 0.0) * known))
    return found[-1] if found else None


def shaken_by(axes: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """Return the entry at fault that others may be shaken by; None without any."""
    first = foremost(axes)
    sure = first is not None and first["state"] == "fault" and not _from_outside(first)
    return first if sure else None


def _unhealthy(entry: Mapping[str, Any]) -> bool:
    return entry.get("state") in ("changed", "fault")


def _index(entry: Mapping[str, Any]) -> float:
    return float(entry.get("health_index") or 0.0)


def _changed_a(entry: Mapping[str, Any]) -> float | None:
    return (entry.get("distance") or {}).get("changed_a")


def _from_outside(entry: Mapping[str, Any]) -> bool:
    """Whether it shakes nobody; a sensor of the drive's own does, through its control."""
    cause = entry.get("cause") or {}
    return lies_outside(cause) and cause.get("origin") != "measurement"


def with_shaken(axes: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Say of joints that are excused, or unhealthy without a cause of half, that one shakes them.

    Of entries of verdict.json whose states are final.
    """
    first = shaken_by(axes)
    return [one if first in (None, one) else _beside(first, one) for one in axes]


def _beside(first: Mapping[str, Any], one: Mapping[str, Any]) -> Mapping[str, Any]:
    shaken, cause = SHAKEN.format(first["axis"]), one.get("cause")
    if one.get("brief") and (cause is None or explains_little(cause)):
        against = f"{one['brief']['against']} {shaken}".strip()
        return {**one, "brief": {**one["brief"], "against": against}}
    if one.get("excused"):
        why, *others = one["reasons"]
        return {**one, "reasons": [f"{why} {shaken}", *others]}
    return one


def _inspect(
    cause: Mapping[str, Any] | None, judgement: Judgement, bundle: Bundle, unlike: str
) -> str:
    if unlike and (cause is None or lies_outside(cause)):
        return UNLIKE.format(unlike)
    if cause is None:
        if _smoother(judgement, bundle):
            return (
                "Check the filters of drive and log before the gear: the current's fluctuations "
                "have become smaller, which wear does not do."
            )
        return GEAR if judgement.state == "fault" else AGAIN
    meaning = cause.get("interpretation") or cause.get("effect")
    outside = lies_outside(cause)
    little = excuses_little(cause) if outside else explains_little(cause)
    if little:
        hardly = float(cause.get("share", 1.0)) < SMALLEST_PART
        return f"{GEAR} {(HARDLY_ANY if hardly else SMALLER_PART).format(meaning)}"
    return f"Check before the gear: {meaning}." if outside else f"Inspect the joint for {meaning}."


def _smoother(judgement: Judgement, bundle: Bundle) -> bool:
    """Whether the spectrum speaks loudest, and most of the fluctuations have become smaller."""
    known = {name: p for name, p in judgement.witnesses.items() if math.isfinite(p)}
    loudest = bundle.witnesses.get(min(known, key=known.__getitem__, default=""))
    if not isinstance(loudest, SpectrumEvidence):
        return False
    return typical_ratio(loudest.cells, loudest.n_baseline) < SMOOTHER


def _evidence(judgement: Judgement, bundle: Bundle, unit: str) -> list[str]:
    strongest = sorted(
        (_is_slight(bundle.witnesses.get(name)), p, name)
        for name, p in judgement.witnesses.items()
        if math.isfinite(p)
    )
    said = [_of_witness(name, judgement, bundle, unit) for *_, name in strongest]
    return [text for text in said if text][:MOST_EVIDENCE]


def _is_slight(witness: object) -> bool:
    if not isinstance(witness, AmplitudeEvidence):
        return False
    size = clearest_amplitude(witness.cells, witness.n_baseline)
    return size is not None and abs(size.ratio - 1) < SLIGHT


def _of_witness(name: str, judgement: Judgement, bundle: Bundle, unit: str) -> str | None:
    effect, p = judgement.effects.get(name, math.nan), judgement.witnesses[name]
    by = f"p {p:.2g}" if p >= 1e-4 else "p < 0.0001"
    if name == PATTERNS:
        if not effect > 0:
            return None
        motion = bundle.cells[int(effect_by_cell(bundle.cells).argmax())].motion
        return f"The {called(unit)}'s patterns changed by {effect:.0%} in motion {motion} ({by})."
    witness = bundle.witnesses.get(name)
    if isinstance(witness, SpectrumEvidence):
        band = clearest_change(witness.cells, witness.n_baseline)
        if band is None:
            return None
        return (
            f"Fluctuations near {band.frequency_hz:.3g} Hz are {band.size_ratio:.2g} times as "
            f"large in motion {band.motion}, {band.start:.0%} to {band.stop:.0%} ({by})."
        )
    if isinstance(witness, ProfileEvidence):
        part = clearest_course(witness.cells, witness.n_baseline)
        if part is None:
            return None
        return (
            f"The mean {called(unit)} is {part.change_a:+.2g} {unit} off in motion {part.motion}, "
            f"{part.start:.0%} to {part.stop:.0%}; its size {part.scale:.2f} times ({by})."
        )
    if isinstance(witness, AmplitudeEvidence):
        size = clearest_amplitude(witness.cells, witness.n_baseline)
        if size is None:
            return None
        return (
            f"The {called(unit)}'s {size.size} is {size.ratio:.2f} times the baseline's in motion "
            f"{size.motion} ({by})."
        )
    return None


def _against(judgement: Judgement, cause: Mapping[str, Any] | None, in_vain: bool) -> str:
    n = judgement.n_baseline_sessions
    others = () if cause is None else cause.get("others", ())
    if cause is not None and IN_THE_SUM in cause.get("evidence", ()):
        return "A gear's fault leaves what the three phases add up to as it was." + _besides(others)
    if cause is not None and IN_SPIKES in cause.get("evidence", ()):
        return "A gear's fault lasts for more than one sample." + _besides(others)
    if cause is not None and cause.get("effect") == SENSOR_NOISE:
        return "A gear's fault shows in motion alone: the noise is there at standstill, too."
    if cause is not None and cause.get("effect") == CURRENT_LAG:
        return (
            "A gear's fault bends the current's course; this one is moved in time as a whole "
            f"({cause['share']:.0%} of the change)." + _besides(others)
        )
    if any(one["effect"] == SENSOR_NOISE for one in others):
        return "The current fluctuates more at standstill, too: check its sensor and cable as well."
    if n < FEW_SESSIONS:
        return (
            f"Only {n} baseline session{'' if n == 1 else 's'}: how much healthy ones differ is "
            "hardly known."
        )
    common = math.exp(judgement.common_log_ratio)
    # what moved all alike would not have moved one by far the most
    if common >= COMMON and judgement.distance_ratio < BEYOND_COMMON * common:
        return (
            f"The other joints moved too, {common:.2g} times as far as usual: temperature, supply, "
            "payload?"
        )
    if cause is not None and explains_little(cause):
        return "The named cause explains less than half of the change."
    if _tie(cause):
        return ""
    if in_vain:
        again = ": repeat under the baseline's conditions" if judgement.state == "fault" else ""
        return f"No effect of the library explains it{again}."
    return (
        "Another payload, program, gain or temperature looks alike: repeat under the same "
        "conditions."
    )


def _tie(cause: Mapping[str, Any] | None) -> str:
    """Name the nearest of what a cause may be instead, unless the sensors prove it."""
    known = cause or {}
    if not known.get("ties") or not OF_SENSORS.isdisjoint(known.get("evidence", ())):
        return ""
    return f"The recordings cannot tell it from: {effect_in_words(known['ties'][0])}."


def _besides(others: Sequence[Mapping[str, Any]]) -> str:
    return f" Besides: {others[0]['interpretation']}." if others else ""
