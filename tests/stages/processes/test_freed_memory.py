"""Memory that was freed is there for the next array."""

import platform
import subprocess
import sys

import pytest

PROGRAM = """
import resource
import numpy as np
from opamc_cli.stages.processes.freed_memory import keep_freed_memory

if {kept}:
    keep_freed_memory()
np.ones(1_000_000)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(50):
    np.ones(1_000_000)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(kept):
    program = PROGRAM.format(kept=kept)
    return int(subprocess.check_output([sys.executable, "-c", program], text=True))


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator")
def test_an_array_takes_the_place_of_one_that_was_freed():
    assert faults(kept=True) < 0.1 * faults(kept=False)


@pytest.mark.parametrize("error", [AttributeError, OSError, TypeError])
def test_another_allocator_is_left_alone(monkeypatch, error):
    def refused(name):
        raise error

    monkeypatch.setattr("ctypes.CDLL", refused)
    from opamc_cli.stages.processes.freed_memory import keep_freed_memory

    keep_freed_memory()
