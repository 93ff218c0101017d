"""Simulate a joint and close the loop on it."""

from dataclasses import replace

import numpy as np
from simulator import DECLARED, simulate

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.explain.declared import Ways
from opamc_cli.joint.fit.model import Term, dataset_of, fit_terms
from opamc_cli.joint.loop import close_loop
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.recordings import grouped_track
from opamc_cli.joint.motion.track import Joint


def close_on(seed, effects, ratio=0.8, without=(), **options):
    base = tuple(name for name in DECLARED if name not in effects)
    made = simulate(seed, effects, ratio, declared=base, **options)
    return close_recording(made, made.current, base, without, seed)


def close_recording(made, current, base=DECLARED, without=(), seed=0):
    recording = Recording(
        "run",
        made.rate_hz,
        current_a=current,
        position_rad=made.position,
        temperature_c=made.temperature,
    )
    joint = Joint(made.gear_ratio, made.pole_pairs)
    ways = Ways([recording], joint, terms_of(base))
    return made, close_loop(ways.best_fit(), built_in_library(without), seed, ways=ways)


def fit_declared(recordings, joint=None, base=DECLARED):
    fitted = Ways(recordings, joint or Joint(), terms_of(base)).best_fit()
    assert fitted is not None
    return fitted


def terms_of(names):
    library = built_in_library()
    return lambda dataset: tuple((library[name], None) for name in names)


def plain_fit(recording, base=DECLARED, averaged=True):
    """Fit the declared model to a motion differentiated as its own noise asks for.

    As if by differences over three samples, beside which nothing is averaged, if not `averaged`.
    """
    track, grouping = grouped_track([recording], Joint())
    track = track if averaged else replace(track, kernel=np.ones(1))
    library = built_in_library()
    return fit_terms(dataset_of(track, grouping), tuple(Term(library[name], {}) for name in base))


MODEL = {"coulomb": 0.5, "viscous": 0.3}
"""Declared with an inertia of 0.2 A s² and a weight of 1 A, which `joint_of` adds as well."""

MOTIONS = ("one stroke", "cyclic", "steps of torque")


def moved(motion, rate=250.0, seconds=30.0, seed=40):
    """Position, speed and acceleration of a motion, by formulas."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    if motion == "one stroke":
        # Forwards all the time, at speeds that never repeat: no place is passed twice.
        waves = [(0.6, 0.8, 0.0), (0.3, 1.93, 1.0)]
        v = 0.15 * (1 + sum(a * np.sin(w * t + p) for a, w, p in waves))
        a = 0.15 * sum(a * w * np.cos(w * t + p) for a, w, p in waves)
        return 0.15 * (t - sum(a / w * np.cos(w * t + p) for a, w, p in waves)), v, a
    if motion == "cyclic":
        w, parts = 2 * np.pi / (seconds / 8), [(0.7, 1, 0.3), (0.4, 2, 1.0), (0.2, 3, 2.0)]
        q = sum(a * np.sin(k * w * t + p) for a, k, p in parts)
        v = sum(a * k * w * np.cos(k * w * t + p) for a, k, p in parts)
        return q, v, -sum(a * (k * w) ** 2 * np.sin(k * w * t + p) for a, k, p in parts)
    # Steps of the acceleration: every speed is reached in a second, or in half of one.
    step_s, top = (0.5, 1.2) if motion == "hard reversals" else (1.0, 0.6)
    a, speed = np.zeros(t.size), 0.0
    for piece in np.array_split(np.arange(t.size), round(seconds / step_s)):
        wanted = rng.uniform(top / 6, top) * (-1) ** rng.integers(2)
        a[piece] = (wanted - speed) / step_s
        speed += float(a[piece].sum()) / rate
    v = np.cumsum(a) / rate - a / rate
    return np.cumsum(v + 0.5 * a / rate) / rate - (v[0] + 0.5 * a[0] / rate) / rate, v, a


def slow_stroke(inertia, quantum=1e-5, noise_a=0.02, rate=250.0, seed=1):
    """Record one slow stroke there and back: it accelerates for 0.1 s, four times."""
    t = np.arange(round(12 * rate)) / rate
    there = 0.3 * np.clip(np.minimum(t - 0.3, 11.7 - t) / 0.1, 0, 1)
    v = np.concatenate([there, np.zeros(round(0.3 * rate)), -there])
    q = np.cumsum(v) / rate - 1.5
    columns = [np.gradient(v) * rate, np.sin(q), np.cos(q), np.sign(v), v]
    current = np.stack(columns, 1) @ [inertia, 1.0, 0.4, MODEL["coulomb"], MODEL["viscous"]]
    current += np.random.default_rng(seed).normal(0, noise_a, q.size)
    return Recording("run", rate, current_a=current, position_rad=np.round(q / quantum) * quantum)


def joint_of(motion, effect, strength=15.0, noise_a=0.02, **options):
    """Record a joint whose current lacks nothing, or one shape of `strength` times the noise.

    Parameters
    ----------
    motion : str
        Of `MOTIONS`.
    effect : callable or None
        Current of shape (n,) over position, speed, acceleration and time.
    strength : float
        Root mean square of what the declared model leaves of the effect, in units of the noise.
    """
    rate = options.pop("rate", 250.0)
    q, v, a = moved(motion, rate, **options)
    t = np.arange(q.size) / rate
    columns = np.stack([a, np.sin(q), np.cos(q), np.sign(v), v], axis=1)
    current = columns @ [0.2, 1.0, 0.4, MODEL["coulomb"], MODEL["viscous"]]
    if effect is not None:
        shape = effect(q, v, a, t)
        left = shape - columns @ np.linalg.lstsq(columns, shape)[0]
        current = current + strength * noise_a / np.std(left) * shape
    noise = np.random.default_rng(7).normal(0, noise_a, q.size)
    return Recording("run", rate, current_a=current + noise, position_rad=q)
