"""Why a joint is judged as it is, in a maintainer's words."""

import math
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from opamc_cli.config.models import ScoreConfig
from opamc_cli.decision.judge import PATTERNS, UNKNOWN_CHANGE, Bundle, Judgement
from opamc_cli.decision.witnesses.amplitudes import AmplitudeEvidence, clearest_amplitude
from opamc_cli.decision.witnesses.patterns import Cell, effect_by_cell
from opamc_cli.decision.witnesses.profiles import ProfileEvidence, clearest_course
from opamc_cli.decision.witnesses.spectra import SpectrumEvidence, clearest_change
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.stages.recordings.sessions import started
from opamc_cli.storage.sources import RunSource, current_unit

UNUSUAL = 1.0
"""An e-fold: from there on two spreads or more of a healthy session are allowed for."""

INSPECT = (
    "Inspect the joint's strain wave gear first: backlash by hand with the motor held, flexspline "
    "and circular spline teeth, wave generator bearing, grease; then brake, motor connector and "
    "current sensor."
)
FOUND = (
    "It looks like {}. After that look at the rest of the strain wave gear, brake, motor connector "
    "and current sensor."
)
REPEAT = (
    "Repeat the recording under the baseline's conditions before taking the joint apart: the "
    "current shows an effect, not the part that is worn."
)
NOTABLY = 1.05
"""Times as far as usual, below which nothing was allowed for: "1 times as far" tells nobody."""

COMMON = 1.5
"""Times as far as usual that the siblings have moved, to be worth a word."""

ALONE = (
    "No temperature was logged, and most other joints have moved no farther than usual, as they "
    "would in a warmer or colder hall: look for what warms or cools this joint alone, too."
)
SUSPICION = 0.1
"""P-value from which a healthy joint is asked for a cause; corrected for the number of joints, from
which it is said to be worth an eye."""

LEAST_SAID = 0.01
"""Change of all of a current that is told: 0 % beside a place that fell to a seventh is absurd."""

TAUGHT = "taught_points"
"""What another path is called that the program leads along: no effect of a joint is it either."""

SENSOR_NOISE = "sensor_noise"
"""What a cause is called that no effect of a joint is: it is there while the joint stands still."""

CURRENT_LAG = "current_lag"
"""And one that moves all of the current in time against the position."""

AT_REST, IN_THE_SUM, IN_SPIKES = "times_at_rest", "times_in_the_sum", "times_in_spikes"
OF_SENSORS = {AT_REST, IN_THE_SUM, IN_SPIKES}
"""In a sensor's evidence: by how much what no gear moves has grown with it, the current's
fluctuation at standstill, what the three phases add up to, or single samples that leap."""

SMALLER_PART = "A smaller part of the change is {}."
CHECK_FIRST = (
    "It looks like {}. Check that before the gear, and record a new baseline if it is meant to "
    "stay."
)
IN_VAIN = (
    "A cause was sought: no effect of the library explains the change (play in the gear and blows "
    "of a bearing have none of their own there)."
)
CANNOT_TELL = (
    "The current says that the torque has changed, not what changed it: another payload, "
    "program, controller gain or temperature changes it too. Repeat the recording under the "
    "baseline's conditions before taking the joint apart."
)


def reasons(
    judgement: Judgement,
    bundle: Bundle,
    motions: Sequence[Mapping[str, Any]],
    sources: Mapping[str, Sequence[RunSource]],
    cause: Mapping[str, Any] | None = None,
    limits: ScoreConfig | None = None,
    *,
    in_vain: bool = False,
    siblings: int = 0,
    warmer_c: float | None = None,
) -> list[str]:
    """Sentences that explain one joint's state.

    Parameters
    ----------
    judgement, bundle
        The decision, and what it was made from.
    motions
        Entries `motions` of the verdict.
    sources
        Recordings of "baseline" and "target" in which the axis moves.
    cause
        The cause found for the change, if any.
    limits
        What a change has to exceed; None: the defaults.
    in_vain
        Whether a cause was sought, and none found.
    siblings
        How many other joints of the robot were judged.
    warmer_c
        By how much the log says that it was warmer than ever in the baseline, if it does.

    Returns
    -------
    list of str
        What changed and by how much, how sure that is, against what, what to inspect, and what
        it cannot tell.
    """
    cells = bundle.cells
    if judgement.state == "insufficient-data":
        return [*_missing(judgement, cells), *_short(cells)]
    unhealthy = judgement.state != "healthy"
    unit = current_unit(chain(*sources.values()))
    sentences = [
        *_change(judgement, bundle, motions, limits or ScoreConfig(), unit, warmer_c),
        _certainty(judgement),
        _rest(judgement, sources),
        *_siblings(judgement),
        *_conditions(judgement),
    ]
    if unhealthy and cause is not None:
        meaning = cause.get("interpretation") or cause.get("effect")
        outside = lies_outside(cause)
        known = [CHECK_FIRST] if outside else [FOUND, REPEAT]
        if outside and excuses_little(cause):
            known = [SMALLER_PART]
        sentences += [*cause.get("why", []), *(text.format(meaning) for text in known)]
        of_hall = cause.get("origin") == "environment" and not cause.get("parameters")
        if of_hall and siblings > 1 and math.exp(judgement.common_log_ratio) < COMMON:
            sentences += [ALONE]
        if outside and judgement.state == "fault" and not before_the_gear(cause):
            sentences += [INSPECT]  # it does not explain enough
    elif unhealthy:
        sentences += [*[IN_VAIN] * in_vain, INSPECT, CANNOT_TELL]
    return [*sentences, *_short(cells)]


def is_excused(judgement: Judgement, limits: ScoreConfig) -> bool:
    """Tell whether a joint that would be unhealthy is called healthy: the others differ, too."""
    differs = judgement.p_adjusted <= limits.false_alarm_rate
    return differs and judgement.state == "healthy" and judgement.effect >= limits.minimum_effect


def is_suspect(judgement: Judgement) -> bool:
    """Tell whether a healthy joint lies so far out that it is asked what has changed in it."""
    return judgement.state == "healthy" and judgement.p_value <= SUSPICION


def effect_in_words(name: str) -> str:
    """Say to a maintainer what an effect is; what is none of the library is said as it stands.

    Examples
    --------
    >>> effect_in_words("coulomb"), effect_in_words("kinematic error, twice a turn")
    ('dry friction of bearings and seals', 'kinematic error, twice a turn')
    """
    known = built_in_library().get(name)
    return name.replace("_", " ") if known is None else known.meaning.partition(": ")[0]


def lies_outside(cause: Mapping[str, Any]) -> bool:
    """Tell whether a cause of verdict.json is no fault of the joint: load, environment, sensors."""
    return bool(cause.get("harmless")) or cause.get("origin", "joint") != "joint"


def before_the_gear(cause: Mapping[str, Any]) -> bool:
    """Tell whether a cause excuses nothing, and is looked for first all the same."""
    own = cause.get("effect") in (SENSOR_NOISE, CURRENT_LAG)
    return own or IN_THE_SUM in cause.get("evidence", ())


def logged(warmer_c: float | None) -> str:
    """Return in brackets what a log says of a joint's temperature, where that is unusual."""
    if not warmer_c:
        return ""
    return f" (logged: {abs(warmer_c):.0f} °C {'warmer' if warmer_c > 0 else 'colder'})"


def excuses_little(cause: Mapping[str, Any]) -> bool:
    """Tell whether a cause outside the joint holds too little to look there before the gear.

    With a fault beside it, or less than half of the change by harmless causes, it is not harmless.
    What is `before_the_gear` excuses nothing, but is to be looked for first.
    """
    if before_the_gear(cause):
        return False
    return explains_little(cause) or not cause.get("harmless")


def explains_little(cause: Mapping[str, Any]) -> bool:
    """Tell whether a cause of verdict.json holds less than half of the change."""
    return float(cause.get("explained", cause.get("share", 1.0))) < 0.5


def _change(
    judgement: Judgement,
    bundle: Bundle,
    motions: Sequence[Mapping[str, Any]],
    limits: ScoreConfig,
    unit: str,
    warmer_c: float | None,
) -> list[str]:
    cells = bundle.cells
    distance = (
        f"the target lies {judgement.distance_ratio:.3g} times as far from the baseline as a "
        "healthy session does"
    )
    if is_excused(judgement, limits):
        first = (
            f"It differs from its baseline (p {_p(judgement.p_adjusted)}, "
            f"{judgement.distance_ratio:.3g} times as far as a healthy session), but no more than "
            f"conditions as unusual as its other joints' may move it{logged(warmer_c)}: a fault "
            "that looks alike would not be told; record under the baseline's conditions."
        )
    elif judgement.state == "healthy":
        if judgement.p_adjusted <= SUSPICION < judgement.p_alone:
            return [
                f"Changed no more than the other joints of this robot: {distance}.",
                _pattern_change(judgement, cells, motions),
            ]
        if judgement.p_adjusted > SUSPICION:
            return [
                f"No change beyond what healthy sessions show: {distance}.",
                _pattern_change(judgement, cells, motions),
            ]
        first = f"A change {_why_spared(judgement, limits)}: {distance}; keep an eye on it."
    else:
        first = f"The torque has changed: {distance}."
    return [
        first,
        _pattern_change(judgement, cells, motions),
        *_size_change(judgement, bundle),
        *_course_change(judgement, bundle, unit),
        *_amplitude_change(judgement, bundle, unit),
    ]


def _why_spared(judgement: Judgement, limits: ScoreConfig) -> str:
    """Return why a change that healthy sessions hardly show is not called one."""
    if judgement.p_adjusted > limits.false_alarm_rate:
        return "too uncertain to act on"
    if judgement.p_alone > limits.false_alarm_rate:
        return "common to all joints, and so none of this one"
    return "too small to act on"


def _pattern_change(
    judgement: Judgement, cells: Sequence[Cell], motions: Sequence[Mapping[str, Any]]
) -> str:
    worst = cells[int(np.nanargmax(effect_by_cell(cells)))]
    entry = next(
        row
        for row in motions
        if (row["motion"], row["order"], row["tau"]) == (worst.motion, worst.order, worst.tau)
    )
    baseline, target = (
        f"{np.mean(entry[side]):.3g}" if entry[side] else "unknown"
        for side in ("jsd_baseline", "jsd_target")
    )
    effect = judgement.effects[PATTERNS]
    changed = f", where their probabilities changed by {effect:.0%} (root mean square)"
    changed *= not effect < LEAST_SAID
    return (
        f"Patterns of the current differ most in motion {worst.motion}{changed}: mean divergence "
        f"{target} against {baseline} of the baseline (order {worst.order}, delay {worst.tau} "
        "samples)."
    )


def _size_change(judgement: Judgement, bundle: Bundle) -> list[str]:
    witness = bundle.witnesses.get("spectrum")
    if not isinstance(witness, SpectrumEvidence):
        return []
    change = clearest_change(witness.cells, witness.n_baseline)
    if change is None or not math.isfinite(judgement.effects["spectrum"]):
        return []
    how = (
        f"{change.size_ratio:.2g} times as large as before"
        if change.size_ratio >= 1
        else f"down to {change.size_ratio:.0%} of what they were"
    )
    return [
        f"Fluctuations of the current changed in size{_by(judgement.effects['spectrum'])} most "
        f"clearly in motion {change.motion}, from {change.start:.0%} to "
        f"{change.stop:.0%} of its way, near {change.frequency_hz:.3g} Hz, where they are {how}."
    ]


def _by(effect: float) -> str:
    """Return by how much all of a current changed; nothing beside a change of one place alone."""
    return f" by {effect:.0%} (root mean square)," if effect >= LEAST_SAID else ""


def called(unit: str) -> str:
    """Say what a recording in this unit holds."""
    return "torque" if unit == "Nm" else "current"


def _course_change(judgement: Judgement, bundle: Bundle, unit: str) -> list[str]:
    witness = bundle.witnesses.get("profile")
    if not isinstance(witness, ProfileEvidence):
        return []
    change = clearest_course(witness.cells, witness.n_baseline)
    if change is None or not math.isfinite(judgement.effects["profile"]):
        return []
    return [
        f"The course of the {called(unit)} changed{_by(judgement.effects['profile'])} most "
        f"clearly in motion {change.motion}, from {change.start:.0%} to "
        f"{change.stop:.0%} of its way, by {change.change_a:+.3g} {unit}; its size over the "
        f"motion is {change.scale:.3g} times the baseline's."
    ]


def _amplitude_change(judgement: Judgement, bundle: Bundle, unit: str) -> list[str]:
    witness = bundle.witnesses.get("amplitude")
    if not isinstance(witness, AmplitudeEvidence):
        return []
    change = clearest_amplitude(witness.cells, witness.n_baseline)
    if change is None or not math.isfinite(judgement.effects["amplitude"]):
        return []
    return [
        f"The size of the {called(unit)} changed most clearly in motion {change.motion}: its "
        f"{change.size} is {change.ratio:.3g} times the baseline's."
    ]


def _certainty(judgement: Judgement) -> str:
    own = f"A healthy joint shows this or more with probability {_p(judgement.p_value)}"
    if judgement.p_adjusted != judgement.p_value:
        own += f", {_p(judgement.p_adjusted)} after correction for the number of joints"
    how = {
        "sessions": "by its rank among all sessions, each held against the others, and how far "
        "out it lies",
        "relabelled-sessions": "by exchanging whole sessions between baseline and target, and "
        "how far beyond them it lies",
        "one-session": "by the allowance for a single baseline session",
        "cause": "by its friction alone: by all of its current it may be a healthy joint",
        "none": "",
    }[judgement.method]
    return f"{own}, {how}."


def _rest(judgement: Judgement, sources: Mapping[str, Sequence[RunSource]]) -> str:
    text = (
        f"Compared with {_count(judgement.n_baseline_sessions, 'baseline session')} of "
        f"{_count(judgement.n_baseline_cycles, 'cycle')}{_age(sources)}; target: "
        f"{_count(judgement.n_target_sessions, 'session')} of "
        f"{_count(judgement.n_target_cycles, 'cycle')}."
    )
    if judgement.n_baseline_sessions == 1:
        text += (
            " With one baseline session the variation between sessions is unknown, so the limits "
            "are widened to that of published healthy joints and of this robot's other joints; "
            "a few more healthy recordings on other days make the verdict sharper."
        )
        if judgement.state == "healthy" and math.isfinite(judgement.least_effect):
            text += (
                f" Patterns that changed by less than {judgement.least_effect:.0%} would not have "
                "been called changed."
            )
    elif judgement.n_baseline_sessions < 4:
        text += " So few sessions say little of how much healthy ones vary; the limits are widened."
    return text


def _siblings(judgement: Judgement) -> list[str]:
    excused = judgement.state == "healthy" and judgement.p_alone > judgement.p_adjusted
    factor = math.exp(judgement.common_log_ratio)
    if factor < COMMON:
        allowed = math.exp(judgement.allowed_log_ratio)
        if not excused or judgement.p_adjusted > SUSPICION or allowed < NOTABLY:
            return []
        return [
            "The other joints' conditions are unusual (temperature, say): in such a joint may lie "
            f"{allowed:.2g} times as far out, and is not called changed by less."
        ]
    text = f"The other joints have moved too, {factor:.3g} times as far as usual in the middle"
    if excused:
        return [
            f"{text}: what moves all joints together (temperature, supply, logger, payload) is "
            "not taken for a fault of one."
        ]
    return [f"{text}; what this joint shows beyond that has p = {_p(judgement.p_alone)}."]


def _conditions(judgement: Judgement) -> list[str]:
    if judgement.state != "healthy" or judgement.unusual_log_ratio < UNUSUAL:
        return []
    return [
        "Conditions were unusual: along what healthy sessions differ by (temperature, say) it lies "
        f"{math.exp(judgement.unusual_log_ratio):.3g} times as far as they do. What patterns "
        "show was allowed for by as much, and so would be a fault that looks alike; "
        "record under the baseline's conditions to be sure."
    ]


def _missing(judgement: Judgement, cells: Sequence[Cell]) -> list[str]:
    if judgement.unknown_change > UNKNOWN_CHANGE:
        return [
            f"Its current differs by {judgement.unknown_change:.0%} from "
            f"{_count(judgement.n_baseline_sessions, 'baseline session')} (root mean square of "
            "course or size), and how much healthy sessions differ is not known: neither healthy "
            "nor changed; record the baseline on some more days."
        ]
    if not cells:
        return [
            "No motion of this joint occurs in both baseline and target; record both with the "
            "same program."
        ]
    return [
        f"{_count(judgement.n_baseline_cycles, 'baseline cycle')} and "
        f"{_count(judgement.n_target_cycles, 'target cycle')} are too few: at least two cycles of "
        "the baseline and one of the target are needed."
    ]


def _short(cells: Sequence[Cell]) -> list[str]:
    short: dict[int, list[int]] = {}
    for cell in cells:
        if len(cell.cycles) and np.median(cell.cycles.sum(axis=1)) < cell.cycles.shape[1]:
            short.setdefault(cell.order, []).append(cell.motion)
    return [
        f"Order {order} has {math.factorial(order)} patterns, more than motion"
        f"{'s' if len(motions) > 1 else ''} {', '.join(map(str, motions))} give in a cycle: its "
        "divergence is mostly chance; longer motions, a higher sampling rate or a lower order help."
        for order, motions in sorted(short.items())
    ]


def _age(sources: Mapping[str, Sequence[RunSource]]) -> str:
    times = {
        role: sorted(t for source in runs if (t := started(source.info.started_at)) is not None)
        for role, runs in sources.items()
    }
    if not times.get("baseline"):
        return " (of unknown age)"
    first, last = times["baseline"][0], times["baseline"][-1]
    span = f"recorded {first:%Y-%m-%d}" + (f" to {last:%Y-%m-%d}" if last != first else "")
    if times.get("target"):
        days = (times["target"][0] - last).total_seconds() / 86400
        side = "before" if days >= 0 else "after"
        span += f", {_count(round(abs(days)), 'day')} {side} the target"
    return f" ({span})"


def _count(n: int, noun: str) -> str:
    return f"{n} {noun}{'' if n == 1 else 's'}"


def _p(value: float) -> str:
    return f"{value:.2g}" if value >= 1e-4 else "below 0.0001"
