"""The loop on the virtual testbed, every effect in turn: `benchmarks/loop.py --testbed`.

The recordings are those of the tests (`sources/testbed_closing.py`): the joint of
configs/closing.yaml, about 40 s at 1024 Hz. The oracle is the same session without the effect.
"""

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "sources"))
from testbed_closing import EFFECTS, SENSING, close_on_testbed, error_on, names_of, record

from opamc_cli.joint.fit.model import Fit


@dataclass(frozen=True)
class Closing:
    """One closed loop on one session."""

    named: bool
    added: tuple[str, ...]
    untestable: bool
    verdict: str
    before_a: float
    after_a: float
    floor_a: float


def close_one(effect: str, sensing: str, seed: int, healthy: Fit) -> Closing:
    """Switch an effect on and close the loop."""
    loop = close_on_testbed((effect,), sensing, seed)
    return Closing(
        named=any(effect in names for names in names_of(loop)),
        added=tuple(step.term.effect.name for step in loop.steps if step.named),
        untestable=effect in loop.untestable,
        verdict=loop.verdict,
        before_a=loop.rmse_before_a,
        after_a=loop.rmse_after_a,
        floor_a=error_on(healthy, loop),
    )


def print_row(effect: str, sensing: str, closings: list[Closing]) -> None:
    """One line of the table."""
    if all(closing.untestable for closing in closings):
        print(f"| `{effect}` | {sensing} | untestable | | | | | |", flush=True)
        return
    found = [closing for closing in closings if closing.added]
    named = [closing for closing in found if closing.named]
    extra = sum(len(closing.added) - closing.named for closing in closings)
    before, after, floor = (
        float(np.median([getattr(closing, name) for closing in closings]))
        for name in ("before_a", "after_a", "floor_a")
    )
    start = f"| `{effect}` | {sensing} | {len(found)} of {len(closings)} | {len(named)} | {extra} "
    errors = f"| {before:.4f} → {after:.4f} | {floor:.4f} "
    shares = [(c.before_a - c.after_a) / (c.before_a - c.floor_a) for c in found]
    share = f"{np.median(shares):.0%}" if shares else ""
    print(f"{start}{errors}| {share} |", flush=True)


def run(seeds: range, removed_seeds: range, *, verbose: bool) -> None:
    """Print the table of all effects and what is logged, and what becomes of removed effects.

    Parameters
    ----------
    seeds : range
        Of the sessions.
    removed_seeds : range
        Of the sessions whose effect is taken out of the library.
    verbose : bool
        Print every closing that is not as it should be.
    """
    began = time.time()
    healthy: dict[tuple[str, int], Fit] = {}
    wrong = silent = 0
    for sensing in SENSING:
        for seed in seeds:
            loop = close_on_testbed((), sensing, seed)
            healthy[sensing, seed] = loop.before
            wrong += any(step.named for step in loop.steps)
            silent += loop.verdict == "nothing-missing"
            if verbose and loop.verdict != "nothing-missing":
                print(f"  healthy {sensing} {seed}: {loop.verdict} {names_of(loop)}")
    total = len(SENSING) * len(seeds)
    print(
        f"seeds {seeds.start} to {seeds.stop - 1}\nhealthy: wrong additions {wrong} of {total}, "
        f"verdict nothing-missing {silent} of {total}\n"
    )
    print(
        "| effect | logged | found | named | wrong extra | sealed error, A | floor | of the fall |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for effect in EFFECTS:
        record.cache_clear()
        for sensing in SENSING:
            closings = [close_one(effect, sensing, s, healthy[sensing, s]) for s in seeds]
            print_row(effect, sensing, closings)
            for seed, closing in zip(seeds, closings, strict=True):
                as_it_should = closing.untestable or (closing.named and len(closing.added) == 1)
                if verbose and not as_it_should:
                    print(f"  {effect} {sensing} {seed}: {closing.added} {closing.verdict}")
    print("\n| removed | logged | not-in-library | other names given | domains |")
    print("|---|---|---|---|---|")
    for effect in EFFECTS:
        for sensing in ("position and current", "phases"):
            loops = [
                close_on_testbed((effect,), sensing, seed, without=(effect,))
                for seed in removed_seeds
            ]
            told = sum(loop.verdict == "not-in-library" for loop in loops)
            others = sorted(
                {step.term.effect.name for loop in loops for step in loop.steps if step.named}
            )
            domains = sorted({loop.remaining_domain or "none" for loop in loops})
            print(
                f"| `{effect}` | {sensing} | {told} of {len(loops)} | {', '.join(others)} "
                f"| {', '.join(domains)} |",
                flush=True,
            )
    print(f"{time.time() - began:.0f} s")
