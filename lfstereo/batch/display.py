"""Progress of a batch on stderr: one bar in a terminal, one line per pair in a log."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Sequence

from tqdm import tqdm

from lfstereo.batch.jobs import Outcome
from lfstereo.batch.notes import Note


class Display:
    """Pairs done, running stages, rate, time left, failures.

    Parameters
    ----------
    total
        Pairs of the batch.
    finished
        Of these, finished before.
    """

    def __init__(self, total: int, finished: int) -> None:
        self._total, self._ended, self._failed = total, finished, 0
        self._first, self._started = finished, time.monotonic()
        self._terminal = sys.stderr.isatty()
        self._bar = tqdm(
            total=total,
            initial=finished,
            file=sys.stderr,
            disable=not self._terminal,
            bar_format="{n_fmt}/{total_fmt} pairs {bar:16} {elapsed}{postfix}",
        )

    def tick(self, notes: Sequence[Note]) -> None:
        """Show what the workers do."""
        if self._terminal:
            stages = Counter(note.stage for note in notes)
            running = ", ".join(f"{count} x {stage}" if count > 1 else stage for stage, count in stages.items())
            self._bar.set_postfix_str(f"{self._pace()}; {running or 'waiting'}"[:120])

    def ended(self, outcome: Outcome) -> None:
        """Count a pair."""
        self._ended += 1
        failed = outcome.state == "failed"
        self._failed += failed
        if self._terminal:
            if failed:
                tqdm.write(f"{outcome.name}: {outcome.reason}", file=sys.stderr)
            self._bar.update()
            return
        what = outcome.reason if failed else f"done in {sum(outcome.seconds.values()):.1f} s"
        print(f"[{self._ended}/{self._total}] {outcome.name}: {what} ({self._pace()})", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Leave the last line as it is."""
        self._bar.close()

    def _pace(self) -> str:
        """Return rate, time left and failures in words."""
        converted, minutes = self._ended - self._first, (time.monotonic() - self._started) / 60
        parts = []
        if converted:
            left = (self._total - self._ended) * minutes / converted
            parts += [f"{converted / max(minutes, 1e-9):.1f} pairs/min", f"{left:.0f} min left"]
        parts.append(f"{self._failed} failed")
        return ", ".join(parts)
