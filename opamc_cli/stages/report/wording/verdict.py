"""The sentences of a verdict, the same in the terminal and on the page."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from opamc_cli.stages.report.wording.numbers import effect_phrase
from opamc_cli.stages.verdict.wording.brief import foremost
from opamc_cli.stages.verdict.wording.reasons import (
    CHECK_FIRST,
    FOUND,
    INSPECT,
    effect_in_words,
    excuses_little,
    lies_outside,
)
from opamc_cli.storage.schemas.channels import axes_phrase

STATE_ORDER = ("fault", "changed", "insufficient-data", "healthy")


def by_state(verdict: Mapping[str, Any]) -> dict[str, list[int]]:
    """Return the axes of each state, worst state first, without empty ones."""
    axes = verdict.get("axes", ())
    return {
        state: found
        for state in STATE_ORDER
        if (found := [int(a["axis"]) for a in axes if a.get("state") == state])
    }


def day_span(side: Mapping[str, Any]) -> str | None:
    """Return the days of a side's recordings, None where they are not known.

    Parameters
    ----------
    side
        The verdict's `baseline` or `target`.
    """
    days = [str(side[key])[:10] for key in ("from", "to") if side.get(key)]
    return " to ".join(dict.fromkeys(days)) or None


def headline(verdict: Mapping[str, Any]) -> str:
    """Return the verdict in one sentence."""
    excused = [int(a["axis"]) for a in verdict.get("axes", ()) if a.get("excused")]
    states = by_state(verdict)
    healthy = [axis for axis in states.pop("healthy", ()) if axis not in excused]
    states |= {name: axes for name, axes in (("excused", excused), ("healthy", healthy)) if axes}
    phrases = {
        "fault": "at fault",
        "changed": "changed",
        "insufficient-data": "not judged",
        "excused": "not told from unusual conditions",
        "healthy": "healthy",
    }
    parts = [f"{axes_phrase(axes)} {phrases[state]}" for state, axes in states.items()]
    first = (foremost(verdict.get("axes", ())) or {}).get("axis")
    several = len([*states.get("fault", ()), *states.get("changed", ())]) > 1
    for place, axes in enumerate(states.values()):
        if several and first in axes:
            named = f"axis {first}: " if len(axes) > 1 else ""
            parts[place] += f" ({named}look there first)"
    if not parts:
        return "No axis was judged"
    if len(healthy) > 1 and len(parts) > 1:
        parts[-1] = f"the other {len(healthy)} axes healthy"
    text = "; ".join(parts)
    return text[0].upper() + text[1:]


def chance_phrase(entry: Mapping[str, Any], n_axes: int) -> str:
    """Return how likely chance alone would do it, "less than 1 in 10 000" at the least.

    Parameters
    ----------
    entry
        One object of the verdict's `axes`.
    n_axes
        Joints that were judged beside each other.
    """
    p = entry.get("p_adjusted", entry.get("p_value"))
    if not isinstance(p, int | float) or not math.isfinite(p):
        return "by chance: not known"
    if p < 1e-4:
        likely = "less than 1 in 10\u00a0000"
    elif p < 0.1:
        odds = float(f"{1 / p:.2g}")
        likely = f"about 1 in {odds:,.0f}".replace(",", "\u00a0")
    else:
        likely = f"{p:.0%}"
    return f"by chance: {likely}" + (", all joints considered" if n_axes > 1 else "")


def distance_phrase(entry: Mapping[str, Any]) -> str | None:
    """Return how far a joint is from its baseline, None where that is not known.

    Parameters
    ----------
    entry
        One object of the verdict's `axes`.
    """
    ratio = (entry.get("distance") or {}).get("ratio")
    if not isinstance(ratio, int | float) or not math.isfinite(ratio):
        return None
    times = f"{ratio:.0f}" if ratio >= 10 else f"{ratio:.2g}"
    return f"differs {times} times as much as healthy recordings differ among themselves"


def share_phrase(cause: Mapping[str, Any]) -> str | None:
    """Return what a cause leaves unexplained."""
    share = cause.get("explained", cause.get("share"))
    if not isinstance(share, int | float) or isinstance(share, bool):
        return None
    left = f"{max(1 - share, 0.0):.0%}"
    unexplained = "" if left == "0%" else f"; {left} remains unexplained"
    return f"explains {share:.0%} of the change{unexplained}"


def inspection(entry: Mapping[str, Any]) -> str | None:
    """Return what to look at first.

    Parameters
    ----------
    entry
        One object of the verdict's `axes`.
    """
    state, cause = entry.get("state"), entry.get("cause")
    if state not in ("changed", "fault"):
        return None
    if not cause:
        return INSPECT
    meaning, told, action = _meaning(cause)
    first = action[:1].upper() + action[1:] if told else f"Look for {meaning}"
    if lies_outside(cause):
        if excuses_little(cause):
            return INSPECT
        return f"{first}; do that before opening the gear."
    return (
        f"{first}; after that the rest of the strain wave gear, brake, motor connector and "
        "current sensor."
    )


def likely_cause(entry: Mapping[str, Any]) -> list[str]:
    """Return what probably changed, how much of it that explains, and what it may be instead.

    Parameters
    ----------
    entry
        One object of the verdict's `axes`.
    """
    cause = entry.get("cause")
    if not cause:
        return []
    by = f", by {effect_phrase(cause)}" if cause.get("parameters") else ""
    named = f"{_meaning(cause)[0]}{by}"
    told = [share_phrase(cause) or ""]
    ties = [str(tie) for tie in cause.get("ties", ())]
    if ties:
        told.append(f"the recordings cannot tell it from {', '.join(map(effect_in_words, ties))}")
    return [named[:1].upper() + named[1:], *(each for each in told if each)]


def _meaning(cause: Mapping[str, Any]) -> tuple[str, bool, str]:
    """Return what a cause means, whether its reading says what to do, and that."""
    text = str(cause.get("interpretation") or cause.get("effect"))
    meaning, mark, action = text.rpartition(": ")
    return (meaning, True, action) if mark else (text, False, "")


def said_elsewhere(entry: Mapping[str, Any]) -> set[str]:
    """Return the reasons of a joint that its card says under another heading.

    Parameters
    ----------
    entry
        One object of the verdict's `axes`.
    """
    cause = entry.get("cause") or {}
    meaning = cause.get("interpretation") or cause.get("effect")
    fixed = {FOUND.format(meaning), CHECK_FIRST.format(meaning), INSPECT}
    return fixed | {str(why) for why in cause.get("why", ())}


def advice(entry: Mapping[str, Any]) -> str | None:
    """Return what to do about an axis where its reasons do not already say it.

    Parameters
    ----------
    entry
        One object of the verdict's `axes`.
    """
    cause = entry.get("cause") or {}
    for key in ("inspect", "action", "advice"):
        if cause.get(key):
            return str(cause[key])
    if entry.get("reasons"):
        return None
    return {
        "fault": "Inspect the strain wave gear of this axis.",
        "changed": "Check payload, program and temperature of this axis against the baseline's.",
        "insufficient-data": "Record more cycles of this axis and diagnose again.",
    }.get(str(entry.get("state")))


def shared_reasons(entries: Sequence[Mapping[str, Any]]) -> dict[str, list[int]]:
    """Return the reasons that several axes have in common, with these axes, in their order.

    Parameters
    ----------
    entries
        Objects of the verdict's `axes`.
    """
    axes: dict[str, list[int]] = {}
    for entry in entries:
        for reason in entry.get("reasons", ()):
            axes.setdefault(str(reason), []).append(int(entry["axis"]))
    return {reason: found for reason, found in axes.items() if len(found) > 1}
