"""Progress of a batch: what a terminal shows while it runs, and what a log keeps."""

from __future__ import annotations

import io

import pytest

from lfstereo.batch.display import Display
from lfstereo.batch.jobs import Outcome
from lfstereo.batch.notes import Note

DONE = Outcome("a", "done", seconds={"decode left": 1.5, "disparity": 1.0})
FAILED = Outcome("b", "failed", "b/left.LFR: the file is cut off")


class Screen(io.StringIO):
    """Keeps what is written to it."""

    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal


def shown(monkeypatch: pytest.MonkeyPatch, terminal: bool) -> str:
    """Run a batch of five pairs, one of them finished before, up to its third."""
    screen = Screen(terminal)
    monkeypatch.setattr("sys.stderr", screen)
    display = Display(total=5, finished=1)
    display.ended(DONE)
    display.ended(FAILED)
    display.tick([Note("t", 1, "host", n, stage, 0.0) for n, stage in enumerate(("disparity", "rectify left"))])
    display.tick([Note("t", 1, "host", n, "disparity", 0.0) for n in range(2)])
    display.close()
    return screen.getvalue()


def test_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pairs done, rate, time left, failures, running stages."""
    text = shown(monkeypatch, terminal=True)
    assert "3/5 pairs" in text
    assert "pairs/min" in text
    assert "min left, 1 failed; disparity, rectify left" in text
    assert "min left, 1 failed; 2 x disparity" in text
    assert "b: b/left.LFR: the file is cut off\n" in text


def test_log(monkeypatch: pytest.MonkeyPatch) -> None:
    """One line per pair, no bar."""
    first, second = shown(monkeypatch, terminal=False).splitlines()
    assert first.startswith("[2/5] a: done in 2.5 s (")
    assert second.startswith("[3/5] b: b/left.LFR: the file is cut off (")
    assert second.endswith(" min left, 1 failed)")
