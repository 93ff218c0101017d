"""How often the loop adds what is not there, finds what is, and names it rightly.

    python benchmarks/loop.py [--quick] [--seeds N] [--first-seed 1000] [--mode position|phases]
    python benchmarks/loop.py --testbed [--quick] [--seeds N] [--first-seed 1000]

Every trial is a joint of the tests' own simulator: trajectory, rate, robot, noise colour and effect
are drawn from the seed. Tuning used seeds below 100 only; the default starts at 1000.
"""

import argparse
import sys
import time
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "joint"))
from simulator import DECLARED, EFFECTS, ELECTRICAL, Simulated, simulate

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.kinematics import Recording
from opamc_cli.joint.loop import Loop, close_loop, declared_fit
from opamc_cli.joint.model import open_session
from opamc_cli.joint.recordings import grouped_track
from opamc_cli.joint.track import Joint

PHASE_EFFECTS = (
    "stribeck", "ripple", "quadratic_friction", "sublinear_friction", "position_drag",
    "hysteresis", "load_friction", "offset", "warmup", "mains_hum", *ELECTRICAL,
)  # fmt: skip


class TooLittleError(Exception):
    """A simulated joint that cannot be sealed; `opamc model` would refuse it."""


@dataclass(frozen=True)
class Trial:
    """One closed loop, and what was true."""

    name: str
    simulated: Simulated
    loop: Loop

    @property
    def added(self) -> list[str]:
        """Effects that were added."""
        return [step.term.effect.name for step in self.loop.steps]

    @property
    def named(self) -> bool:
        """Whether a step or its ties hold the true name."""
        return any(
            self.name == step.term.effect.name or self.name in step.ties for step in self.loop.steps
        )

    @property
    def wrong(self) -> list[str]:
        """Effects that were added and are not there."""
        return [
            step.term.effect.name
            for step in self.loop.steps
            if self.name != step.term.effect.name and self.name not in step.ties
        ]

    def oracle_share(self) -> float:
        """Fall of the sealed error, as a share of the fall for who knows the effect's shape."""
        loop = self.loop
        session = loop.before.session
        track, grid = session.fine.track, session.fine
        known = self.simulated.effect
        declared = [term.columns(track) for term in loop.before.terms]
        design = np.concatenate([*declared, known[:, None]], axis=1)
        fitted, *_ = np.linalg.lstsq(design[grid.fit], track.current_a[grid.fit], rcond=None)
        rest = track.current_a[grid.sealed] - design[grid.sealed] @ fitted
        best = loop.rmse_before_a - float(np.sqrt(np.mean(rest**2)))
        return (loop.rmse_before_a - loop.rmse_after_a) / best if best > 0 else float("nan")


def run_trial(
    seed: int,
    effects: tuple[str, ...],
    ratio: float,
    *,
    mode: str = "position",
    known: bool | None = None,
    without: tuple[str, ...] = (),
    **options: object,
) -> Trial:
    """Simulate a joint, close the loop on it."""
    missing = set(effects) & set(DECLARED)
    phases = mode == "phases"
    base = tuple(name for name in DECLARED if name not in missing)
    made = simulate(seed, effects, ratio, declared=base, phase_errors=phases, **options)  # type: ignore[arg-type]
    if known is None:
        known = bool(seed % 2) or phases
    joint = Joint(made.gear_ratio, made.pole_pairs) if known else Joint()
    recording = Recording(
        name="run",
        rate_hz=made.rate_hz,
        current_a=None if phases else made.current,
        phases_a=made.phases if phases else None,
        position_rad=None if phases else made.position,
        temperature_c=made.temperature,
    )
    track, grouping = grouped_track([recording], joint)
    if grouping is None:
        msg = f"seed {seed} moves too little"
        raise TooLittleError(msg)
    library = built_in_library(without)
    full = built_in_library()
    before = declared_fit(open_session(track, grouping), tuple((full[name], None) for name in base))
    return Trial("+".join(effects), made, close_loop(before, library, seed))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few seeds only")
    parser.add_argument("--seeds", type=int, default=0, help="seeds per effect; null runs: x 20")
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--mode", choices=("position", "phases"), default="position")
    parser.add_argument("--only", default="", help="effects, separated by commas; or null, removed")
    parser.add_argument("--ratios", default="0.3,0.6")
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument(
        "--testbed", action="store_true", help="on the virtual testbed; --seeds per effect"
    )
    arguments = parser.parse_args()
    if arguments.testbed:
        import testbed_closings

        first, count = arguments.first_seed, arguments.seeds or (1 if arguments.quick else 20)
        removed = range(first, first + max(count // 5, 1))
        testbed_closings.run(range(first, first + count), removed, verbose=arguments.verbose)
        return
    per_effect = arguments.seeds or (2 if arguments.quick else 10)
    options: dict[str, object] = {}
    if arguments.mode == "phases":
        # Phases need a carrier that the rate can show.
        options = {"rate": 2048.0}
    effects = EFFECTS if arguments.mode == "position" else PHASE_EFFECTS
    chosen = tuple(arguments.only.split(",")) if arguments.only else ("null", *effects, "removed")
    began = time.time()

    def seeds_of(name: str) -> range:
        first = arguments.first_seed + per_effect * effects.index(name)
        return range(first, first + per_effect)

    if "null" in chosen:
        nulls = range(arguments.first_seed, arguments.first_seed + 20 * per_effect)
        wrong = verdicts = 0
        for seed in nulls:
            quantum = 1e-5 if seed % 3 == 0 else None
            trial = run_trial(seed, (), 0.0, mode=arguments.mode, quantum=quantum, **options)
            wrong += bool(trial.added)
            verdicts += trial.loop.verdict == "nothing-missing"
            if trial.added and arguments.verbose:
                print("  null", seed, trial.simulated.rate_hz, trial.added)
        print(
            f"nothing missing: wrong additions {wrong}/{len(nulls)} ({wrong / len(nulls):.1%}), "
            f"verdict nothing-missing {verdicts / len(nulls):.1%}"
        )

    for ratio in (float(text) for text in arguments.ratios.split(",")):
        detected: dict[str, int] = defaultdict(int)
        named: dict[str, int] = defaultdict(int)
        shares: list[float] = []
        tried = [name for name in effects if name in chosen]
        for name in tried:
            for seed in seeds_of(name):
                try:
                    trial = run_trial(seed, (name,), ratio, mode=arguments.mode, **options)
                except TooLittleError as error:
                    print(f"  {name}: {error}")
                    continue
                detected[name] += bool(trial.added)
                named[name] += trial.named and not trial.wrong
                if trial.added and arguments.mode == "position":
                    shares.append(trial.oracle_share())
                if arguments.verbose and (not trial.named or trial.wrong):
                    print(
                        f"  {name} {seed} at {ratio}: {trial.added} ties "
                        f"{[step.ties for step in trial.loop.steps]} {trial.loop.verdict} "
                        f"{trial.loop.remaining_domain}",
                        flush=True,
                    )
        total = len(tried) * per_effect
        if not total:
            continue
        found = sum(detected.values())
        print(
            f"residual ratio {ratio}: detected {found}/{total} ({found / total:.1%}), name or tie "
            f"right {sum(named.values())}/{found} ({sum(named.values()) / max(found, 1):.1%})"
        )
        if shares:
            print(
                f"  held-out error's fall against the oracle's: mean {np.nanmean(shares):.3f}, "
                f"median {np.nanmedian(shares):.3f}"
            )
        for name in tried:
            if detected[name] < per_effect or named[name] < per_effect:
                print(f"  {name}: detected {detected[name]}, named {named[name]} of {per_effect}")

    if "removed" in chosen:
        wrong = silent = total = 0
        for name in effects:
            if name in DECLARED:
                continue
            for seed in seeds_of(name)[: max(per_effect // 2, 1)]:
                try:
                    trial = run_trial(
                        seed, (name,), 0.6, mode=arguments.mode, without=(name,), **options
                    )
                except TooLittleError:
                    continue
                total += 1
                wrong += bool(trial.added)
                silent += trial.loop.verdict == "nothing-missing"
                if arguments.verbose:
                    print(
                        f"  removed {name} {seed}: {trial.added} {trial.loop.verdict} "
                        f"{trial.loop.remaining_domain}",
                        flush=True,
                    )
        print(
            f"outside the library at 0.6: wrong name {wrong}/{total} ({wrong / total:.1%}), "
            f"nothing noticed {silent}/{total}"
        )
    print(f"{time.time() - began:.0f} s")


if __name__ == "__main__":
    main()
