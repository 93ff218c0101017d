"""Joints that are far from the baseline together: common, but not therefore healthy."""

from collections.abc import Mapping
from typing import Any

FAR = 20.0
"""Health index beyond which nothing is called healthy because other joints have moved as far:
warmth, supply and load move all joints by a few of the baseline's own spreads; what moves them
by more (a wrong unit, another controller, a changed logger) hides any fault."""


def far_together(verdict: Mapping[str, Any]) -> dict[int, tuple[str, ...]]:
    """Return the axes that are called healthy though far from the baseline, with the reason."""
    return {
        entry["axis"]: (
            f"It lies {entry['health_index']:.3g} of the baseline's own spreads from the baseline, "
            "and so do the other joints: what moves all of them so far is no fault of one, but "
            "would hide it; check unit, sensors, program, payload and speed, and record again, or "
            "record a new baseline.",
        )
        for entry in verdict["axes"]
        if entry["state"] == "healthy" and (entry["health_index"] or 0.0) > FAR
    }
