"""Stage `arm`: runs of an arm whose joints all move in; where its joints are out, as arm.yaml."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import savgol_filter

from opamc_cli.config.joint_model import ArmConfig, ArmJoint
from opamc_cli.config.yaml.values import yaml_of
from opamc_cli.errors import InputError, NotEnoughDataError, UsageError
from opamc_cli.joint.motion.kinematics import SLOWEST_SHARE
from opamc_cli.joint.motion.track import Floats
from opamc_cli.robot.arm.finder import MOST_AXES, SAMPLES, Finder, chain_of
from opamc_cli.stages.model.axes import Runs
from opamc_cli.storage.files.atomic import write_text
from opamc_cli.storage.runs.run import Run

WINDOW_S = 0.06
"""Motion and current are differentiated and smoothed so."""
MOST_LEFT = 0.3
"""Of the current's deviation, in blocks left out, by half of the joints: 28 simulated programs of a
minute leave 0.005 to 0.05, one whose payload changes 0.303, a measured one of two seconds 3.1."""
DECLARED = ("arm", "inertia", "offset", "coulomb", "viscous")
"""Beside the arm: `inertia` is the rotor's."""
FIRST_LINE = "# Found by `opamc model arm`"


@dataclass(frozen=True)
class FoundArm:
    """Where the joints of an arm are, and how well its currents bear that out."""

    arm: ArmConfig
    letters: str
    """What each axis is parallel to where all are at zero; a capital's turns the other way."""
    left: dict[int, float]
    """By axis: share of the current's deviation that is left in blocks left out."""


def find_arm(paths: Runs) -> FoundArm:
    """Find where the joints of an arm are, from positions and currents of all of its axes.

    Parameters
    ----------
    paths : sequence of (str, Path)
        Names and files of the runs.

    Raises
    ------
    InputError
        If they do not hold axes 1 to n with currents, or do not move.
    NotEnoughDataError
        If they do not tell where the joints are.
    """
    with ExitStack() as stack:
        runs = [stack.enter_context(Run(path, name)) for name, path in paths]
        motion, current = _logged(runs)
    finder = Finder(motion, current)
    letters, ways = finder.found()
    shares = np.sqrt(finder.left(letters, ways))
    left = {joint + 1: float(share) for joint, share in zip(finder.joints, shares, strict=True)}
    if np.median(shares) > MOST_LEFT:
        msg = (
            f"{paths[0][1]}: does not tell where the joints are (best, {letters}, leaves of the "
            f"current of axis {told(left)}); give a longer program in which all axes move, or "
            "write the joints as a robot's URDF has them"
        )
        raise NotEnoughDataError(msg)
    joints = [
        ArmJoint(xyz=_rounded(one.xyz), rpy=_rounded(one.rpy), axis=_rounded(one.axis))
        for one in chain_of(letters, ways).joints
    ]
    return FoundArm(ArmConfig(joints=tuple(joints)), letters, left)


def told(left: dict[int, float]) -> str:
    """Say what is left of each axis's current."""
    return ", ".join(f"{axis} {share:.1%}" for axis, share in left.items())


def write_arm(found: FoundArm, paths: Runs, out: Path) -> None:
    """Write a model that declares an arm.

    Raises
    ------
    UsageError
        If something else lies there.
    """
    check_out(out)
    model = {"effects": [*DECLARED], "arm": found.arm.model_dump(mode="json")}
    named = ", ".join(path.name for _, path in paths)
    text = (
        f"{FIRST_LINE} in {named}: for `opamc model close RUN... --model {out.name}`,\n"
        f"# or `arm: {out.name}` in a model of your own.\n"
    )
    write_text(out, text + yaml_of(model, sort_keys=False, default_flow_style=None))


def check_out(out: Path) -> None:
    """Refuse to replace what no `opamc model arm` has written."""
    if out.is_dir() or (out.is_file() and not out.read_bytes().startswith(FIRST_LINE.encode())):
        msg = f"{out}: is no file of `opamc model arm` and would be replaced; choose another --out"
        raise UsageError(msg)


def _rounded(vector: Sequence[float]) -> Any:
    # tenths of a millimetre, of a milliradian; no -0.0
    return tuple(round(value, 4) + 0.0 for value in vector)


def _logged(runs: Sequence[Run]) -> tuple[Floats, Floats]:
    """Motion of all axes, (3, axes, n), and their currents, (axes, n), of runs."""
    axes = sorted(set.intersection(*(set(run.positions) for run in runs)))
    fed = [axis for axis in axes if all(f"axis{axis}_current" in run.columns for run in runs)]
    first = runs[0].path
    if len(fed) < max(len(axes) / 2, 2):
        msg = f"{first}: an arm is found from the positions and currents of all axes: log them"
        raise InputError(msg)
    if axes != list(range(1, len(axes) + 1)) or len(axes) > MOST_AXES:
        msg = (
            f"{first}: holds axes {', '.join(map(str, axes))}; an arm of axes 1 to n, of "
            f"{MOST_AXES} at most, is found: number them so from the base on"
        )
        raise InputError(msg)
    motions, currents = [], []
    for run in runs:
        names = [run.positions[axis] for axis in axes], [f"axis{axis}_current" for axis in fed]
        samples = run.read([*names[0], *names[1]])
        places, drawn = (np.array([samples[name] for name in some], float) for some in names)
        known = np.isfinite(places).all(axis=0) & np.isfinite(drawn).all(axis=0)
        places, drawn = np.unwrap(places[:, known]), drawn[:, known]
        rate = run.sampling_rate_hz
        window = max(5, int(WINDOW_S * rate) // 2 * 2 + 1)
        if places.shape[1] <= 3 * window:
            msg = f"{run.path}: {places.shape[1]} samples are known on all axes: too few"
            raise InputError(msg)
        smooth = [savgol_filter(places, window, 3, order, 1 / rate) for order in range(3)]
        motions.append(np.array(smooth)[:, :, window:-window])
        currents.append(np.full((len(axes), places.shape[1] - 2 * window), np.nan))
        currents[-1][np.isin(axes, fed)] = savgol_filter(drawn, window, 3)[:, window:-window]
    motion, current = np.concatenate(motions, axis=2), np.concatenate(currents, axis=1)
    fastest = np.abs(motion[1]).max(axis=1)
    moving = (np.abs(motion[1]) > SLOWEST_SHARE * fastest[:, None]).any(axis=0)
    if np.count_nonzero(moving) < SAMPLES:
        msg = f"{first}: {np.count_nonzero(moving)} samples of motion, {SAMPLES} are needed"
        raise InputError(msg)
    return motion[:, :, moving], current[:, moving]
