"""Sessions of one joint on one program, by formulas: what is compared before and after a change."""

from dataclasses import replace

import numpy as np
from closing import moved

from opamc_cli.joint.change.units import read_side, side_by_side
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.fit.regressor_cache import RegressorCache
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
    """Lay a healthy baseline and a target with something more side by side."""
    warmth = [None, None] if colder is None else [25.0, 25.0 - colder]
    old = recordings(before, None, 1, temperature=warmth[0], **options)
    new = recordings(after, extra, 2, temperature=warmth[1], **options)
    return side_by_side(*(read_side(side, joint, cycles) for side in (old, new)))


def with_track(compared, **changes):
    """Change something of the track at the full rate, which stays as it is on the coarse one."""
    dataset = compared.dataset
    fine = replace(dataset.fine, track=replace(dataset.fine.track, **changes))
    dataset = replace(dataset, fine=fine, cache=RegressorCache())
    return replace(compared, dataset=dataset)


def with_coarse_current(compared, change):
    """Change the current on the coarse grid: `change` of the track and of each sample's unit."""
    dataset = compared.dataset
    track = dataset.coarse.track
    coarse = replace(dataset.coarse, track=replace(track, current_a=change(track, track.group)))
    return replace(compared, dataset=replace(dataset, coarse=coarse, cache=RegressorCache()))


def rows_of(compared, unit, fine=False):
    """Places of a unit's samples."""
    parts = compared.dataset.grid_of(fine).parts
    return parts.rows[slice(*parts.slices[unit])]


def columns_of(compared, terms, unit, fine=False):
    """Regressors of terms on a unit's samples."""
    track = compared.dataset.grid_of(fine).track
    columns = np.concatenate([term.columns(track) for term in terms], axis=1)
    return columns[rows_of(compared, unit, fine)]


def current_of(compared, unit, fine=False):
    """Return the current on a unit's samples."""
    return compared.dataset.grid_of(fine).track.current_a[rows_of(compared, unit, fine)]
