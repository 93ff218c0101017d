"""Fail every system call on a command's output once: one sentence, the right code, a whole result.

    python tests/reliability/faults.py --every 1

Needs a C compiler for `faults.c`, which is put before the C library.
"""

import argparse
import errno
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from results import broken, leftovers
from trials import Trial, reset, run, trials

NUMBERS = (errno.ENOSPC, errno.EIO)


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


def fault(trial: Trial, library: Path, at: int, number: int, count: Path) -> str | None:
    """Fail one call; return what is wrong then, or None."""
    reset(trial)
    ended = run(
        trial,
        LD_PRELOAD=str(library),
        OPAMC_FAULT_DIR=str(trial.out),
        OPAMC_FAULT_AT=str(at),
        OPAMC_FAULT_ERRNO=str(number),
        OPAMC_FAULT_COUNT=str(count),
    )
    if ended.returncode not in (0, 2, 3, 4):
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


def faults(every: int, names: tuple[str, ...] = ()) -> Counter[str]:
    """Return how each command ended when every so-manieth call of it failed."""
    ends: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        library = build(folder)
        if library is None:
            return ends
        count = folder / "count"
        for trial in trials(folder, names):
            why = fault(trial, library, 0, 0, count)
            assert why is None, (trial.name, why)
            for at in range(1, int(count.read_text()) + 1, every):
                why = fault(trial, library, at, NUMBERS[at % 2], folder / "ignored")
                end = f"{trial.name}: {'fine' if why is None else f'WRONG call {at}: {why}'}"
                ends[end] += 1
                print(at, end, file=sys.stderr, flush=True)
    return ends


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[])
    chosen = parser.parse_args()
    ended = faults(chosen.every, tuple(chosen.only))
    for end, number in sorted(ended.items()):
        print(f"{number:6d}  {end}")
    failures = sum(number for end, number in ended.items() if "WRONG" in end)
    print(f"{sum(ended.values())} failing calls, {failures} wrong")
    sys.exit(bool(failures))
