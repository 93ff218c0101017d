"""A stand-in for the diagnosis of a night, light enough to be killed hundreds of times."""

import json
import random
import shutil
import tempfile
import time
from pathlib import Path

from opamc_cli.errors import UsageError
from opamc_cli.stages.nightly.workers.night import AxisResult, NightJob, ProgramResult

PAUSE_S = 0.02
"""Time in which a kill may come."""


def stand_in(job: NightJob) -> tuple[ProgramResult, ...]:
    """Answer like a diagnosis: the same for the same job, with work on the disk that can fail."""
    job.scratch.mkdir(parents=True, exist_ok=True)
    place = Path(tempfile.mkdtemp(dir=job.scratch))
    try:
        for index in range(3):
            (place / str(index)).write_bytes(bytes(4096))
    except OSError as error:
        msg = f"{place}: cannot be written ({error.strerror})"
        raise UsageError(msg) from error
    finally:
        time.sleep(PAUSE_S)
        shutil.rmtree(place, ignore_errors=True)
    found = []
    for program in job.programs:
        draw = random.Random(f"{job.robot} {job.night} {program.targets[0].sha256}")
        axes = tuple(
            AxisResult(
                axis=axis,
                state="fault" if (job.robot, axis) == ("r2", 2) else "healthy",
                health_index=draw.gauss(0, 1),
                p_value=draw.random(),
                cause=None,
                harmless=False,
                log_distance=draw.gauss(0, 0.1),
                log_common=0.0,
                effect=0.05,
                temperature_c=25.0,
                reason="",
            )
            for axis in job.axes or (1, 2)
        )
        page = json.dumps([program.program, [one.name for one in program.baseline]]).encode()
        files = {"verdict.json": page, "report.html": page * 200}
        found.append(ProgramResult(program.program, axes, files))
    return tuple(found)
