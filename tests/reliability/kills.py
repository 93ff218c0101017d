"""Kill and interrupt every command at random moments: one whole result, no orphan, no leftover.

python tests/reliability/kills.py --count 500 --minutes 30 --seed 1
"""

import argparse
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from results import broken, leftovers
from test_processes import of_session, wait_for
from trials import Trial, reset, run, start, trials

SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
INTERPRETER_S = 0.3
"""Before a command has its signals in hand, the interpreter ends in its own way."""


def kill(trial: Trial, after_s: float, number: signal.Signals) -> str | None:
    """End a command after some time; return what is wrong then, or None."""
    reset(trial)
    process = start(trial)
    time.sleep(after_s)
    process.send_signal(number)
    _, err = process.communicate(timeout=120)
    if not wait_for(lambda: not of_session(process.pid), 15):
        return f"{len(of_session(process.pid))} processes outlive it"
    if "Traceback" in err and after_s > INTERPRETER_S:
        return f"a traceback after {number.name}: {err.strip().splitlines()[-1]}"
    if process.returncode not in (0, 1, -number, 128 + number):
        return f"exit {process.returncode} after {number.name}"
    return broken(trial.out)


def kills(count: int, minutes: float, seed: int, names: tuple[str, ...] = ()) -> Counter[str]:
    """Return how `count` kills, or those of so many minutes, ended."""
    ends: Counter[str] = Counter()
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
            sent = rng.choice(SIGNALS)
            why = kill(trial, rng.uniform(0, 1.1) * took[trial.name], sent)
            if why is None and number % 4 == 0:
                code = run(trial).returncode
                left = leftovers(trial.out)
                why = f"exit {code} of the next run" if code else f"left: {left}" if left else None
            end = f"{trial.name}: {'fine' if why is None else 'WRONG ' + why}"
            ends[end] += 1
            print(number, sent.name, end, file=sys.stderr, flush=True)
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
