"""Stage `arm`: runs of an arm whose joints all move in; where its joints are out, as arm.yaml."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from opamc_cli.arm.finder import FEWEST, MOST_AXES, SAMPLES, Finder, chain_of
from opamc_cli.config.joint_model import ARM, ArmConfig, ArmJoint, JointModelConfig
from opamc_cli.config.yaml.values import yaml_of
from opamc_cli.errors import InputError, NotEnoughDataError, OpamcError, UsageError
from opamc_cli.joint.motion.kinematics import SLOWEST_SHARE
from opamc_cli.joint.motion.track import Floats
from opamc_cli.stages.model.axes import Runs
from opamc_cli.stages.recordings.axis_recording import MOST_MISSING
from opamc_cli.storage.files.atomic import write_text
from opamc_cli.storage.runs.run import Run

WINDOW_S = 0.06
"""Motion and current are differentiated and smoothed so."""
LEAST_GAIN = 5.0
"""How many times less half of the joints leave of their currents, in blocks left out, than without
an arm: 6 to 110 times in 26 simulated programs of ten arms, 1.9 and 4.0 in two whose payload
changes; 1.3 in two measured ones of two seconds each, 1.0 to 2.0 where joints that ask nothing of
each other move."""
SHORT = 2.0
"""Deviations by which half of the joints by themselves miss blocks left out, with the least ridge,
above which a program is too short to tell an arm: 1.04 at the most in those, 3.5 and 6.1 in each of
the measured."""
REMEDY = (
    "give a longer program in which all axes move and the payload stays, or write the joints as a "
    "robot's URDF has them"
)
DECLARED = ("arm", "inertia", "offset", "coulomb", "viscous")
"""Beside the arm: `inertia` is the rotor's."""
FEWEST_AXES = 4
"""What links ask of the joints of fewer is what searched couplings hold."""
LONGEST_S, PIECES = 240.0, 24
"""Of more than that many seconds such pieces are looked at, ten seconds each."""
FOUND = (
    "axis {}: where the arm's joints are was found from all axes' currents, and what its links ask "
    "is declared (`opamc model arm` writes them; `without: [arm]` searches couplings instead)"
)
NOT_FOUND = "axis {}: what other joints ask is searched joint by joint, since {}"
PARTS = {"last third": (2, 3), "first third": (0, 1)}
"""Asked where the whole does not tell."""
UNTOLD = "the runs do not tell where the arm's joints are (`opamc model arm` says why)"
LEAVES_MORE = "they leave less than the arm that was found"
FIRST_LINE = "# Found by `opamc model arm`"


@dataclass(frozen=True)
class FoundArm:
    """Where the joints of an arm are, and how well its currents bear that out."""

    arm: ArmConfig
    letters: str
    """What each axis is parallel to where all are at zero; a capital's turns the other way."""
    left: dict[int, float]
    """By axis: share of the current's deviation that is left in blocks left out."""
    alone: dict[int, float]
    """The same without an arm."""
    part: str
    """Of the runs, that tells: a payload that changes once hides the arm from the whole."""

    @property
    def gain(self) -> float:
        """How many times less half of the joints leave than without an arm."""
        return float(np.median([self.alone[axis] / self.left[axis] for axis in self.left]))


class MisnumberedError(InputError):
    """Axes that move, but are not numbered from an arm's base on."""

    def __init__(self, run: Path, axes: Sequence[int]) -> None:
        self.why = (
            f"an arm of axes 1 to n, of {MOST_AXES} at most, is found, not one of axes "
            + ", ".join(map(str, axes))
        )
        super().__init__(f"{run}: {self.why}: number them so from the base on")


def find_arm(paths: Runs, fewest: int = 2) -> FoundArm:
    """Find where the joints of an arm are, from positions and currents of all of its axes.

    Parameters
    ----------
    paths : sequence of (str, Path)
        Names and files of the runs.
    fewest : int
        Of axes that move, with a current.

    Raises
    ------
    MisnumberedError
        If so many axes move, but are not axes 1 to n.
    InputError
        If they do not hold positions and currents of the axes, or do not move.
    NotEnoughDataError
        If they do not tell where the joints are.
    """
    with ExitStack() as stack:
        runs = [stack.enter_context(Run(path, name)) for name, path in paths]
        motion, current = _logged(runs, fewest)
    named, n = paths[0][1], motion.shape[2]
    whole = found = _found(motion, current, fewest, named, "whole")
    for part, (first, last) in PARTS.items() if n >= 3 * SAMPLES else ():
        if found.gain >= LEAST_GAIN:
            break
        some = slice(n * first // 3, n * last // 3)
        with suppress(OpamcError):  # Too little moves there, or for too short.
            found = _found(motion[:, :, some], current[:, some], fewest, named, part)
    if found.gain >= LEAST_GAIN:
        return found
    msg = (
        f"{named}: does not tell where the joints are (the best, {whole.letters}, leaves of the "
        f"current of axis {told(whole.left)}, and no arm {told(whole.alone)}); {REMEDY}"
    )
    raise NotEnoughDataError(msg)


def _found(motion: Floats, current: Floats, fewest: int, named: Path, part: str) -> FoundArm:
    with threadpool_limits(1):  # With more, sums of products would differ in the last digit.
        finder = Finder(motion, current)
        alone = np.sqrt(finder.alone)
        if len(alone) < fewest:
            msg = f"{named}: {len(alone)} axes with a current move, {fewest} are needed"
            raise InputError(msg)
        if np.median(alone[:, 0]) > SHORT:
            msg = f"{named}: is too short to tell where the joints are; {REMEDY}"
            raise NotEnoughDataError(msg)
        letters, ways = finder.found()
    shares, axes = np.sqrt(finder.left(letters, ways)), [joint + 1 for joint in finder.joints]
    left, without = (
        dict(zip(axes, one.tolist(), strict=True)) for one in (shares, alone.min(axis=1))
    )
    chain = chain_of(letters, ways)
    joints = tuple(
        ArmJoint(xyz=_rounded(one.xyz), rpy=_rounded(one.rpy), axis=_rounded(one.axis))
        for one in chain.joints
    )
    arm = ArmConfig(joints=joints, up=_rounded(chain.up))
    return FoundArm(arm, letters, left, without, part)


def arm_told(model: JointModelConfig, paths: Runs) -> FoundArm | str | None:
    """Return the arm that runs tell of, or why they do not; None where nobody asks.

    Not asked are models that say something of an arm, or of what other joints ask, and runs in
    which less than four axes with position and current move.
    """
    said = {entry.effect for entry in model.declared()} | {*model.without}
    if model.arm is not None or said & {ARM, "coupling"}:
        return None
    try:
        return find_arm(paths, FEWEST_AXES)
    except NotEnoughDataError:
        return UNTOLD
    except MisnumberedError as error:
        return error.why
    except OpamcError:  # Which the work on the axes says, too.
        return None


def on_axis(
    model: JointModelConfig, told_of: FoundArm | str | None, axis: int
) -> tuple[JointModelConfig, str | None]:
    """Return the model of an axis with the arm, and what is to be said of that."""
    if isinstance(told_of, FoundArm):
        return model.model_copy(update={"arm": told_of.arm}), FOUND.format(axis)
    return model, told_of and NOT_FOUND.format(axis, told_of)


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


def _logged(runs: Sequence[Run], fewest: int) -> tuple[Floats, Floats]:
    """Motion of all axes, (3, axes, n), and their currents, (axes, n), of runs."""
    axes = sorted(set.intersection(*(set(run.positions) for run in runs)))
    fed = [axis for axis in axes if all(f"axis{axis}_current" in run.columns for run in runs)]
    first = runs[0].path
    if len(fed) < max(len(axes) / 2, fewest):
        msg = f"{first}: an arm is found from the positions and currents of all axes: log them"
        raise InputError(msg)
    pieces = []
    for run, start, stop in _pieces(runs):
        names = [run.positions[axis] for axis in axes], [f"axis{axis}_current" for axis in fed]
        samples = run.read([*names[0], *names[1]], start, stop)
        places, drawn = (np.array([samples[name] for name in some], float) for some in names)
        known = np.isfinite(places).all(axis=0) & np.isfinite(drawn).all(axis=0)
        places, drawn = np.unwrap(places[:, known]), drawn[:, known]
        rate = run.sampling_rate_hz
        window = max(5, int(WINDOW_S * rate) // 2 * 2 + 1)
        if places.shape[1] <= max(3 * window, (1 - MOST_MISSING) * known.size):
            msg = f"{run.path}: {places.shape[1]} samples are known on all axes: too few"
            raise InputError(msg)
        pieces.append((places, drawn, window, rate))
    travels = np.ptp(np.concatenate([places for places, *_ in pieces], axis=1), axis=1)
    moved = travels > SLOWEST_SHARE * travels.max()
    moving_fed = np.count_nonzero(moved & np.isin(axes, fed))
    if moving_fed < fewest:
        msg = f"{first}: {moving_fed} axes with a current move, {fewest} are needed"
        raise InputError(msg)
    if axes != list(range(1, len(axes) + 1)) or len(axes) > MOST_AXES:
        raise MisnumberedError(first, axes)
    from scipy.signal import savgol_filter  # 0.3 s to load, which a joint by itself does not need

    motions, currents = [], []
    for places, drawn, window, rate in pieces:
        smooth = [savgol_filter(places, window, 3, order, 1 / rate) for order in range(3)]
        motions.append(np.array(smooth)[:, :, window:-window])
        currents.append(np.full((len(axes), places.shape[1] - 2 * window), np.nan))
        currents[-1][np.isin(axes, fed)] = savgol_filter(drawn, window, 3)[:, window:-window]
    motion, current = np.concatenate(motions, axis=2), np.concatenate(currents, axis=1)
    fastest = np.abs(motion[1]).max(axis=1)
    moving = (np.abs(motion[1]) > SLOWEST_SHARE * fastest[:, None]).any(axis=0)
    if np.count_nonzero(moving) < FEWEST:
        msg = f"{first}: {np.count_nonzero(moving)} samples of motion, {FEWEST} are needed"
        raise InputError(msg)
    return motion[:, :, moving], current[:, moving]


def _pieces(runs: Sequence[Run]) -> Iterator[tuple[Run, int, int]]:
    """Yield the samples that are looked at, (start, stop) of runs: pieces of long ones."""
    short = sum(run.duration_s for run in runs) <= LONGEST_S
    for run in runs:
        size = int(min(LONGEST_S / PIECES * run.sampling_rate_hz, run.n_samples))
        size = run.n_samples if short else size
        count = 1 if short else max(PIECES // len(runs), 1)
        for start in np.linspace(0, run.n_samples - size, count).astype(int).tolist():
            yield run, start, start + size
