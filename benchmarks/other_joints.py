"""The loop on joints of another kind than those of the testbed and of the tests.

    python benchmarks/other_joints.py [--seeds 2] [--first-seed 29100]
        [--motions trapezoidal,cubic] [--effects none,ripple] [--strengths 2,6] [--verbose]

Every joint (algebraic_joint.py) lacks one effect of the library, or none; it has a position and a
current, at 100 to 2000 Hz, and an encoder of 1e-6 to 1e-3 rad, or an ideal one. Tuning used seeds
below 100 only.

A row counts, for one motion: found (something was added), named (a step or its ties hold the
name), extra (steps that do not), verdict right (`nothing-missing` or `closed`), and the median of
the sealed error after the loop in units of the current's noise.
"""

import argparse
import time
from dataclasses import dataclass

import numpy as np
from algebraic_joint import DECLARED, EFFECTS, MOTIONS, Recorded, record

from opamc_cli.joint.declared import declared_fit
from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.kinematics import Recording
from opamc_cli.joint.loop import Loop, close_loop
from opamc_cli.joint.model import open_session
from opamc_cli.joint.recordings import grouped_track
from opamc_cli.joint.track import Joint

NONE = "none"
HEAD = "| motion | effect / noise | found | named | extra | verdict right | error / noise |"


@dataclass(frozen=True)
class Closing:
    """One closed loop and what was true."""

    effect: str
    recorded: Recorded
    loop: Loop
    seconds: float

    @property
    def steps(self) -> list[set[str]]:
        """Names, with ties, of every effect added."""
        return [{step.term.effect.name, *step.ties} for step in self.loop.steps]

    @property
    def named(self) -> bool:
        """Whether a step holds the true name."""
        return any(self.effect in names for names in self.steps)

    @property
    def extra(self) -> int:
        """Steps that do not hold the true name."""
        return sum(self.effect not in names for names in self.steps)

    @property
    def told(self) -> bool:
        """Whether the verdict is the right one."""
        expected = "nothing-missing" if self.effect == NONE else "closed"
        return self.loop.verdict == expected

    @property
    def excess(self) -> float:
        """Sealed error after the loop, in units of the noise."""
        return self.loop.rmse_after_a / self.recorded.noise_a

    def describe(self) -> str:
        """Say in a line what went how."""
        recorded, loop = self.recorded, self.loop
        found = [
            f"{step.term.effect.name}"
            + "".join(f" {key} {value:.4g}" for key, value in step.term.parameters.items())
            + "".join(f" ~{tie}" for tie in step.ties)
            for step in loop.steps
        ]
        return (
            f"{recorded.joint.path.rate_hz:.0f} Hz, encoder {recorded.encoder_rad:.1e}: "
            f"{loop.verdict} {loop.remaining_domain or ''} {found} error / noise "
            f"{loop.rmse_before_a / recorded.noise_a:.2f} to {self.excess:.2f}, "
            f"{self.seconds:.0f} s"
        )


def close_one(motion: str, effect: str, strength: float, seed: int) -> Closing:
    """Record a joint and close the loop on it; every other joint knows its gear."""
    began = time.perf_counter()
    recorded = record(motion, None if effect == NONE else effect, strength, seed)
    joint = recorded.joint
    recording = Recording(
        "run",
        joint.path.rate_hz,
        current_a=recorded.current_a,
        position_rad=recorded.position_rad,
        temperature_c=recorded.temperature_c if effect == "thermal_viscous" else None,
    )
    known = Joint(joint.gear_ratio, joint.pole_pairs) if seed % 2 else Joint()
    track, grouping = grouped_track([recording], known)
    if grouping is None:
        msg = f"{motion} of seed {seed} moves too little"
        raise ValueError(msg)
    library = built_in_library()
    declared = tuple((library[name], None) for name in DECLARED)
    loop = close_loop(declared_fit(open_session(track, grouping), declared), library, seed)
    return Closing(effect, recorded, loop, time.perf_counter() - began)


def row(motion: str, what: str, closings: list[Closing]) -> str:
    """One row of the table."""
    total = len(closings)
    hides = closings[0].effect != NONE
    named = f"{sum(closing.named for closing in closings)} of {total}" if hides else "–"
    found = sum(bool(closing.steps) for closing in closings)
    told = sum(closing.told for closing in closings)
    extra = sum(closing.extra for closing in closings)
    excess = float(np.median([closing.excess for closing in closings]))
    return (
        f"| {motion} | {what} | {found} of {total} | {named} | {extra} | {told} of {total} "
        f"| {excess:.2f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2, help="per motion, effect and strength")
    parser.add_argument("--first-seed", type=int, default=29100)
    parser.add_argument("--motions", default=",".join(MOTIONS))
    parser.add_argument("--effects", default=",".join([NONE, *EFFECTS]))
    parser.add_argument("--strengths", default="2,6")
    parser.add_argument("--verbose", action="store_true", help="print what is not as it should be")
    arguments = parser.parse_args()
    began = time.time()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    effects = arguments.effects.split(",")
    rows = [HEAD, "|---|---|---|---|---|---|---|"]
    missed: dict[str, int] = {}
    for motion in arguments.motions.split(","):
        kinds = [(NONE, 0.0)] if NONE in effects else []
        strengths = [float(text) for text in arguments.strengths.split(",")]
        for what, strength in [*kinds, *(("", value) for value in strengths)]:
            names = [what] if what else [name for name in effects if name != NONE]
            closings = []
            # A joint with nothing missing is asked for as often as four effects are.
            for seed in range(seeds.start, seeds.start + (4 if what else 1) * len(seeds)):
                for name in names:
                    closing = close_one(motion, name, strength, seed)
                    closings.append(closing)
                    good = closing.told and not closing.extra and (closing.named or name == NONE)
                    if not good:
                        missed[name] = missed.get(name, 0) + 1
                        if arguments.verbose:
                            print(f"  {motion} {name} {strength:g} {seed} at", closing.describe())
            if closings:
                rows.append(row(motion, what or f"{strength:g}", closings))
                print(rows[-1], flush=True)
    print(*rows, sep="\n")
    print("not as it should be:", ", ".join(f"{name} {count}" for name, count in missed.items()))
    print(f"{time.time() - began:.0f} s")


if __name__ == "__main__":
    main()
