"""The sentences of a verdict, the same in the terminal and on the page."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from opamc_cli.stages.recordings.sessions import started
from opamc_cli.stages.verdict.brief import by_far
from opamc_cli.stages.verdict.reasons import (
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
    most = (by_far(verdict.get("axes", ())) or {}).get("axis")
    for place, axes in enumerate(states.values()):
        if most in axes:
            named = f"axis {most} " if len(axes) > 1 else ""
            parts[place] += f" ({named}by far the most: look there first)"
    if not parts:
        return "No axis was judged"
    if len(healthy) > 1 and len(parts) > 1:
        parts[-1] = f"the other {len(healthy)} axes healthy"
    text = "; ".join(parts)
    return text[0].upper() + text[1:]


def number(value: object, digits: int = 3) -> str:
    """Return a number in few digits, or a dash where there is none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}g}"
    if "e" in text:
        mantissa, _, exponent = text.partition("e")
        text = f"{mantissa}e{int(exponent)}"
    return text.replace("-", "−")


def p_value(value: object) -> str:
    """Return a p-value as it is usually printed: not smaller than "< 0.0001"."""
    if not isinstance(value, int | float) or not math.isfinite(value):
        return "–"
    return "< 0.0001" if value < 1e-4 else f"{value:.2g}"


def p_phrase(value: object) -> str:
    """Return what follows the letter p in a sentence."""
    text = p_value(value)
    return {"–": "unknown"}.get(text, text if text.startswith("<") else f"= {text}")


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


def moment(iso: str) -> str:
    """Return an ISO 8601 time as "2026-03-10 06:00 UTC", or as it is if it is not one."""
    time = started(iso)
    return iso if time is None else f"{time:%Y-%m-%d %H:%M} UTC"


def cause_phrase(cause: Mapping[str, Any] | None) -> str:
    """Return a cause in one phrase: effect, its parameters, meaning and share."""
    if not cause:
        return "–"
    text = str(cause.get("effect", cause.get("name", "unnamed")))
    parameters = cause.get("parameters")
    if isinstance(parameters, Mapping):
        shown = [_parameter(k, v) for k, v in sorted(parameters.items(), key=_order_first)]
        if any(shown):
            text += f" ({', '.join(part for part in shown if part)})"
    if cause.get("interpretation"):
        text += f": {cause['interpretation']}"
    share = cause.get("share")
    if isinstance(share, int | float) and not isinstance(share, bool):
        text += f"; explains {100 * share:.0f} % of the change"
    return text


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


LEAST_CEILING = 0.02
"""Share of the mean square below which the verdict takes a ceiling for none, and words do."""


def ceiling_known(entry: Mapping[str, Any]) -> bool:
    """Return whether functions without a name tell how much of a joint can be explained."""
    ceiling = entry.get("ceiling") or {}
    error = float(ceiling.get("standard_error", 0.0))
    return float(ceiling.get("share", 0.0)) > max(2 * error, LEAST_CEILING)


def ceiling_phrase(entry: Mapping[str, Any]) -> str:
    """Return how much of a joint's error functions without a name explain, or that it is not known.

    Where a name was found that they do not hold, or two standard errors span all shares that there
    are, they tell nothing of what there is to explain.

    Parameters
    ----------
    entry
        One object of loop.json's `axes`.
    """
    share, error = (entry["ceiling"][key] for key in ("share", "standard_error"))
    if 2 * error >= 1 or (entry["steps"] and not ceiling_known(entry)):
        return "ceiling not known"
    return (
        f"ceiling {share:.0%} ± {error:.0%} of the mean square, floor {entry['floor_a']:.4g} "
        f"{entry['unit']}"
    )


MORE_THAN_NOISE = math.sqrt(2)
"""Times the noise between samples, from which on most of the mean square is something else. Of 20
simulated joints that lack nothing 16 leave 0.97 to 1.38 times, one 2.2 (corners of its motion) and
three 2.6 to 3.7 (slow noise); one whose drag comes and goes 1.8."""
FAR_ABOVE_NOISE = 3.0
"""Likewise: how the motion was logged comes first. A measured arm's joints leave 1.2 to 3.5 times
where one moves alone; 4 to 16 times in programs of two seconds in which its neighbours push it."""


def beyond_noise(entry: Mapping[str, Any], times: float = MORE_THAN_NOISE) -> float | None:
    """Return what is left beyond the noise where nothing was found missing.

    Parameters
    ----------
    entry
        One object of loop.json's `axes`.
    times
        None is returned below so many times the noise, and where something was found.
    """
    noise, left = entry.get("noise_a"), (entry.get("before") or {}).get("rmse_a")
    if entry.get("verdict") != "nothing-missing" or noise is None or left is None:
        return None
    return math.sqrt(max(left**2 - noise**2, 0.0)) if left > times * noise else None


SEALED_APART = 1.5
"""Times the error of the data that were searched. 59 of 60 simulated joints have 0.7 to 1.3, one
whose friction steps once 1.8; 20 measured ones 0.7 to 1.5."""


def unreliable(entry: Mapping[str, Any]) -> list[str]:
    """Return why what was found of a joint may not hold, each in a sentence without its stop.

    Parameters
    ----------
    entry
        One object of loop.json's `axes`.
    """
    # of nothing missing the headline says it
    far = far_from_noise(entry) if entry.get("verdict") == "closed" else None
    reasons = entry.get("fails"), _sealed_apart(entry), far, _unconfirmed(entry)
    return [why for why in reasons if why]


def far_from_noise(entry: Mapping[str, Any]) -> str | None:
    """Return that a loop of which no more is said to lack leaves far more than noise, if it does.

    Parameters
    ----------
    entry
        One object of loop.json's `axes`.
    """
    noise, left = entry.get("noise_a"), (entry.get("after") or {}).get("rmse_a")
    whole = entry.get("verdict") in ("closed", "nothing-missing")
    if not whole or not noise or not left or left <= FAR_ABOVE_NOISE * noise:
        return None
    unit = entry.get("unit", "A")
    return (
        f"{left / noise:.0f} times the noise between samples ({noise:.2g} {unit}) are left, which "
        "nothing here explains"
    )


def _unconfirmed(entry: Mapping[str, Any]) -> str | None:
    gains = {one.get("effect"): one.get("gain", 0.0) for one in entry.get("rejected", ())}
    names = dict.fromkeys(entry.get("unconfirmed", ()))
    told = [f"{n} ({gains.get(n, 0.0):.0%} of the error)" for n in names]
    if not told:
        return None
    return (
        f"the data that were searched show {' and '.join(told)}, the sealed ones do not: record "
        "more motion to tell"
    )


def _sealed_apart(entry: Mapping[str, Any]) -> str | None:
    """Return that the sealed data are explained far worse than those searched, where they are."""
    after = entry.get("after") or {}
    sealed, searched = after.get("rmse_a"), after.get("searched_rmse_a")
    if not sealed or not searched or entry.get("fails") or sealed <= SEALED_APART * searched:
        return None
    return (
        f"the sealed data are left with {sealed / searched:.1f} times the error of those searched: "
        "something changes between them, or they move in another way"
    )


def without_name(steps: Sequence[Mapping[str, Any]]) -> str:
    """Return the functions without a name among a loop's steps, in few words; "" if none is."""
    said = [
        str(step.get("interpretation") or "").split(";")[0].split(":")[0]
        for step in steps
        if str(step.get("effect")).startswith("unnamed")
    ]
    of = [told.removeprefix(FUNCTION) for told in dict.fromkeys(said) if told.startswith(FUNCTION)]
    rest = [told for told in dict.fromkeys(said) if told and not told.startswith(FUNCTION)]
    functions = (
        f"functions of {', of '.join(of)}" if len(of) > 1 else "".join(FUNCTION + x for x in of)
    )
    return ", ".join(part for part in (functions, *rest) if part)


FUNCTION = "a function of "


def loop_phrase(entry: Mapping[str, Any]) -> str:
    """Return the loop's verdict on one joint in plain words."""
    if beyond_noise(entry) is not None:
        return (
            "nothing known is missing, and most of the error is neither explained nor noise "
            "between samples"
        )
    verdict = entry.get("verdict")
    return {
        "nothing-missing": "nothing worth naming is missing",
        "closed": "closed: the effects added explain what the declared ones left over",
        "partial": "partly closed: effects were added, and something reproducible is left over",
        "not-in-library": "something reproducible is left over that no effect in the library fits",
    }.get(str(verdict), str(verdict))


def _order_first(item: tuple[str, object]) -> tuple[bool, str]:
    return item[0] != "order", item[0]


def _parameter(name: str, value: object) -> str:
    # a ripple's switches: whether its amplitude and phase depend on this
    if name in ("speed", "direction", "load", "current") and value in (0, 1):
        return f"varies with {name}" if value else ""
    if name == "answer":
        return f"the drive's answer, {_plain(value)} filters per octave" if value else ""
    return f"{name} {_plain(value)}"


def _plain(value: object) -> str:
    return number(value, 4) if isinstance(value, int | float) else str(value)


def loop_headline(loop: Mapping[str, Any]) -> str:
    """Return what the loop found on all its axes in one sentence."""
    parts = []
    for entry in loop.get("axes", ()):
        added = len(entry.get("steps", ()))
        noun = "effect" if added == 1 else "effects"
        parts.append(
            f"model of axis {entry.get('axis')}: {entry.get('verdict')}, {added} {noun} added"
        )
    text = "; ".join(parts) or "no axis was modelled"
    return text[0].upper() + text[1:]


def experiments(entry: Mapping[str, Any]) -> list[str]:
    """Return the experiments that would separate what a loop could not tell apart.

    Parameters
    ----------
    entry
        One object of loop.json's `axes`.
    """
    return [
        f"To tell {step.get('effect')} from {', '.join(step.get('ties', ()))}: "
        f"{step['separating_experiment']}"
        for step in entry.get("steps", ())
        if step.get("separating_experiment")
    ]


STEP_COLUMNS = (
    "gain: what the effect takes off the squared error of data left out of the fit, beside all "
    "that had a name when it was judged (a function without a name: beside the steps above it); "
    "before, after: error of the data that were searched, step by step"
)
"""What stands in a table of steps."""


def effect_phrase(step: Mapping[str, Any]) -> str:
    """Return a step's effect with its parameters."""
    return cause_phrase(
        {"effect": step.get("effect", "unnamed"), "parameters": step.get("parameters")}
    )


def set_aside(item: object) -> str:
    """Return a rejected or untestable effect with the reason, in whatever form it comes."""
    if not isinstance(item, Mapping):
        return str(item)
    reason = next((item[key] for key in ("why", "reason") if item.get(key)), None)
    text = effect_phrase(item)
    return f"{text}: {reason}" if reason else text


def remains(entry: Mapping[str, Any]) -> str:
    """Return what a loop left unexplained, in one sentence.

    Parameters
    ----------
    entry
        One object of loop.json's `axes`.
    """
    unit = entry.get("unit", "A")
    after = (entry.get("after") or {}).get("rmse_a")
    floor = entry.get("floor_a")
    share = entry.get("explained_share")
    parts = []
    if isinstance(after, int | float):
        parts.append(f"the sealed error is {number(after)} {unit}")
    unknown = bool(entry.get("steps")) and not ceiling_known(entry)
    if isinstance(floor, int | float) and not unknown:
        parts.append(f"functions without a name leave {number(floor)} {unit}")
    if unknown:
        closed = entry.get("verdict") == "closed"
        parts.append("it is noise" if closed else "how much can be explained is not known")
    elif isinstance(share, int | float) and beyond_noise(entry) is None and not entry.get("fails"):
        parts.append(f"{100 * share:.0f} % of what could be explained is explained")
    domains = [
        str(item.get("domain", item)) if isinstance(item, Mapping) else str(item)
        for item in entry.get("remains", ())
    ]
    if domains:
        parts.append(f"what is left has structure over {', '.join(domains)}")
    parts += unreliable(entry)
    text = "; ".join(parts) or "loop.json does not say"
    return text[0].upper() + text[1:] + "."
