"""Where an arm's joints are, from the currents of them all."""

import numpy as np

from opamc_cli.arm.torques import (
    GRAVITY_M_S2,
    PARAMETERS,
    Floats,
    JointPlace,
    KinematicChain,
    torques,
)
from opamc_cli.joint.motion.kinematics import SLOWEST_SHARE

STARTS = ("zyyyzyx", "zyyyzxz", "zyyxyxy", "zyyzyzy", "zyzyzyz", "zyxyxyx", "yyyyyyy")
"""What the axes are parallel to where all are at zero: arms whose three middle ones are parallel,
with a spherical wrist, of seven axes; planar ones. Those that are found may be any others."""
MOST_AXES = len(STARTS[0])
WAYS = dict(zip("xyzXYZ", np.vstack([np.eye(3), 0 - np.eye(3)]).tolist(), strict=True))
"""A capital letter's axis turns the other way."""
SAMPLES, FEWEST, BLOCKS = 500, 250, 6
"""Looked at; needed, ten seconds at 25 Hz; left out in turn."""
FITTED, ROUGH, FINE = 6, 3, 8
"""So many of the best words without lengths get some, in so many steps, the best of them finer."""
RIDGES = (1e-7, 1e-5, 1e-3)
"""Of links' parameters, in the current's deviation: blocks left out are predicted by the best, for
each joint by itself. By the least alone those of a measured arm's twenty seconds are extrapolated,
and its last axis is found along x; by the largest the wrists of simulated ones are lost."""
LONG = 0.02
"""Likewise, of ways from axis to axis (m) and zeros (rad)."""


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
        n = motion.shape[2]
        some = np.linspace(0, n - 1, min(SAMPLES, n)).astype(int)
        self.motion = motion[:, :, some]
        self.known: dict[tuple[str, bytes], Floats] = {}
        self.joints = {}
        """Of each that moves: at which samples, its own friction, its current."""
        alone, travel = [], np.ptp(self.motion[0], axis=1)
        for joint, (q, v, a) in enumerate(self.motion.swapaxes(0, 1)):
            moves = np.abs(v) > SLOWEST_SHARE * np.abs(v).max()
            moves &= bool(travel[joint] > SLOWEST_SHARE * travel.max())
            y = current[joint, some][moves]
            if moves.sum() > SAMPLES / 10 and np.isfinite(y).all() and np.ptp(y) > 0:
                own = _friction(q[moves], v[moves], a[moves])
                y = (y - y.mean()) / y.std()
                self.joints[joint] = moves, own, y
                weight = np.sin(q[moves]), np.cos(q[moves])
                alone.append(_held_out(np.column_stack([own, *weight]), y))
        self.alone = np.array(alone)
        """Share of each one's mean square that it leaves in blocks left out without an arm, by each
        ridge; (joints that move, ridges)."""

    def found(self) -> tuple[str, Floats]:
        """Return the axes' letters, and the way to each and its zero, (joints, 4).

        To the first there is no way that its torque tells of: there it is where up is.
        """
        none = np.zeros((self.motion.shape[1], 4))
        starts = {start[: len(none)] for start in STARTS}
        for word in sorted(starts, key=lambda one: self.score(one, none))[:2]:
            self.exchanged(word, none)
        # Mirror images are as good as each other; what turns the other way is hardly worse.
        words = {round(self.score(word, none), 6): word for word, _ in list(self.known)}
        tried = [words[score] for score in sorted(words)[:FITTED]]
        ways = {word: self.fitted(word, none, ROUGH) for word in tried}
        word = min(tried, key=lambda one: self.score(one, ways[one]))
        best, ways_of_best, least, found = "", none, np.inf, ways[word]
        while (
            word != best
        ):  # Where nothing fits, what is exchanged leaves no less once it is fitted.
            found = self.fitted(word, found, FINE)
            if self.score(word, found) >= least:
                break
            best, ways_of_best, least = word, found, self.score(word, found)
            word = self.exchanged(word, found)
        return best, ways_of_best

    def score(self, letters: str, ways: Floats) -> float:
        """Sum the logarithms of what is left of each joint's current."""
        return float(np.log(self.left(letters, ways)).sum())

    def left(self, letters: str, ways: Floats) -> Floats:
        """Return the share of each joint's mean square that is left in blocks left out."""
        key = letters, ways.tobytes()
        if key not in self.known:
            designs = self._designs(letters, ways)
            pairs = zip(designs, self.joints.values(), strict=True)
            self.known[key] = np.array([_held_out(x, y).min() for x, (_, _, y) in pairs])
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

    def fitted(self, letters: str, ways: Floats, steps: int) -> Floats:
        """Fit ways and zeros, beside links' parameters that are best for each."""
        from scipy.optimize import least_squares  # 0.2 s, which a joint by itself does not need

        sizes = np.sqrt(self.left(letters, ways))

        def left(free: Floats) -> Floats:
            designs = self._designs(letters, free.reshape(-1, 4))
            found = [LONG * free]
            for x, size, (_, _, y) in zip(designs, sizes, self.joints.values(), strict=True):
                held = np.linalg.solve(x.T @ x + RIDGES[0] * len(y) * np.eye(x.shape[1]), x.T @ y)
                found.append((y - x @ held) / (size * np.sqrt(len(y))))
            return np.concatenate(found)

        free = least_squares(left, ways.ravel(), max_nfev=steps, x_scale=0.2).x
        return np.asarray(free.reshape(-1, 4))

    def _designs(self, letters: str, ways: Floats) -> list[Floats]:
        asked = torques(chain_of(letters, ways), self.motion)
        found = []
        for joint, (moves, own, _) in self.joints.items():
            links = asked[joint][moves]
            # A mass is first moments of the links before it.
            links = np.delete(links, np.arange(0, links.shape[1], PARAMETERS), axis=1)
            found.append(np.hstack([own, links / GRAVITY_M_S2]))
        return found


def chain_of(letters: str, ways: Floats) -> KinematicChain:
    """Return the chain of axes along letters, with ways to them and zeros, (joints, 4).

    The first one's way is how far off z up is.
    """
    places, (right, ahead, *_) = [], ways[0].tolist()
    ways = np.vstack([[0.0, 0.0, 0.0, ways[0, 3]], ways[1:]])
    for letter, (*way, zero) in zip(letters, ways.tolist(), strict=True):
        x, y, z = WAYS[letter]
        places.append(JointPlace(tuple(way), (zero * x, zero * y, zero * z), (x, y, z)))
    return KinematicChain(tuple(places), (right, ahead, 1.0))


def _friction(q: Floats, v: Floats, a: Floats) -> Floats:
    """Rotor and friction of any place and speed: whatever a joint has is not to pass for links."""
    place = (q - q.min()) / np.ptp(q) * 4
    sign, speed = np.sign(v), np.abs(v) / np.abs(v).max()
    at = np.clip(1 - np.abs(place[:, None] - np.arange(5)), 0, None) * sign[:, None]
    own = np.column_stack([np.ones(q.size), a, v, v * np.abs(v), sign * np.exp(-10 * speed), at])
    return np.asarray(own / (np.sqrt(np.mean(own**2, axis=0)) + 1e-9))


def _held_out(x: Floats, y: Floats) -> Floats:
    """Mean square of what blocks that are left out in turn keep, by each ridge; (ridges,)."""
    block = np.arange(len(y)) * BLOCKS // len(y)
    parts = [(x[block == k], y[block == k]) for k in range(BLOCKS)]
    grams = np.stack([a.T @ a for a, _ in parts])
    moments = np.stack([a.T @ b for a, b in parts])
    others, more = moments.sum(0) - moments, len(y) * np.eye(x.shape[1])
    left = []
    for ridge in RIDGES:
        held = np.linalg.solve(grams.sum(0) + ridge * more - grams, others[:, :, None])
        rest = [b - a @ own[:, 0] for (a, b), own in zip(parts, held, strict=True)]
        left.append(np.mean(np.concatenate(rest) ** 2))
    return np.array(left) + 1e-8
