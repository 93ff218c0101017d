"""The contestants: the package's loop, the plain stepwise fit, and the plain beam."""

import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
import plain

from panel import loop_adapter
from panel.case import Case, Floats, Logged

Contestant = Callable[[Case, list[Logged], tuple[str, ...]], dict[str, Any]]


def loop(case: Case, recordings: list[Logged], without: tuple[str, ...]) -> dict[str, Any]:
    """Call the package's loop, as it is installed."""
    began = time.process_time()
    closed = loop_adapter.close(recordings, case.declared, case.gear, case.seed, without)
    return {**asdict(closed), "seconds": time.process_time() - began}


def _plain(search: str) -> Contestant:
    def close(case: Case, recordings: list[Logged], without: tuple[str, ...]) -> dict[str, Any]:
        signals = [
            plain.Signals(r.rate_hz, r.current, r.position, r.velocity, r.temperature)
            if r.current is not None and r.position is not None
            else followed(r, case.gear)
            for r in recordings
        ]
        # Without the joint's zero an angle from phases has no gravity but sine and cosine of it.
        result = plain.close(signals, case.declared, search=search)
        added = [
            {"name": name, "ties": ties, "parameters": parameters}
            for name, ties, parameters in zip(
                result.names, result.ties, result.parameters, strict=True
            )
        ]
        return {
            "before": float(result.before),
            "after": float(result.after),
            "r2_before": float(result.r2_before),
            "r2_after": float(result.r2_after),
            "added": added,
            "verdict": None,
            "ceiling": None,
            "seconds": result.seconds,
        }

    return close


def followed(r: Logged, gear: tuple[float, int] | None) -> plain.Signals:
    """Take angle and torque current from three phases in the simplest way.

    The square of the current vector does not care for the torque's sign, so half of its unwrapped
    angle is the electrical one. Whichever way friction resists is forward.
    """
    ratio, poles = gear or (100.0, 1)
    vector: Floats = 2 / 3 * (r.phases @ np.exp(2j * np.pi / 3 * np.arange(3)))  # type: ignore[assignment]
    width = max(int(0.004 * r.rate_hz), 1)
    squared = np.convolve(vector**2, np.ones(width) / width, mode="same")
    angle = np.unwrap(np.angle(squared)) / 2
    current = np.real(vector * np.exp(-1j * angle))
    if np.sum(current * np.gradient(angle)) < 0:
        current = -current
    return plain.Signals(r.rate_hz, current, angle / (ratio * poles), None, r.temperature)


ALL: dict[str, Contestant] = {"loop": loop, "plain": _plain("stepwise"), "beam": _plain("beam")}
