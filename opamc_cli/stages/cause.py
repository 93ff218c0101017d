"""Why a joint has changed: the effect that target runs have and baseline runs lack."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from opamc_cli.config.models import JointConfig
from opamc_cli.errors import OpamcError
from opamc_cli.joint.change import Change, explain_change
from opamc_cli.joint.kinematics import Recording
from opamc_cli.joint.track import Joint
from opamc_cli.stages.model import read_recording
from opamc_cli.storage.sources import RunSource

MAX_RUNS = 4
"""Runs of each side that are looked at, the newest ones: causes do not become clearer with more."""


def explain(
    axis: int,
    baseline: Sequence[RunSource],
    target: Sequence[RunSource],
    config: JointConfig,
) -> dict[str, Any] | None:
    """Trace the change of one joint to an effect of the library.

    Parameters
    ----------
    axis
        Counted from 1.
    baseline, target
        Runs in which the axis moves, in time order.
    config
        Gear ratio and pole pairs, and how much is looked at.

    Returns
    -------
    dict or None
        The `cause` of verdict.json; None where nothing in the library explains the change, or
        where the runs do not hold what a model of the joint needs.
    """
    sides = []
    seconds = 60.0 * config.explain_minutes
    for sources in (baseline, target):
        recordings = _recordings(axis, sources[-MAX_RUNS:], seconds)
        if not recordings:
            return None
        sides.append(recordings)
    joint = Joint(gear_ratio=config.gear_ratio, pole_pairs=config.pole_pairs)
    return _entry(explain_change(sides[0], sides[1], joint))


def _recordings(axis: int, sources: Sequence[RunSource], seconds: float) -> list[Recording]:
    found = []
    for source in sources:
        stop = round(seconds / len(sources) * source.info.sampling_rate_hz)
        try:
            with source.open() as run:
                found.append(read_recording(run, axis, stop))
        except OpamcError:
            continue  # the run served the chain but not a model, which needs motion beside current
    return found


def _entry(change: Change) -> dict[str, Any] | None:
    if not change.causes:
        return None
    first, *others = change.causes
    return {
        "effect": first.effect,
        "domain": first.domain,
        "parameters": dict(first.parameters),
        "interpretation": first.interpretation,
        "share": first.share,
        "p_value": first.p_value,
        "ties": list(first.ties),
        "harmless": change.benign,
        "others": [
            {key: asdict(cause)[key] for key in ("effect", "parameters", "share", "interpretation")}
            for cause in others
        ],
    }
