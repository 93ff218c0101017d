"""Fail every system call on a command's output once: one sentence, the right code, a whole result.

    python tests/reliability/faults.py --every 1

Needs a C compiler for `faults.c`, which is put before the C library. The commands run in forks of
this process, which has imported all that they need.
"""

import argparse
import ctypes
import errno
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from forks import preload
from results import broken, leftovers
from trials import Trial, reset, run, trials

NUMBERS = (errno.ENOSPC, errno.EIO)
SHIM = "OPAMC_FAULT_SHIM"


def build(folder: Path) -> Path | None:
    """Compile the shim; None without a compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return None
    library = folder / "faults.so"
    source = Path(__file__).with_name("faults.c")
    line = [compiler, "-shared", "-fPIC", "-O1", "-w", "-o", str(library), str(source), "-ldl"]
    subprocess.run(line, check=True)
    return library


def fault(trial: Trial, at: int, number: int, count: Path) -> str | None:
    """Fail one call; return what is wrong then, or None."""
    reset(trial)

    def tell() -> None:
        count.write_text(str(ctypes.CDLL(os.environ[SHIM]).opamc_fault_calls()))

    ended = run(
        trial,
        tell,
        OPAMC_FAULT_DIR=str(trial.out),
        OPAMC_FAULT_AT=str(at),
        OPAMC_FAULT_ERRNO=str(number),
    )
    if ended.returncode not in (*trial.codes, 2, 3, 4):
        return f"exit {ended.returncode}: {ended.stderr.strip()[-160:]}"
    if ended.returncode and "opamc: " not in ended.stderr:
        return f"exit {ended.returncode} without a sentence"
    if "Traceback" in ended.stderr or "Exception ignored" in ended.stderr:
        return f"a traceback: {ended.stderr.strip()[-160:]}"
    why = broken(trial.out)
    if why is None and leftovers(trial.out):
        # it was the removal that failed: the next run has to do it
        run(trial)
        why = f"left: {left}" if (left := leftovers(trial.out)) else None
    return why


def faults(every: int, names: tuple[str, ...] = (), first: int = 1) -> Counter[str]:
    """Return how each command ended when every so-manieth call of it failed."""
    ends: Counter[str] = Counter()
    preload()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        count = folder / "count"
        for trial in trials(folder, names):
            why = fault(trial, 0, 0, count)
            assert why is None, (trial.name, why)
            calls = int(count.read_text())
            for at in range(min(first, calls), calls + 1, every):
                why = fault(trial, at, NUMBERS[at % 2], folder / "ignored")
                end = f"{trial.name}: {'fine' if why is None else f'WRONG call {at}: {why}'}"
                ends[end] += 1
                if why is not None:
                    print(at, end, file=sys.stderr, flush=True)
            print(f"{trial.name}: {calls} calls", file=sys.stderr, flush=True)
    return ends


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[])
    chosen = parser.parse_args()
    if SHIM not in os.environ:
        with tempfile.TemporaryDirectory() as place:
            shim = build(Path(place))
            if shim is None:
                sys.exit("faults: needs a C compiler")
            given = {**os.environ, SHIM: str(shim), "LD_PRELOAD": str(shim)}
            again = [sys.executable, *sys.argv]
            sys.exit(subprocess.run(again, env=given, check=False).returncode)
    ended = faults(chosen.every, tuple(chosen.only), chosen.first)
    for end, number in sorted(ended.items()):
        print(f"{number:6d}  {end}")
    failures = sum(number for end, number in ended.items() if "WRONG" in end)
    print(f"{sum(ended.values())} failing calls, {failures} wrong")
    sys.exit(bool(failures))
