"""What the links of an arm ask of one of its joints, from where its joints are.

For `opamc model` where all axes of an arm move at once. Write your robot's joints into a copy of
this file, or have them found from runs with all positions and currents: `python arm.py RUN ...`, by
the Python that opamc is installed in. In `model.yaml`: `library: [arm.py]`, `effects: [arm,
inertia, offset, coulomb, viscous]` and `without: [coupling]`, which is searched without an arm.
"""

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import savgol_filter

from opamc_cli.errors import ConfigError, InputError, OpamcError
from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.effects.payload_change import PayloadChange
from opamc_cli.joint.motion.track import Floats, Ints, Track
from opamc_cli.storage.runs.run import Run

JOINTS = (
    # Of a UR10 ((0, 0, 0.1273), (0, 0, 0), (0, 0, 1)), ((0, 0.2209, 0), (0, 1.5708, 0), (0, 1, 0)),
    # ((0, -0.1719, 0.612), (0, 0, 0), (0, 1, 0)), ((0, 0, 0.5723), (0, 1.5708, 0), (0, 1, 0)),
    # ((0, 0.1149, 0), (0, 0, 0), (0, 0, 1)), ((0, 0, 0.1157), (0, 0, 0), (0, 1, 0)),
)
"""Axis 1, 2, ...: as in a robot's URDF, `xyz` in m and `rpy` in rad of the joint's `origin`, and
its `axis`. An axis that counts the other way has its `axis` negated, one whose zero is elsewhere is
turned by its `rpy`. Tool and payload belong to the last link."""

UP = (0.0, 0.0, 1.0)
"""Upwards in the base's frame: of an arm that hangs from the ceiling (0, 0, -1)."""

GRAVITY_M_S2 = 9.81
INDEPENDENT = 1e-9
"""Share of the strongest: weaker combinations of the links' parameters never reach the joint."""
STARTS = ("zyyyzyx", "zyyyzxz", "zyyxyxy", "zyyzyzy", "zyzyzyz", "zyxyxyx", "yyyyyyy")
"""What the axes are parallel to where all are at zero: arms whose three middle ones are parallel,
with a spherical wrist, of seven axes; planar ones. Those that are found may be any others."""
WAYS = dict(zip("xyzXYZ", np.vstack([np.eye(3), 0 - np.eye(3)]), strict=True))
"""A capital letter's axis turns the other way."""
WINDOW_S, SAMPLES, BLOCKS = 0.06, 500, 6
"""Motion and current are differentiated and smoothed so; looked at; left out in turn."""
MOST_LEFT = 0.3
"""Of the current's deviation, in blocks left out, by half of the joints: 28 simulated programs of a
minute leave 0.005 to 0.05, one whose payload changes 0.303, a measured one of two seconds 3.1."""
RIDGE, LONG = 1e-7, 0.02
"""Of links' parameters, in the current's deviation; of ways from axis to axis (m), zeros (rad)."""


class Arm(Effect):
    """Torque by the inertial parameters of every link from the joint outwards.

    It is linear in mass, first moments and inertias (Atkeson, An, Hollerbach, Estimation of
    inertial parameters of manipulator loads and links, 1986). Combinations that no motion tells
    apart are left out: the rest are the base parameters (Gautier, 1991), of which the singular
    values of a random motion's regressors tell.
    """

    name = "arm"
    domain = "acceleration"
    origin = "load"
    meaning = "what the arm's links ask: no fault"
    needs = ("position", "others")
    from_motion = True
    carries_load = True

    def columns_at(self, track: Track, parameters: Parameters, rows: Ints) -> Floats:
        """Regressors at some samples; ConfigError where not all axes are logged."""
        return _asked(track, rows, slice(None))


class Payload(PayloadChange):
    """Weight that the last link carries from some time on: its mass and first moments.

    The arm's own torques are known, so no place has to be passed twice to tell time from place.
    """

    needs = ("scale", "others")

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Return what a weight in the gripper asks of this joint while it is there."""
        held = np.hypot(*super().columns(track, parameters)[:, :2].T)
        return held[:, None] * _asked(track, np.arange(track.size), slice(-10, -6))


def _asked(track: Track, rows: Ints, some: slice) -> Floats:
    """Independent torques of the joint by some of the links' parameters, at some samples."""
    axes = range(1, len(JOINTS) + 1)
    if not JOINTS:
        msg = "effect 'arm' knows no joints yet: have them found, `python arm.py RUN.parquet ...`"
        raise ConfigError(msg + ", or write them into arm.py")
    own = [axis for axis in axes if axis not in track.other_axes]
    if track.others is None or len(own) != 1:
        msg = (
            f"effect 'arm' has {len(JOINTS)} joints, and the positions logged beside this one are "
            f"those of axes {', '.join(map(str, track.other_axes)) or 'none'}: log all"
        )
        raise ConfigError(msg)
    joint = own[0] - 1
    motion = np.empty((3, len(JOINTS), rows.size))
    motion[:, joint] = [
        part[rows] for part in (track.position_rad, track.velocity, track.acceleration)
    ]
    for place, axis in enumerate(track.other_axes):
        if axis in axes:
            motion[:, axis - 1] = track.others[rows, place :: len(track.other_axes)].T
    any_motion = np.random.default_rng(0).uniform(-3, 3, (3, len(JOINTS), 400))
    sample = torques(any_motion, joint)[:, some]
    size = np.linalg.norm(sample, axis=0)
    told = size > INDEPENDENT * size.max()
    _, strength, base = np.linalg.svd(sample[:, told] / size[told], full_matrices=False)
    base = base[strength > INDEPENDENT * strength[0]]
    # A closed model's coefficients are of these: the sign is not to depend on who computes them.
    largest = np.abs(base).argmax(axis=1)
    base *= np.sign(base[np.arange(len(base)), largest])[:, None] / size[told]
    return np.asarray(torques(motion, joint)[:, some][:, told] @ base.T)


def torques(motion: Floats, joint: int, joints: Any = None) -> Floats:
    """Torque about one joint, from 0, by each link's mass, first moments and inertias.

    Angles, speeds and accelerations of all joints have shape (3, joints, n), the torques
    (n, 10 * links): of each link from the joint outwards m, m x, m y, m z, Ixx, Ixy, Ixz, Iyy, Iyz,
    Izz about the origin of its joint's frame.
    """
    n = motion.shape[2]
    turn = np.broadcast_to(np.eye(3), (n, 3, 3))
    place, spin, spin_up = (np.zeros((n, 3)) for _ in range(3))
    lift = np.broadcast_to(GRAVITY_M_S2 * np.array(UP), (n, 3))
    found: list[Floats] = []
    for link, (xyz, rpy, axis) in enumerate(JOINTS if joints is None else joints):
        angle, speed, acceleration = motion[:, link, :, None]
        way = turn @ np.array(xyz)
        place = place + way
        lift = lift + _carried(spin, spin_up, way)
        turn = turn @ _turned(rpy)
        about = np.array(axis) / np.linalg.norm(axis)
        line = turn @ about
        spin_up = spin_up + line * acceleration + _cross(spin, line) * speed
        spin = spin + line * speed
        # Rodrigues' formula.
        across = np.cross(np.eye(3), about)
        sin, cos = np.sin(angle)[..., None], np.cos(angle)[..., None]
        turn = turn @ (np.eye(3) + sin * across + (1 - cos) * (across @ across))
        if link == joint:
            own, origin = line, place
        if link >= joint:
            found.append(np.sum(own * _cross(place - origin, lift), axis=1))
            for side in np.moveaxis(turn, 2, 0):
                moment = _cross(side, lift)
                moment += _cross(place - origin, _carried(spin, spin_up, side))
                found.append(np.sum(own * moment, axis=1))
            # What turns the link, in its own frame, where its inertia does not change.
            vectors = (own, spin_up, _cross(own, spin), spin)
            a, b, c, d = (np.einsum("nkj,nk->nj", turn, vector) for vector in vectors)
            for one, two in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
                pair = a[:, one] * b[:, two] + c[:, one] * d[:, two]
                if one != two:
                    pair += a[:, two] * b[:, one] + c[:, two] * d[:, one]
                found.append(pair)
    return np.stack(found, axis=1)


def _cross(a: Floats, b: Floats) -> Floats:
    """Cross product over the last axis: numpy's own takes thrice as long."""
    (u, v, w), (x, y, z) = a.T, b.T
    return np.array([v * z - w * y, w * x - u * z, u * y - v * x]).T


def _carried(spin: Floats, spin_up: Floats, way: Floats) -> Floats:
    """Acceleration of a point that a turning body carries, less that of the body's origin."""
    return _cross(spin_up, way) + _cross(spin, _cross(spin, way))


def _turned(rpy: tuple[float, float, float]) -> Floats:
    """Turn about x, then y, then z of a fixed frame."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(rpy), np.sin(rpy)
    x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(z @ y @ x)


class Finder:
    """Where an arm's joints are, from the currents of them all.

    What an axis is parallel to at zero is one of six letters, and weight alone nearly tells it: the
    sum of a chain's ways and first moments is linear whatever its lengths are. So letters are
    exchanged one by one, without lengths, as long as blocks left out are predicted better, then
    lengths and what is off the zeros are fitted beside the links' parameters, and both once more. A
    joint with a fault misleads nobody: its logarithm is one of many.
    """

    def __init__(self, motion: Floats, current: Floats) -> None:
        """Take angles, speeds and accelerations, (3, joints, n), and currents, (joints, n)."""
        some = np.linspace(0, motion.shape[2] - 1, SAMPLES).astype(int)
        self.motion = motion[:, :, some]
        self.known: dict[tuple[str, bytes], Floats] = {}
        self.joints = {}
        """Of each that moves: at which samples, its own friction, its current."""
        for joint, (q, v, a) in enumerate(self.motion.swapaxes(0, 1)):
            moves = np.abs(v) > 0.02 * np.abs(v).max()
            y = current[joint, some][moves]
            if moves.sum() > SAMPLES / 10 and np.isfinite(y).all() and np.ptp(y) > 0:
                own = _friction(q[moves], v[moves], a[moves])
                self.joints[joint] = moves, own, (y - y.mean()) / y.std()

    def found(self) -> tuple[str, Floats]:
        """Return the axes' letters, and ways from each to the next and its zero, (joints, 4)."""
        none = np.zeros((self.motion.shape[1], 4))
        starts = {start[: len(none)] for start in STARTS}
        best: list[tuple[float, str, Floats]] = []
        for word in sorted(starts, key=lambda one: self.score(one, none))[:2]:
            ways, letters, last = none, self.exchanged(word, none), ""
            while letters != last and len(best) < 8:
                last, ways = letters, self.fitted(letters, ways)
                best.append((self.score(letters, ways), letters, ways))
                letters = self.exchanged(letters, ways)
        _, letters, ways = min(best, key=lambda one: one[0])
        return letters, self.fitted(letters, ways)

    def score(self, letters: str, ways: Floats) -> float:
        """Sum the logarithms of what is left of each joint's current."""
        return float(np.log(self.left(letters, ways)).sum())

    def left(self, letters: str, ways: Floats) -> Floats:
        """Return the share of each joint's mean square that is left in blocks left out."""
        key = letters, ways.tobytes()
        if key not in self.known:
            designs = self._designs(letters, ways)
            pairs = zip(designs, self.joints.values(), strict=True)
            self.known[key] = np.array([_held_out(x, y) for x, (_, _, y) in pairs])
        return self.known[key]

    def exchanged(self, letters: str, ways: Floats) -> str:
        """Exchange a letter for another as long as that is better."""
        while True:
            places = range(len(letters))
            near = [letters[:k] + way + letters[k + 1 :] for k in places for way in WAYS]
            best = min(near, key=lambda one: self.score(one, ways))
            if self.score(best, ways) > self.score(letters, ways) - 0.01:
                return letters
            letters = best

    def fitted(self, letters: str, ways: Floats) -> Floats:
        """Fit ways and zeros, beside links' parameters that are best for each."""
        sizes = np.sqrt(self.left(letters, ways))

        def left(free: Floats) -> Floats:
            designs = self._designs(letters, np.vstack([np.zeros(4), free.reshape(-1, 4)]))
            found = [LONG * free]
            for x, size, (_, _, y) in zip(designs, sizes, self.joints.values(), strict=True):
                held = np.linalg.solve(x.T @ x + RIDGE * len(y) * np.eye(x.shape[1]), x.T @ y)
                found.append((y - x @ held) / (size * np.sqrt(len(y))))
            return np.concatenate(found)

        free = least_squares(left, ways[1:].ravel(), max_nfev=8, x_scale=0.2).x
        return np.vstack([np.zeros(4), free.reshape(-1, 4)])

    def _designs(self, letters: str, ways: Floats) -> list[Floats]:
        joints = _as_joints(letters, ways)
        found = []
        for joint, (moves, own, _) in self.joints.items():
            links = torques(self.motion[:, :, moves], joint, joints)
            # A mass is first moments of the links before it.
            links = np.delete(links, np.arange(0, links.shape[1], 10), axis=1)
            found.append(np.hstack([own, links / GRAVITY_M_S2]))
        return found


def _as_joints(letters: str, ways: Floats) -> Any:
    axes = [WAYS[one] for one in letters]
    return [(tuple(one[:3]), tuple(one[3] * to), to) for to, one in zip(axes, ways, strict=True)]


def _friction(q: Floats, v: Floats, a: Floats) -> Floats:
    """Rotor and friction of any place and speed: whatever a joint has is not to pass for links."""
    place = (q - q.min()) / np.ptp(q) * 4
    sign, speed = np.sign(v), np.abs(v) / np.abs(v).max()
    at = np.clip(1 - np.abs(place[:, None] - np.arange(5)), 0, None) * sign[:, None]
    own = np.column_stack([np.ones(q.size), a, v, v * np.abs(v), sign * np.exp(-10 * speed), at])
    return np.asarray(own / (np.sqrt(np.mean(own**2, axis=0)) + 1e-9))


def _held_out(x: Floats, y: Floats) -> float:
    """Mean square of what blocks that are left out in turn keep."""
    block = np.arange(len(y)) * BLOCKS // len(y)
    parts = [(x[block == k], y[block == k]) for k in range(BLOCKS)]
    gram, moment = x.T @ x + RIDGE * len(y) * np.eye(x.shape[1]), x.T @ y
    rest = [b - a @ np.linalg.solve(gram - a.T @ a, moment - a.T @ b) for a, b in parts]
    return float(np.mean(np.concatenate(rest) ** 2)) + 1e-8


def logged(paths: list[str]) -> tuple[Floats, Floats]:
    """Motion of all axes, (3, axes, n), and their currents, (axes, n), of runs."""
    if not paths:
        msg = "no run was named: python arm.py RUN.parquet ..."
        raise InputError(msg)
    runs = [Run(Path(path)) for path in paths]
    axes = sorted(set.intersection(*(set(run.positions) for run in runs)))
    fed = [axis for axis in axes if all(f"axis{axis}_current" in run.columns for run in runs)]
    if len(fed) < max(len(axes) / 2, 2):
        msg = f"{paths[0]}: an arm is found from the positions and currents of all axes: log them"
        raise InputError(msg)
    if axes != list(range(1, len(axes) + 1)) or len(axes) > len(STARTS[0]):
        msg = (
            f"{paths[0]}: holds axes {', '.join(map(str, axes))}; an arm of axes 1 to n, of "
            f"{len(STARTS[0])} at most, is found: number them so from the base on"
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
    moving = (np.abs(motion[1]) > 0.02 * np.abs(motion[1]).max(axis=1)[:, None]).any(axis=0)
    if np.count_nonzero(moving) < SAMPLES:
        msg = f"{paths[0]}: {np.count_nonzero(moving)} samples of motion, {SAMPLES} are needed"
        raise InputError(msg)
    return motion[:, :, moving], current[:, moving]


def main(paths: list[str]) -> None:
    """Write what runs tell into this file, and say what it leaves of each axis's current."""
    try:
        finder = Finder(*logged(paths))
    except OpamcError as error:
        sys.exit(f"{error}")
    letters, ways = finder.found()
    shares = np.sqrt(finder.left(letters, ways))
    told = ", ".join(f"{k + 1} {share:.1%}" for k, share in zip(finder.joints, shares, strict=True))
    if np.median(shares) > MOST_LEFT:
        sys.exit(
            f"{paths[0]}: does not tell where the joints are (best, {letters}, leaves of the "
            f"current of axis {told}); log a longer program in which all axes move, or write them"
        )
    rows = []
    for way, turned, axis in _as_joints(letters, ways):
        xyz, rpy = (", ".join(f"{one + 0.0:.3f}" for one in some) for some in (way, turned))
        rows.append(f"    (({xyz}), ({rpy}), ({', '.join(f'{one:.0f}' for one in axis)})),\n")
    here = Path(__file__)
    text = re.sub(r"(?ms)^JOINTS = \(.*?^\)\n", f"JOINTS = (\n{''.join(rows)})\n", here.read_text())
    here.write_text(text)
    print(f"{here}: axes at zero {letters}; left of the current, of axis {told}")


if __name__ == "__main__":
    main(sys.argv[1:])
