"""How a joint moved in a recording of the baseline, kept once it was asked for.

Reads and writes what `processes/kept` keeps: of a joint that differs from its baseline the current
of every baseline recording is followed through all of its motion, which takes longer than the
comparison itself, and the night after asks for the same.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from opamc_cli.joint.change.units import Follow, Tracked, follow
from opamc_cli.joint.motion.groups import Grouping
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Floats, Joint, Track
from opamc_cli.stages.processes.kept import KeptResults, remembered


@dataclass(frozen=True)
class _Job:
    """All that a track depends on."""

    recording: Recording
    joint: Joint


def following(kept: KeptResults | None) -> Follow:
    """Return `units.follow`, made to look for its results first."""
    if kept is None:
        return follow
    found = remembered(_as_values, kept)

    def kept_follow(recording: Recording, joint: Joint) -> Tracked | None:
        plain = found(_Job(replace(recording, started_s=None), joint))
        return None if plain is None else _tracked(plain, joint)

    return kept_follow


def _as_values(job: _Job) -> Mapping[str, Any] | None:
    """Return a track and its groups as plain values, without what follows from others."""
    tracked = follow(job.recording, job.joint)
    if tracked is None:
        return None
    track, grouping = ({f.name: getattr(one, f.name) for f in fields(one)} for one in tracked)
    derived = _derived(track["position_rad"], track["rate_hz"], job.joint)
    for name, values in derived.items():
        if track[name].dtype == values.dtype and np.array_equal(track[name], values):
            del track[name]
    del track["joint"]
    return {"track": {**track, "channels": sorted(track["channels"])}, "grouping": grouping}


def _tracked(plain: Mapping[str, Any], joint: Joint) -> Tracked:
    track = dict(plain["track"])
    track["channels"] = frozenset(track["channels"])
    derived = _derived(track["position_rad"], track["rate_hz"], joint)
    return Track(**{**derived, **track}, joint=joint), Grouping(**plain["grouping"])


def _derived(position_rad: Floats, rate_hz: float, joint: Joint) -> dict[str, Any]:
    """Return what most tracks of one recording have alike; it would take half of the room."""
    n = position_rad.size
    times = np.arange(n) / rate_hz
    return {
        "time_s": times,
        "run_time_s": times.copy(),
        "machine_angle_rad": (joint.gear_ratio or 1.0) * position_rad,
        "group": np.full(n, -1, dtype=np.int64),
        "load_a": np.zeros(n),
        "model_a": np.zeros(n),
    }
