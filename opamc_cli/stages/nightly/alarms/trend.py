"""Where a joint that has changed is heading, in numbers and in words."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from opamc_cli.decision.trend.chart import usual_nights
from opamc_cli.decision.trend.median import median
from opamc_cli.decision.trend.slope import (
    NORMAL_90,
    NORMAL_999,
    Slope,
    is_step,
    later_half,
    nights_until,
    robust_slope,
    slope_of_spread,
)
from opamc_cli.decision.trend.temperature import without_temperature
from opamc_cli.stages.nightly.alarms.course import days, distances

LEAP = math.log(2.0)
"""Growth of the log distance a night beyond which it is a step: a sensor's noise that grew in one
night was said to grow "by 16850 % a night"."""

FALLEN = 0.5
"""Of the fault level: an effect below is no weather about a level that is at fault."""

MOST_AHEAD = 10
"""Times as late as the earliest night: "in 4 to 190 nights" tells nobody when to plan."""


def trend_of(
    rows: Sequence[Mapping[str, Any]], since: str, fault_effect: float, baseline_nights: int
) -> dict[str, Any]:
    """Return how fast a joint's effect and distance grow since a night, and when it is at fault.

    Whether it grows is the distance's to say: the effect is the largest of what several witnesses
    see, and moves with each of them. Empty with too few nights.
    """
    changed = np.array([row["night"] >= since for row in rows], dtype=np.bool_)
    healthy = np.array([row["state"] == "healthy" for row in rows], dtype=np.bool_)
    warmth = np.array([row["temperature_c"] for row in rows], dtype=np.float64)
    logged = warmth[np.isfinite(warmth)]
    usual = median(logged) if logged.size else math.nan
    effects, log_distances = np.array([row["effect"] or 0.0 for row in rows]), distances(rows)
    nights = days(rows)[changed]
    own = [
        without_temperature(nights, course[changed], warmth[changed], usual)
        for course in (effects, log_distances)
    ]
    centre, spread = usual_nights(log_distances[healthy & ~changed], baseline_nights)
    rough = robust_slope(nights, own[1]) or slope_of_spread(nights, own[1], spread)
    step = rough is not None and is_step(rough, centre, spread, float(nights[-1] - nights[0]))
    # nights that follow a step grow by chance as others do, and nobody awaits it of them
    sure = NORMAL_999 if step else NORMAL_90
    effect, distance = (robust_slope(nights, course, sure) for course in own)
    if effect is None or distance is None or not math.isfinite(effect.low + distance.low):
        few = slope_of_spread(nights, log_distances[changed], spread, sure)
        if few is None or not (few.clear or (step and distance is not None)):
            return {}
        reached = median(effects[changed][-3:]) >= fault_effect
        return {"distance": _rounded(few), "reach": [0, 0] if reached else None, "step": step}
    lately = robust_slope(later_half(nights), later_half(own[0]), sure)
    reach = nights_until(effect, fault_effect, lately)
    return {
        "per_night": round(effect.per_night, 6),
        "low": round(effect.low, 6),
        "high": round(effect.high, 6),
        "level": round(effect.level, 6),
        "distance": _rounded(distance),
        "reach": None if reach is None else [math.floor(reach[0]), math.ceil(reach[1])],
        "step": step,
    }


def _rounded(slope: Slope) -> list[float]:
    return [round(one, 6) for one in (slope.per_night, slope.low, slope.high)]


def trend_phrase(
    trend: Mapping[str, Any], limit: float, reached: bool = False, fallen: bool = False
) -> str:
    """Say where a joint is heading: its effect may move with the weather, its distance less.

    Of a night whose own effect has `reached` the limit nothing says when it will; one that has
    `fallen` far below it is not at fault, wherever the nights before it lie.
    """
    if not trend:
        return "too few nights for a trend"
    reach, level = trend["reach"], f"the fault level of {limit:.0%}"
    farther = "a step, no trend since" if trend.get("step") else "no trend"
    if trend["distance"][1] > LEAP:
        farther = "distance from the baseline has leapt"
    elif trend["distance"][1] > 0:
        usual, least, most = (_percent(one) for one in trend["distance"])
        farther = f"distance from the baseline grows by {usual} % ({least} to {most}) a night"
    if reach != [0, 0] and reached:
        return f"now beyond {level}, {farther}"
    if reach == [0, 0] and fallen:
        return f"was beyond {level} before, not in this night"
    if reach == [0, 0]:
        grows = farther
        if trend.get("low", 0) > 0:
            grows = f"grows by {100 * trend['per_night']:.2g} points a night"
        return f"{'' if reached else 'in most nights '}beyond {level}, {grows}"
    if reach is None:
        why = "the change too unevenly" if "level" in trend else "too few nights"
        unsure = f", {why} to say when it reaches {level}"
        return farther + (unsure if trend["distance"][1] > 0 else "")
    soon, late = reach
    when = f"{soon} to {late} nights"
    if late > MOST_AHEAD * max(soon, 1):
        when = f"{max(soon, 1)} night{'s' * (soon > 1)} at the earliest"
    usual, least, most = (100 * trend[of] for of in ("per_night", "low", "high"))
    return (
        f"change grows by {usual:.2g} ({least:.2g} to {most:.2g}) points a night, reaches {level} "
        f"in {when}"
    )


def _percent(log_ratio: float) -> str:
    percent = 100 * math.expm1(log_ratio)
    return f"{percent:.{1 if abs(percent) < 10 else 0}f}"
