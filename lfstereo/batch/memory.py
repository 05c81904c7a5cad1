"""How many workers fit: the memory of one pair, measured, and what is free."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

BASE_GIB = 0.7
"""Peak of a worker on the simulator's small sensor: interpreter, libraries, network."""
GIB_PER_MEGAPIXEL = 0.045
"""What a raw frame adds, per million pixels; see benchmarks/bench_batch.py."""
_MARGIN = 1.1
_USABLE_SHARE = 0.9
_CGROUP_LIMITS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
    ("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"),
)


def pair_memory_gib(largest_frame_px: int, measured_gib: Iterable[float]) -> float:
    """Return the peak memory to expect of one worker.

    Parameters
    ----------
    largest_frame_px
        Pixels of the largest raw frame; 0 where all captures are decoded already.
    measured_gib
        Peaks of pairs that this batch converted before; they count more than the formula.

    Examples
    --------
    >>> round(pair_memory_gib(7728 * 5368, []), 2)
    2.82
    """
    known = [gib for gib in measured_gib if gib > 0]
    expected = max(known) if known else BASE_GIB + GIB_PER_MEGAPIXEL * largest_frame_px / 1e6
    return expected * _MARGIN


def fitting_workers(pair_gib: float, free_gib: float, cores: int) -> int:
    """Return how many workers fit into the free memory, one per core at most, and one at least.

    Examples
    --------
    >>> fitting_workers(2.5, 24.0, 16), fitting_workers(2.5, 24.0, 2), fitting_workers(2.5, 1.0, 2)
    (8, 2, 1)
    """
    return max(1, min(cores, int(_USABLE_SHARE * free_gib / pair_gib)))


def free_memory_gib() -> float:
    """Return the memory that new processes can have: free or reclaimable, and within the container's limit."""
    free = _meminfo_available()
    for limit, used in _CGROUP_LIMITS:
        with suppress(OSError, ValueError):
            left = int(Path(limit).read_text("ascii")) - int(Path(used).read_text("ascii"))
            free = min(free, left)
    return free / 2**30


def usable_cores() -> int:
    """Return the cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _meminfo_available() -> int:
    with suppress(OSError, ValueError):
        for line in Path("/proc/meminfo").read_text("ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    return int(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")) // 2
