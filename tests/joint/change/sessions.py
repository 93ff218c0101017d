"""Sessions of one joint on one program, by formulas: what is compared before and after a change."""

import numpy as np
from closing import moved

from opamc_cli.joint.change.units import read_side
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Joint

LIBRARY = built_in_library()
DECLARED = ("inertia", "gravity", "coulomb", "viscous", "offset")
TERMS = tuple(Term(LIBRARY[name], {}) for name in DECLARED)
COEFFICIENTS = np.array([0.2, 1.0, 0.4, 0.5, 0.3, 0.1])
"""Of the acceleration, both parts of gravity, dry and viscous friction, and an offset, in A."""
RATE = 100.0
JOINT = Joint(50.0, 4)


def recordings(count, extra=None, seed=0, spread=0.02, noise_a=0.02, temperature=None, rate=RATE):
    """Record sessions whose friction differs by a share `spread`; `extra` adds to the current."""
    rng = np.random.default_rng(seed)
    q, v, a = moved("cyclic", rate, 16.0)
    t = np.arange(q.size) / rate
    columns = np.stack([a, np.sin(q), np.cos(q), np.sign(v), v, np.ones(q.size)], axis=1)
    made = []
    for number in range(count):
        own = COEFFICIENTS * (1 + spread * np.array([0, 0, 0, 1, 1, 0]) * rng.normal(size=6))
        current = columns @ own + rng.normal(0, noise_a, q.size)
        if extra is not None:
            current += extra(q, v, a, t)
        warm = None if temperature is None else np.full(q.size, temperature + 0.1 * number)
        made.append(
            Recording(f"{number}", rate, current_a=current, position_rad=q, temperature_c=warm)
        )
    return made


def units_of(extra=None, before=4, after=3, joint=JOINT, cycles=False, colder=None, **options):
    """Read a healthy baseline and a target with something more, as units."""
    warmth = [None, None] if colder is None else [25.0, 25.0 - colder]
    old = recordings(before, None, 1, temperature=warmth[0], **options)
    new = recordings(after, extra, 2, temperature=warmth[1], **options)
    sides = (old, False), (new, True)
    return [unit for side, late in sides for unit in read_side(side, joint, late, cycles)]
