"""The plain rival of the loop: least squares, a coarse dictionary, leaving blocks out. A few pages.

    python benchmarks/plain.py joint.csv --rate 1000 --position Position5 --current Cur5

Nothing here is whitened, guarded or tuned to a noise, and nothing comes from the package. Twelve
blocks of the moving samples, three of them sealed. Then, again and again: every effect on a
coarse grid, and the two strongest lines of the residual over angle and over time, are ranked by
the drop of the open mean square; the best of each effect are fitted leaving blocks out. With one
chain (`stepwise`) the largest held-out drop is taken while it is at least 6 % with t > 2; with four
(`beam`) the chains compete by ln(held-out mean square) + 0.02 per degree of freedom.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, savgol_filter

Floats = NDArray[np.float64]
BLOCKS, SEALED = 12, (2, 5, 9)  # neither the first nor the last, and the same as the loop
WINDOWS_S = (0.01, 0.02, 0.05, 0.12)  # of the differentiation: what fits best when left out
MOST_SAMPLES = 10_000  # more are thinned at random, which folds no line onto another
STEP_SHARE, STEP_T = 0.06, 2.0  # the stepwise search
CHAINS, BEAM_SHARE, PRICE = 4, 0.05, 0.02  # the beam
MOST_STEPS, BEST_OF_EACH = 10, 2
FEWEST_WAVES = 4.0  # fewer over the whole travel, or time, are a trend and not a line
TIE_ERRORS = 1.0  # standard errors over the blocks
SEVERAL = {"ripple", "mains_hum", "position_drag"}  # the others are added once
DECLARABLE = ("inertia", "gravity", "offset", "coulomb", "viscous")


@dataclass(frozen=True)
class Signals:
    """One recording, shape (n,) each: A (signed), rad, rad/s, degrees C; joint side."""

    rate_hz: float
    current: Floats
    position: Floats
    velocity: Floats | None = None
    temperature: Floats | None = None


@dataclass(frozen=True)
class Term:
    """A named effect: its columns at the samples in use, and how many parameters were searched."""

    name: str
    parameters: dict[str, float | str]
    columns: Floats
    searched: int


@dataclass(frozen=True)
class Chain:
    """Terms, their held-out squares per open block, and the degrees of freedom added."""

    terms: tuple[Term, ...]
    errors: Floats
    freedom: int = 0
    ties: tuple[tuple[str, ...], ...] = ()

    @property
    def score(self) -> float:
        """The lower, the better."""
        return float(np.log(self.errors.sum()) + PRICE * self.freedom)


@dataclass(frozen=True)
class Result:
    """Sealed root mean square error [A] and r2 before and after, and what was added, in order."""

    before: float
    after: float
    r2_before: float
    r2_after: float
    names: list[str]
    parameters: list[dict[str, float | str]]
    ties: list[list[str]]
    held_out: float
    seconds: float


@dataclass(frozen=True)
class Motion:
    """The moving samples in use, shape (n,).

    `full` is (q, v, a) of each recording at every sample, `rows` which of those are in use.
    """

    rate_hz: float
    time: Floats
    current: Floats
    q: Floats
    v: Floats
    a: Floats
    temperature: Floats | None
    block: NDArray[np.int64]
    rows: NDArray[np.int64]
    full: list[tuple[Floats, Floats, Floats]]

    @cached_property
    def sign(self) -> Floats:
        """Direction."""
        return np.sign(self.v)

    @cached_property
    def top(self) -> float:
        """Top speed."""
        return float(np.quantile(np.abs(self.v), 0.98))

    @cached_property
    def sealed(self) -> NDArray[np.bool_]:
        """Which samples nothing is fitted to or chosen on."""
        return np.isin(self.block, SEALED)


def motion(recordings: Sequence[Signals], window_s: float, *, logged: bool) -> Motion:
    """Differentiate by Savitzky-Golay, the logged speed or the position; cut into blocks, thin."""
    rate = recordings[0].rate_hz
    window = max(5, int(window_s * rate) // 2 * 2 + 1)
    full = []
    for r in recordings:
        q, v, a = (savgol_filter(r.position, window, 3, d, 1 / rate) for d in range(3))
        if logged and r.velocity is not None:
            v, a = (savgol_filter(r.velocity, window, 2, d, 1 / rate) for d in range(2))
        full.append((q, v, a))
    q, v, a = (np.concatenate(channel) for channel in zip(*full, strict=True))
    speed = np.abs(v)
    rows = np.flatnonzero(speed > 0.02 * np.quantile(speed, 0.99))
    block = np.arange(rows.size) * BLOCKS // rows.size
    if rows.size > MOST_SAMPLES:
        kept = np.sort(np.random.default_rng(0).permutation(rows.size)[:MOST_SAMPLES])
        rows, block = rows[kept], block[kept]
    warm = [r.temperature for r in recordings]
    temperature = None if any(t is None for t in warm) else np.concatenate(warm)[rows]  # type: ignore[arg-type]
    current = np.concatenate([r.current for r in recordings])[rows]
    return Motion(
        rate, rows / rate, current, q[rows], v[rows], a[rows], temperature, block, rows, full
    )


def declared_columns(m: Motion) -> dict[str, Floats]:
    one = np.ones_like(m.q)
    columns = {
        "inertia": [m.a], "gravity": [np.sin(m.q), np.cos(m.q)], "offset": [one],
        "coulomb": [m.sign], "viscous": [m.v],
    }  # fmt: skip
    return {name: np.stack(parts, axis=1) for name, parts in columns.items()}


def declared_terms(m: Motion, names: Sequence[str]) -> list[Term]:
    columns = declared_columns(m)
    terms = [Term(name, {}, columns[name], 0) for name in names]
    return terms or [Term("nothing", {}, np.zeros((m.q.size, 1)), 0)]


def dictionary(m: Motion) -> Iterator[Term]:
    """Effects whose columns follow from the motion alone, on coarse grids of their parameters."""
    low, travel, length = float(m.q.min()), float(np.ptp(m.q)), float(m.time[-1])
    begun = m.time - m.time[0]

    def term(name: str, parameters: dict[str, float | str], *columns: Floats) -> Term:
        return Term(name, parameters, np.stack(columns, axis=1), len(parameters))

    for name, columns in declared_columns(m).items():
        yield Term(name, {}, columns, 0)
    for share in (0.02, 0.04, 0.07, 0.12, 0.2, 0.33):
        for power in (1.0, 2.0):
            shape = m.sign * np.exp(-((np.abs(m.v) / (share * m.top)) ** power))
            found = term("stribeck", {"speed": share * m.top, "exponent": power}, shape)
            yield replace(found, searched=1)
    yield term("quadratic_friction", {}, m.v * np.abs(m.v))
    for power in (0.2, 0.4, 0.6, 0.75):
        yield term("sublinear_friction", {"exponent": power}, m.sign * np.abs(m.v) ** power)
    yield term("asymmetric_friction", {}, np.ones_like(m.v), np.abs(m.v))
    yield term("asymmetric_friction", {}, np.abs(m.v))
    yield term("spring", {}, m.q, np.ones_like(m.q))
    if m.temperature is not None and np.ptp(m.temperature) > 0:
        rise = m.temperature - m.temperature.mean()
        yield term("thermal_viscous", {}, m.v * rise)
        yield term("thermal_viscous", {}, m.v * rise, m.sign * rise)
    for share in (0.05, 0.1, 0.2, 0.4, 0.8, 1.5):
        fading = np.exp(-begun / (share * length))
        yield term("warmup", {"seconds": share * length}, fading * m.v)
        yield term("warmup", {"seconds": share * length}, fading * m.v, fading * m.sign)
    for share in np.arange(1, 12) / 12:
        after = (begun > share * (m.time[-1] - m.time[0])).astype(float)
        load = [after * np.sin(m.q), after * np.cos(m.q), after * m.a]
        yield term("payload_change", {"since": float(share * length)}, *load)
    for width in travel * np.array([0.02, 0.04, 0.08, 0.16]):
        for place in np.arange(low, low + travel, max(width, travel / 30)):
            bell = np.exp(-0.5 * ((m.q - place) / width) ** 2)
            where = {"place": float(place), "width": float(width)}
            yield term("position_drag", where, m.sign * bell)
            yield term("position_drag", where, bell, m.sign * bell)
    for share in (0.01, 0.03, 0.06, 0.12, 0.25):
        state = np.concatenate([presliding(q, share * travel) for q, _, _ in m.full])[m.rows]
        yield term("hysteresis", {"length": share * travel}, state)
    for hertz in np.geomspace(2.0, min(60.0, m.rate_hz / 6), 14):
        for damping in (0.04, 0.15):
            shapes = [rung(a, hertz, damping, m.rate_hz) for _, _, a in m.full]
            shape = np.concatenate(shapes)[m.rows]
            found = term("elasticity", {"hertz": float(hertz), "damping": damping}, shape)
            yield replace(found, searched=1)


def presliding(q: Floats, length: float) -> Floats:
    """State that follows the direction over a length of travel (Dahl)."""
    steps = np.diff(q, prepend=q[0])
    state, out = 0.0, np.empty_like(q)
    decay, side = np.exp(-np.abs(steps) / length), np.sign(steps)
    for k in range(q.size):
        state = side[k] + (state - side[k]) * decay[k] if side[k] else state
        out[k] = state
    return out


def rung(a: Floats, hertz: float, damping: float, rate_hz: float) -> Floats:
    """Acceleration of a sprung load less that of its drive, by the bilinear transform."""
    w, k = 2 * np.pi * hertz, 2 * rate_hz
    below = np.array([k * k + 2 * damping * w * k + w * w, 2 * w * w - 2 * k * k,
                      k * k - 2 * damping * w * k + w * w])  # fmt: skip
    return lfilter(np.array([1.0, 2.0, 1.0]) * w * w / below[0], below / below[0], a - a[0]) + (
        a[0] - a
    )


def following(m: Motion, terms: Sequence[Term], rest: Floats) -> Iterator[Term]:
    """Effects that follow from the present model: load, delay, lines of the residual."""
    open_ = ~m.sealed
    design = np.concatenate([t.columns for t in terms], axis=1)
    beta = solve(design[open_], m.current[open_])
    fitted = design @ beta
    carries = np.concatenate(
        [np.full(t.columns.shape[1], t.name in ("inertia", "gravity", "spring", "payload_change"))
         for t in terms]
    )  # fmt: skip
    load = design @ (beta * carries)
    for kind, torque in (("load", load), ("current", fitted)):
        if np.std(torque) > 0:
            yield Term("load_friction", {"of": kind}, (m.sign * np.abs(torque))[:, None], 0)
    for delay in (0.001, 0.002, 0.004, 0.008, 0.016, 0.032):
        for side in (1, -1):
            late = np.interp(m.time - side * delay, m.time, fitted) - fitted
            yield Term("time_delay", {"seconds": side * delay}, late[:, None], 1)
    scale = {"": None, "speed": np.abs(m.v) / m.top, "direction": m.sign, "load": load}
    highest = 0.4 * 2 * np.pi * m.rate_hz
    kinds = (("ripple", m.q, highest / m.top), ("mains_hum", m.time, highest))
    for name, angle, top in kinds:
        for order in lines(angle[open_], rest, top):
            waves = np.stack([np.cos(order * angle), np.sin(order * angle)], axis=1)
            for what, size in scale.items():
                both = waves if size is None else np.hstack([waves, size[:, None] * waves])
                unit = "order" if name == "ripple" else "frequency_hz"
                value = order if name == "ripple" else order / (2 * np.pi)
                yield Term(name, {unit: float(value), "times": what}, both, 1)


def lines(angle: Floats, rest: Floats, highest: float, count: int = 2) -> list[float]:
    """Strongest waves per radian (or second) of a residual: its sums over fine bins, transformed.

    A line's neighbours within three resolutions are its own feet.
    """
    span = float(np.ptp(angle))
    size = 1 << int(np.ceil(np.log2(max(4 * highest * span / np.pi, 16))))
    if size > 1 << 22:
        size = 1 << 22
    place = ((angle - angle.min()) / span * size).astype(np.int64)
    power = np.abs(np.fft.rfft(np.bincount(place, rest, size + 1), 4 * size)) ** 2
    order = np.arange(power.size) * 2 * np.pi / (4 * span)
    power[(order < FEWEST_WAVES * 2 * np.pi / span) | (order > highest)] = 0.0
    found = []
    for _ in range(count):
        best = int(np.argmax(power))
        if power[best] <= 0:
            break
        found.append(float(order[best]))
        power[max(best - 12, 0) : best + 13] = 0.0
    return found


def solve(design: Floats, wanted: Floats) -> Floats:
    """Least squares of columns of any size."""
    size = np.sqrt((design**2).mean(axis=0)) + 1e-300
    return np.linalg.lstsq(design / size, wanted, rcond=1e-9)[0] / size


def left_out(m: Motion, terms: Sequence[Term]) -> Floats:
    """Sum of squares of each open block, fitted without it."""
    design = np.concatenate([t.columns for t in terms], axis=1)
    design = design / (np.sqrt((design**2).mean(axis=0)) + 1e-300)
    errors, sums = [], []
    for b in np.unique(m.block[~m.sealed]):
        part, y = design[m.block == b], m.current[m.block == b]
        sums.append((part.T @ part, part.T @ y, y @ y))
    gram, moment = sum(s[0] for s in sums), sum(s[1] for s in sums)
    for own_gram, own_moment, power in sums:
        beta = np.linalg.lstsq(gram - own_gram, moment - own_moment, rcond=1e-10)[0]
        errors.append(power - 2 * own_moment @ beta + beta @ own_gram @ beta)
    return np.maximum(np.array(errors), 1e-300)


def shortlist(m: Motion, chain: Chain, library: list[Term]) -> list[tuple[Term, int]]:
    """Best of each effect by what its columns take from the open residual, with its freedom."""
    open_ = ~m.sealed
    design = np.concatenate([t.columns for t in chain.terms], axis=1)[open_]
    basis, size, _ = np.linalg.svd(design / np.linalg.norm(design, axis=0), full_matrices=False)
    basis = basis[:, size > 1e-9 * size[0]]
    rest = m.current[open_] - basis @ (basis.T @ m.current[open_])
    once = {t.name for t in chain.terms} - SEVERAL
    terms = [t for t in (*library, *following(m, chain.terms, rest)) if t.name not in once]
    columns = np.concatenate([t.columns for t in terms], axis=1)[open_]
    norms = np.linalg.norm(columns, axis=0) + 1e-300
    columns /= norms
    columns -= basis @ (basis.T @ columns)
    found: dict[str, list[tuple[float, Term, int]]] = {}
    start = 0
    for t in terms:
        part = columns[:, start : start + t.columns.shape[1]]
        start += t.columns.shape[1]
        values, vectors = np.linalg.eigh(part.T @ part)
        real = values > 1e-8  # the rest is in the model already
        if real.any():
            take = (vectors[:, real].T @ (part.T @ rest)) ** 2 / values[real]
            freedom = int(real.sum()) + t.searched
            found.setdefault(t.name, []).append((float(take.sum()), t, freedom))
    return [
        (t, freedom)
        for entries in found.values()
        for _, t, freedom in sorted(entries, key=lambda e: -e[0])[:BEST_OF_EACH]
    ]


def stepwise(m: Motion, declared: Sequence[Term], library: list[Term]) -> Chain:
    """Add the largest held-out drop while it matters."""
    chain = Chain(tuple(declared), left_out(m, declared))
    for _ in range(MOST_STEPS):
        best = chain
        for t, freedom in shortlist(m, chain, library):
            errors = left_out(m, (*chain.terms, t))
            drop = chain.errors - errors
            t_value = drop.mean() / (drop.std(ddof=1) / np.sqrt(drop.size) + 1e-300)
            matters = drop.sum() >= STEP_SHARE * chain.errors.sum() and t_value > STEP_T
            if matters and errors.sum() < best.errors.sum():
                best = Chain((*chain.terms, t), errors, chain.freedom + freedom)
        if best is chain:
            break
        chain = best
    return chain


def beam(m: Motion, declared: Sequence[Term], library: list[Term]) -> Chain:
    """Follow the four best chains side by side; at the end drop what is not worth its price."""
    chains = [Chain(tuple(declared), left_out(m, declared))]
    best = chains[0]
    for _ in range(MOST_STEPS):
        grown: dict[frozenset[str], Chain] = {}
        for chain in chains:
            trials = [
                Chain((*chain.terms, t), left_out(m, (*chain.terms, t)), chain.freedom + freedom)
                for t, freedom in shortlist(m, chain, library)
            ]
            for trial in trials:
                if trial.errors.sum() > (1 - BEAM_SHARE) * chain.errors.sum():
                    continue
                ties = {
                    o.terms[-1].name
                    for o in trials
                    if o.errors.sum() <= (1 - BEAM_SHARE) * chain.errors.sum()
                    and (d := o.errors - trial.errors).sum()
                    <= TIE_ERRORS * d.std(ddof=1) * np.sqrt(d.size)
                }
                told = (*chain.ties, tuple(sorted(ties - {trial.terms[-1].name})))
                key = frozenset(f"{t.name}{t.parameters}" for t in trial.terms)
                if key not in grown or trial.score < grown[key].score:
                    grown[key] = replace(trial, ties=told)
        if not grown:
            break
        chains = sorted(grown.values(), key=lambda c: c.score)[:CHAINS]
        best = min(best, chains[0], key=lambda c: c.score)
    first = len(declared)
    while len(best.terms) > first:
        shorter = []
        for k in range(first, len(best.terms)):
            terms = (*best.terms[:k], *best.terms[k + 1 :])
            ties = (*best.ties[: k - first], *best.ties[k - first + 1 :])
            own = best.terms[k].columns.shape[1] + best.terms[k].searched
            shorter.append(Chain(terms, left_out(m, terms), best.freedom - own, ties))
        cheapest = min(shorter, key=lambda c: c.score)
        if cheapest.score > best.score:
            break
        best = cheapest
    return best


def close(
    recordings: Sequence[Signals],
    declared: Sequence[str] = DECLARABLE,
    *,
    search: str = "beam",
    without: Sequence[str] = (),
) -> Result:
    """Find what the declared effects lack; the sealed blocks are opened once, at the end.

    Parameters
    ----------
    recordings : sequence of Signals
        In time order, all at one rate.
    declared : sequence of str
        Of `DECLARABLE`.
    search : {"beam", "stepwise"}
    without : sequence of str
        Effects that may not be added.

    Returns
    -------
    Result
    """
    began = time.process_time()
    ways = [False] + [True] * all(r.velocity is not None for r in recordings)
    motions = [motion(recordings, w, logged=logged) for w in WINDOWS_S for logged in ways]
    m = min(motions, key=lambda m: left_out(m, declared_terms(m, declared)).sum())
    start = declared_terms(m, declared)
    library = [t for t in dictionary(m) if t.name not in (*declared, *without)]
    chain = (beam if search == "beam" else stepwise)(m, start, library)
    sealed, open_ = m.sealed, ~m.sealed

    def rest(terms: Sequence[Term]) -> float:
        design = np.concatenate([t.columns for t in terms], axis=1)
        error = m.current - design @ solve(design[open_], m.current[open_])
        return float(np.mean(error[sealed] ** 2))

    power, before, after = float(np.var(m.current[sealed])), rest(start), rest(chain.terms)
    added = chain.terms[len(start) :]
    return Result(
        np.sqrt(before), np.sqrt(after), 1 - before / power, 1 - after / power,
        [t.name for t in added], [t.parameters for t in added],
        [list(t) for t in chain.ties] or [[] for _ in added],
        float(chain.errors.sum() / open_.sum()), time.process_time() - began,
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="+", help="CSV with a header, a row per sample")
    parser.add_argument("--rate", type=float, required=True, help="samples per second")
    parser.add_argument("--position", required=True, help="column, rad; whole turns are unwrapped")
    parser.add_argument("--current", required=True, help="column, A")
    parser.add_argument("--declared", default=",".join(DECLARABLE))
    arguments = parser.parse_args()
    recordings = []
    for file in arguments.files:
        table = np.genfromtxt(file, delimiter=",", names=True)
        position = np.unwrap(table[arguments.position])
        recordings.append(Signals(arguments.rate, table[arguments.current], position))
    for search in ("stepwise", "beam"):
        r = close(recordings, arguments.declared.split(","), search=search)
        print(f"{search}: {r.before:.4f} to {r.after:.4f} A in {r.seconds:.1f} s")
        for name, parameters, ties in zip(r.names, r.parameters, r.ties, strict=True):
            shown = " ".join(
                f"{k} {v:.5g}" if isinstance(v, float) else v for k, v in parameters.items()
            )
            print(f"  {name} {shown}" + "".join(f" ~{tie}" for tie in ties))


if __name__ == "__main__":
    main()
