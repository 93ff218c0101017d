"""Kill and interrupt every command at random moments: one whole result, no orphan, no leftover.

    python tests/reliability/kills.py --count 500 --minutes 60 --seed 1

Most commands run in a fork of this process, which has imported all that they need; one in ten is
started as a user would, so that the interpreter's own start is met as well.
"""

import argparse
import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from forks import Fork, preload
from results import broken, leftovers
from test_processes import of_session, wait_for
from trials import Started, Trial, reset, run, trials

SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
STARTED = 10
"""One in so many commands is started by an interpreter of its own."""

INTERPRETER_S = 0.3
"""Before a command has its signals in hand, the interpreter ends in its own way."""


def kill(trial: Trial, after_s: float, number: signal.Signals, forked: bool = True) -> str | None:
    """End a command after some time; return what is wrong then, or None."""
    reset(trial)
    process = Fork(trial.arguments) if forked else Started(trial.arguments)
    time.sleep(after_s)
    os.kill(process.pid, number)
    try:
        ended = process.wait(120)
    except TimeoutError as error:
        return f"{error} after {number.name}"
    if not wait_for(lambda: not of_session(process.pid), 15):
        return f"{len(of_session(process.pid))} processes outlive it"
    if "Traceback" in ended.stderr and (forked or after_s > INTERPRETER_S):
        return f"a traceback after {number.name}: {ended.stderr.strip()[-700:]}"
    if ended.returncode not in (*trial.codes, -number, 128 + number):
        return f"exit {ended.returncode} after {number.name}: {ended.stderr.strip()[-2000:]}"
    return broken(trial.out)


def kills(count: int, minutes: float, seed: int, names: tuple[str, ...] = ()) -> Counter[str]:
    """Return how `count` kills, or those of so many minutes, ended."""
    ends: Counter[str] = Counter()
    preload()
    with tempfile.TemporaryDirectory() as name:
        every, took = trials(Path(name), names), {}
        for trial in every:
            reset(trial)
            first = time.monotonic()
            run(trial)
            took[trial.name] = time.monotonic() - first
        begun = time.monotonic()
        for number in range(count):
            if time.monotonic() - begun > 60 * minutes:
                break
            rng = random.Random(f"{seed} {number}")
            trial = every[number % len(every)]
            sent, forked = rng.choice(SIGNALS), number % STARTED > 0
            after_s = rng.uniform(0, 1.1) * (took[trial.name] + (0.0 if forked else 2.0))
            why = kill(trial, after_s, sent, forked)
            if why is None and number % 4 == 0:
                ended = run(trial)
                left = leftovers(trial.out)
                if ended.returncode not in trial.codes:
                    why = f"exit {ended.returncode} of the next run: {ended.stderr.strip()[-160:]}"
                elif left:
                    why = f"left: {left}"
                else:
                    why = broken(trial.out)
            end = f"{trial.name}: {'fine' if why is None else 'WRONG ' + why}"
            ends[end] += 1
            if why is not None or number % 25 == 24:
                print(number, sent.name, f"{after_s:.2f} s", end, file=sys.stderr, flush=True)
    return ends


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[])
    chosen = parser.parse_args()
    ended = kills(chosen.count, chosen.minutes, chosen.seed, tuple(chosen.only))
    for end, number in sorted(ended.items()):
        print(f"{number:6d}  {end}")
    failures = sum(number for end, number in ended.items() if "WRONG" in end)
    print(f"{sum(ended.values())} kills and interruptions, {failures} wrong")
    sys.exit(bool(failures))
