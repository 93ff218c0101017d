"""What the links of an arm ask of one of its joints, as effects."""

from functools import cache

import numpy as np

from opamc_cli.arm.torques import PARAMETERS, KinematicChain, torques
from opamc_cli.errors import ConfigError
from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.effects.library import Library
from opamc_cli.joint.effects.payload_change import PayloadChange
from opamc_cli.joint.motion.track import Floats, Ints, Track

INDEPENDENT = 1e-9
"""Share of the strongest: weaker combinations of the links' parameters never reach the joint."""
RANDOM = 400
"""Poses and motions that tell which parameters do; 70 columns at most are told apart."""
WEIGHT = slice(-PARAMETERS, 4 - PARAMETERS)
"""Mass and first moments of the last link."""


class Arm(Effect):
    """Torque by the inertial parameters of every link from the joint outwards.

    It is linear in mass, first moments and inertias (Atkeson, An, Hollerbach, Estimation of
    inertial parameters of manipulator loads and links, 1986). Combinations that no motion tells
    apart are left out: the rest are the base parameters (Gautier, 1991), of which the regressors of
    a random motion tell. Of those each is laid off the ones before it (QR): in whatever order they
    are computed, a closed model's coefficients belong to the same.
    """

    name = "arm"
    domain = "acceleration"
    origin = "load"
    meaning = "what the arm's links ask: no fault"
    needs = ("position", "others")
    from_motion = True
    carries_load = True

    def __init__(self, chain: KinematicChain) -> None:
        self.chain = chain

    def columns_at(self, track: Track, parameters: Parameters, rows: Ints) -> Floats:
        """Regressors at some samples; ConfigError where not all axes are logged."""
        return _asked(self.chain, track, rows, slice(None))


class ArmPayload(PayloadChange):
    """Weight that the last link carries from some time on: its mass and first moments.

    The arm's own torques are known, so no place has to be passed twice to tell time from place.
    """

    needs = ("scale", "others")

    def __init__(self, chain: KinematicChain) -> None:
        self.chain = chain

    def untestable(self, track: Track) -> str | None:
        """Nor does it show in an upright joint that carries it around no point but its own."""
        why = super().untestable(track)
        asks = why is not None or _asked(self.chain, track, np.arange(1), WEIGHT).size
        return why if asks else "a weight in the gripper asks nothing of this joint"

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Return what a weight in the gripper asks of this joint while it is there."""
        held = np.hypot(*super().columns(track, parameters)[:, :2].T)
        asked = _asked(self.chain, track, np.arange(track.size), WEIGHT)
        return np.asarray(held[:, None] * asked)


def arm_effects(chain: KinematicChain) -> Library:
    """Return the effects that know where an arm's joints are, by name."""
    return {effect.name: effect for effect in (Arm(chain), ArmPayload(chain))}


def _asked(chain: KinematicChain, track: Track, rows: Ints, some: slice) -> Floats:
    """Independent torques of the joint by some of the links' parameters, at some samples."""
    axes = range(1, len(chain.joints) + 1)
    own = [axis for axis in axes if axis not in track.other_axes]
    if track.others is None or len(own) != 1:
        msg = (
            f"effect 'arm' has {len(chain.joints)} joints, and the positions logged beside this "
            f"one are those of axes {', '.join(map(str, track.other_axes)) or 'none'}: log all"
        )
        raise ConfigError(msg)
    joint = own[0] - 1
    motion = np.empty((3, len(chain.joints), rows.size))
    motion[:, joint] = [
        part[rows] for part in (track.position_rad, track.velocity, track.acceleration)
    ]
    for place, axis in enumerate(track.other_axes):
        if axis in axes:
            motion[:, axis - 1] = track.others[rows, place :: len(track.other_axes)].T
    kept, base = _base(chain, joint, some.start, some.stop)
    return np.asarray(torques(chain, motion, joint)[0][:, some][:, kept] @ base)


@cache
def _base(
    chain: KinematicChain, joint: int, start: int | None, stop: int | None
) -> tuple[Ints, Floats]:
    """Which of some parameters reach a joint, and their independent combinations."""
    any_motion = np.random.default_rng(0).uniform(-3, 3, (3, len(chain.joints), RANDOM))
    sample = torques(chain, any_motion, joint)[0][:, start:stop]
    size = np.linalg.norm(sample, axis=0)
    kept = np.flatnonzero(size > INDEPENDENT * size.max())
    told = np.abs(np.diag(np.linalg.qr(sample[:, kept] / size[kept], mode="r")))
    kept = kept[told > INDEPENDENT]
    root = np.linalg.qr(sample[:, kept], mode="r")
    return kept, np.linalg.inv(root) * np.sign(np.diag(root))
