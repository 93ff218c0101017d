"""Numbers, moments and effects with their parameters, as a reader sees them."""

import math
from collections.abc import Mapping
from typing import Any

from opamc_cli.stages.recordings.sessions import started


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


def effect_phrase(step: Mapping[str, Any]) -> str:
    """Return a step's effect with its parameters."""
    return cause_phrase(
        {"effect": step.get("effect", "unnamed"), "parameters": step.get("parameters")}
    )
