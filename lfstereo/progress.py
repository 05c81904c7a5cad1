"""Progress of long work: stages report ``(done, total)``, the command line draws a bar on stderr."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int], None]
"""Called with the steps done and the steps in all."""


def silent(done: int, total: int) -> None:
    """Report nothing: the default of every stage."""


@contextmanager
def progress_bar(label: str) -> Iterator[Progress]:
    """Draw one bar on stderr for the stage run inside the ``with`` block; in a log file, one line at its end."""
    if not sys.stderr.isatty():
        started = time.perf_counter()
        yield silent
        print(f"{label:<22} {time.perf_counter() - started:.1f} s", file=sys.stderr)
        return
    from tqdm import tqdm

    with tqdm(desc=f"{label:<22}", file=sys.stderr, total=1, bar_format="{desc} {bar:24} {elapsed}") as bar:

        def report(done: int, total: int) -> None:
            bar.total = total
            bar.n = done
            bar.refresh()

        yield report
        bar.n = bar.total
        bar.refresh()


@dataclass(frozen=True, slots=True)
class StageClock:
    """Time and peak memory of the stages of a run, with a bar for each where wanted."""

    bars: bool = False
    seconds: dict[str, float] = field(default_factory=dict)
    """Wall time of each finished stage, in the order they ran."""
    peak_gib: dict[str, float] = field(default_factory=dict)
    """Largest resident memory of the process during each stage, GiB."""

    @contextmanager
    def stage(self, label: str) -> Iterator[Progress]:
        """Measure the ``with`` block under this label and give it a progress callback."""
        _reset_peak()
        started = time.perf_counter()
        if self.bars:
            with progress_bar(label) as report:
                yield report
        else:
            yield silent
        self.seconds[label] = time.perf_counter() - started
        self.peak_gib[label] = _peak_gib()


def _reset_peak() -> None:
    """Let the kernel count the peak from here on, where it can (Linux, proc(5), clear_refs)."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _peak_gib() -> float:
    with contextlib.suppress(OSError):
        status = Path("/proc/self/status").read_text("ascii", errors="replace")
        for line in status.splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 2**20
    try:
        import resource
    except ImportError:
        return 0.0
    unit = 2**30 if sys.platform == "darwin" else 2**20
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
