"""What becomes of memory that was freed."""

import ctypes
from contextlib import suppress

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
KEPT_BYTES = 1 << 30
LARGEST_BYTES = 32 << 20
"""The most that glibc takes for the largest piece that is kept."""


def keep_freed_memory() -> None:
    """Have the allocator keep what is freed, for the next array, where it is glibc's.

    Arrays of a megabyte come and go by the thousand while a loop is closed; given back to the
    system each time, their pages are faulted in and zeroed anew: 0.5 of 9.6 s of two minutes of an
    axis at 2048 Hz, which `benchmarks/commands.py` measures. The peak is 50 to 130 MB higher.
    """
    with suppress(AttributeError, OSError, TypeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(M_MMAP_THRESHOLD, LARGEST_BYTES)
        mallopt(M_TRIM_THRESHOLD, KEPT_BYTES)
