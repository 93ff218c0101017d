"""Segments of a program of four motions."""

import numpy as np

from opamc_cli.signal.cycles.features import SegmentFeatures

# one cycle of four motions: variance, duration, f_max, direction, pause before
CYCLE = [(4.0, 1.0, 314.0, 1, 0.5), (3.5, 0.6, 300.0, 1, 0.3), (4.2, 1.0, 314.0, -1, 0.3),
         (3.3, 0.6, 300.0, -1, 0.3)]  # fmt: skip


def series(rows, noise=0.02, seed=0):
    rng = np.random.default_rng(seed)
    values = np.array(rows, dtype=float)
    values[:, :3] *= 1 + noise * rng.normal(size=(len(rows), 3))
    return SegmentFeatures(*values[:, :3].T, values[:, 3].astype(int), values[:, 4])
