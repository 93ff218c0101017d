"""The sentences of a loop, the same in the terminal and on the page."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from opamc_cli.stages.report.wording.numbers import effect_phrase, number

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

SAMPLE_BY_SAMPLE = 2.0
"""Times as much is far of an error that counts corners as they were logged: of 78 joints that are
`closed`, or rightly lack nothing, it is 3.7 times the noise at most, with backlash 9 and 12."""


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
    far = far_from_noise(entry) if entry.get("steps") else None
    reasons = entry.get("fails"), _sealed_apart(entry), far, _unconfirmed(entry)
    return [why for why in reasons if why]


def far_from_noise(entry: Mapping[str, Any]) -> str | None:
    """Return that far more than noise is left where nothing else says that more lacks, if it is.

    That is where nothing else was found missing, and where what can be explained is not known.

    Parameters
    ----------
    entry
        One object of loop.json's `axes`.
    """
    noise, after = entry.get("noise_a"), entry.get("after") or {}
    ended = entry.get("verdict") in ("closed", "nothing-missing")
    ended |= entry.get("verdict") == "partial" and not ceiling_known(entry)
    if not (ended and noise):
        return None
    left, logged = (after.get(key) or 0.0 for key in ("rmse_a", "as_logged_a"))
    how = ""
    if left <= FAR_ABOVE_NOISE * noise:
        left, how = logged, "sample by sample "
        if left <= SAMPLE_BY_SAMPLE * FAR_ABOVE_NOISE * noise:
            return None
    unit = entry.get("unit", "A")
    return (
        f"{how}{left / noise:.0f} times the noise between samples ({noise:.2g} {unit}) are left, "
        "which nothing here explains"
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
