"""The curve of a run's loss, as a CSV file that any spreadsheet opens."""

from __future__ import annotations

import csv
from pathlib import Path

from lfstereo.training.checkpoint import Counters

COLUMNS = ("stage", "step", "seconds", "rate", "loss")


class Curve:
    """Append to a run's curve; what an interrupted run wrote after its last checkpoint is dropped.

    Parameters
    ----------
    path
        The CSV file.
    step
        Step that the run starts from; 0 starts a new curve.
    """

    def __init__(self, path: Path, step: int) -> None:
        self.path = path
        rows = [row for row in read_curve(path) if row[1] <= step] if step and path.exists() else []
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", newline="") as file:
            csv.writer(file).writerows([COLUMNS, *rows])

    def add(self, counters: Counters, rate: float, loss: float) -> None:
        """Add the mean loss of the steps since the last call."""
        with self.path.open("a", newline="") as file:
            csv.writer(file).writerow(
                (counters.stage, counters.step, f"{counters.elapsed_s:.1f}", f"{rate:.6g}", f"{loss:.6g}")
            )


def read_curve(path: Path) -> list[tuple[str, int, float, float, float]]:
    """Return the rows of a curve: stage, step, seconds, learning rate, loss."""
    with path.open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    return [(stage, int(step), float(s), float(rate), float(loss)) for stage, step, s, rate, loss in rows]
