"""What the first night of a fault would ask of its joint's baseline, found with the baseline.

Reads the baseline's tables of a night that was judged; writes what `processes/kept` keeps. Found
when it is asked for, it would make that night dearer than the next one by a tenth (30 s
recordings).
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from opamc_cli.config import Config
from opamc_cli.errors import OpamcError
from opamc_cli.stages.chain.compared.side import read_side
from opamc_cli.stages.nightly.workers.night import Input
from opamc_cli.stages.processes.kept import UNKNOWN, KeptResults
from opamc_cli.stages.report.assemble import draw_baseline
from opamc_cli.storage.schemas import files

MOST_SAMPLES = 16_000
"""Of a joint's motion in one recording, which then takes 0.9 MB: of recordings in which it moves
for longer a diagnosis costs so much more that a fault's first night may follow them itself."""

MAY_FAIL = (ArithmeticError, LookupError, ValueError, OSError, MemoryError, OpamcError)
"""Of odd recordings; who asks for the same later is told why, and this night is judged already."""


@dataclass(frozen=True)
class _Baseline:
    """All that what is found depends on."""

    names: tuple[str, ...]
    sha256: tuple[str, ...]
    config: Config


def look_ahead(inputs: Sequence[Input], out: Path, config: Config, kept: KeptResults) -> None:
    """Keep how each joint moved in a baseline, and the drawing that is of the baseline alone; once.

    Parameters
    ----------
    inputs
        The baseline's recordings.
    out
        Folder of the tables of a night that was compared with it.
    config
        Options of its diagnosis; without causes to be explained nothing is done.
    kept
        Where it is kept.
    """
    names, hashes = zip(*((one.name, one.sha256) for one in inputs), strict=True)
    baseline = _Baseline(names, hashes, config)
    if not config.joint.explain or kept.find(look_ahead, baseline) is not UNKNOWN:
        return
    with suppress(*MAY_FAIL):
        _follow(out, config, kept)
    with suppress(*MAY_FAIL):
        draw_baseline(out, kept)
    kept.keep(look_ahead, baseline, True)


def _follow(out: Path, config: Config, kept: KeptResults) -> None:
    from opamc_cli.stages.verdict import cause  # a healthy night does without

    side = read_side(out / "baseline" / files.PATTERNS)
    for axis, moving in cause.moving_samples(side.patterns).items():
        if max(stop - start for start, stop in moving.values()) > MOST_SAMPLES:
            continue
        with suppress(*MAY_FAIL):
            cause.follow_baseline(axis, side.sources, config.joint, moving, kept)
