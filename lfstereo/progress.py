"""Progress of long work: stages report ``(done, total)``, the command line draws a bar on stderr."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int], None]
"""Called with the steps done and the steps in all."""


def silent(done: int, total: int) -> None:
    """Report nothing: the default of every stage."""


@contextmanager
def progress_bar(label: str) -> Iterator[Progress]:
    """Draw one bar on stderr for the stage run inside the ``with`` block."""
    from tqdm import tqdm

    with tqdm(desc=f"{label:<22}", unit="", file=sys.stderr, total=1, bar_format="{desc}{bar:24} {elapsed}") as bar:

        def report(done: int, total: int) -> None:
            bar.total = total
            bar.n = done
            bar.refresh()

        yield report
        bar.n = bar.total
        bar.refresh()
