"""Progress of long work: stages report ``(done, total)``, the command line draws a bar on stderr."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int], None]
"""Called with the steps done and the steps in all."""


def silent(done: int, total: int) -> None:
    """Report nothing: the default of every stage."""


@contextmanager
def progress_bar(label: str) -> Iterator[Progress]:
    """Draw one bar on stderr for the stage run inside the ``with`` block."""
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
    """Time the stages of a run, with a bar for each where wanted."""

    bars: bool = False
    seconds: dict[str, float] = field(default_factory=dict)
    """Wall time of each finished stage, in the order they ran."""

    @contextmanager
    def stage(self, label: str) -> Iterator[Progress]:
        """Time the ``with`` block under this label and give it a progress callback."""
        started = time.perf_counter()
        if self.bars:
            with progress_bar(label) as report:
                yield report
        else:
            yield silent
        self.seconds[label] = time.perf_counter() - started
