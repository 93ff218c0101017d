"""Why a night is to be done: what its result depends on, and what of that has changed."""

import json
from collections.abc import Mapping, Sequence
from itertools import combinations

from opamc_cli import __version__
from opamc_cli.config.models import digest
from opamc_cli.stages.nightly.inputs.recordings import Recording
from opamc_cli.stages.nightly.plan.planned import Comparison, PlannedNight
from opamc_cli.storage.history.rows import UNJUDGED, NightRow

MOST_ATTEMPTS = 3
"""Starts in which a night may break (time, memory, death of its worker) before it is left alone."""

MOST_GONE = 6
"""Recordings of a baseline that are gone of which every choice is tried: 64."""

BASELINE = "the baseline has changed"
"""Why nights are judged anew that are held against others than before."""


def key_of(
    comparisons: Sequence[Comparison],
    broken: Sequence[Recording],
    config_hash: str,
    known: dict[int, list[str]],
) -> str:
    """Return what a night's result depends on, so that it can be said what has changed."""
    for one in comparisons:
        if id(one.baseline) not in known:
            # the same tuple for all nights of a baseline, alive as long as the plan is made
            known[id(one.baseline)] = sorted(each.identity for each in one.baseline)
    targets = [one.identity for each in comparisons for one in each.targets]
    lacking = [said for one in comparisons for said in one.lacking]
    return json.dumps(
        {
            **({"lacking": lacking} if lacking else {}),
            "version": __version__,
            "config": config_hash,
            "baseline": _baseline_digest(comparisons, known, ()),
            "members": digest({"of": [[one.program, one.members] for one in comparisons]}),
            "files": sorted([*targets, *(one.identity for one in broken)]),
        },
        sort_keys=True,
    )


def _baseline_digest(
    comparisons: Sequence[Comparison], known: Mapping[int, list[str]], gone: Sequence[Recording]
) -> str:
    """Return the hash of what nights are compared with, and recordings that are gone beside it."""
    rest = [
        [
            one.program,
            one.condition,
            one.missing,
            sorted([*known[id(one.baseline)], *(r.identity for r in one.gone if r in gone)]),
        ]
        for one in comparisons
    ]
    return digest({"of": rest})


def hashes_before(
    comparisons: Sequence[Comparison], known: Mapping[int, list[str]]
) -> dict[str, tuple[Recording, ...]]:
    """Return what the baselines may have had before, by its hash: they lose one after the other."""
    gone = [recording for one in comparisons for recording in one.gone]
    # of many, all at once: what was judged in between is judged anew
    counts = range(1, len(gone) + 1) if len(gone) <= MOST_GONE else (len(gone),)
    return {
        _baseline_digest(comparisons, known, choice): choice
        for count in counts
        for choice in combinations(gone, count)
    }


def reason_of(
    key: str,
    record: NightRow | None,
    lost: bool,
    earlier: Mapping[str, object],
) -> str:
    """Say why a night is to be done; empty if its record stands."""
    if record is None:
        return "new"
    again = record.status == "broken" and record.attempts < MOST_ATTEMPTS
    if key == record.key:
        return f"broke before ({record.why})" if again else ""
    now, then = json.loads(key), json.loads(record.key)
    if now["version"] != then["version"]:
        return f"judged by version {then['version']}"
    if now["config"] != then["config"]:
        return "other options"
    # what was judged stays judged when its logs are cleared away, or some of its baseline's
    lost = lost or then["baseline"] in earlier
    kept = lost and record.status != "failed" and now["members"] == then.get("members")
    if now["baseline"] != then["baseline"] and not kept:
        return BASELINE
    added = set(now["files"]) - set(then["files"])
    if added:
        return f"{len(added)} new or changed file{'s' if len(added) > 1 else ''}"
    if now["files"] == then["files"] and now.get("lacking", []) > then.get("lacking", []):
        return "the night is over, and has not all its recordings"
    return f"broke before ({record.why})" if again else ""


def has_other_recordings(night: PlannedNight, record: NightRow | None) -> bool:
    """Whether a night is judged anew since its baseline's nights have other recordings."""
    compared = any(one.baseline for one in night.comparisons)
    if record is None or record.status in UNJUDGED or night.why != BASELINE or not compared:
        return False
    now, then = json.loads(night.key), json.loads(record.key)
    return bool(now["members"] == then.get("members"))
