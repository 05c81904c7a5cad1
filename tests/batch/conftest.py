"""Folders of captures that are cheap to convert, and batches as processes of their own."""

from __future__ import annotations

import functools
import io
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from lfstereo.assets import asset_folder
from lfstereo.batch import conversion
from lfstereo.batch.record import read_record
from lfstereo.cli.main import main

HERE = Path(__file__).parent
PATIENCE_S = 900.0
"""Longest wait for something that is bound to happen, on a busy machine."""


def wait_until(met: Callable[[], Any], what: str) -> Any:
    """Return the first true value of a condition."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        if found := met():
            return found
        time.sleep(0.02)
    raise AssertionError(f"waited {PATIENCE_S:g} s in vain: {what}")


def end_of(process: subprocess.Popen[str]) -> tuple[int, str]:
    """Wait for a batch; return exit code and all it printed."""
    out, err = process.communicate(timeout=PATIENCE_S)
    return process.returncode, out + err


def is_running(pid: int) -> bool:
    """Return whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@dataclass
class Site:
    """A folder with captures, a rig and an output."""

    folder: Path
    started: list[subprocess.Popen[str]] = field(default_factory=list)

    end_of = staticmethod(end_of)
    is_running = staticmethod(is_running)
    wait_until = staticmethod(wait_until)

    @property
    def out(self) -> Path:
        return self.folder / "out"

    def pairs(self, *names: str) -> None:
        """Add pairs of decoded light fields by name; what they hold is only hashed."""
        for name in names:
            for side in ("left", "right"):
                path = self.folder / "captures" / name / f"{side}.h5"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(f"{name} {side}")

    def words(self, *more: str) -> list[str]:
        """Return the command line of a batch."""
        places = [str(self.folder / "captures"), "--rig", str(self.folder / "rig.toml"), "-o", str(self.out)]
        return ["batch", *places, *([] if "--scheduler" in more else ["--workers", "1"]), *more]

    def start(self, *more: str, **settings: Any) -> subprocess.Popen[str]:
        """Start a batch with the stub's conversion, as a process that can be killed."""
        process = subprocess.Popen(
            [sys.executable, "-W", "error::UserWarning", str(HERE / "stub_work.py"), *self.words(*more)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            **settings,
        )
        self.started.append(process)
        return process

    def run(self, *more: str) -> tuple[int, str]:
        """Run a batch from here to its end, its workers are processes; return exit code and all it printed."""
        import stub_work

        printed = io.StringIO()
        with pytest.MonkeyPatch.context() as patch, redirect_stdout(printed), redirect_stderr(printed):
            patch.setattr(conversion, "run_batch", functools.partial(conversion.run_batch, work=stub_work.STUB))
            return main(self.words(*more)), printed.getvalue()

    def states(self) -> dict[str, str]:
        """Return what the record says of each pair."""
        return {name: entry.outcome.state for name, entry in read_record(self.out).entries.items()}

    def attempts(self) -> dict[str, int]:
        """Return how often each pair was begun."""
        return {name: entry.outcome.attempt for name, entry in read_record(self.out).entries.items()}

    def reason(self, name: str) -> str:
        """Return why a pair failed."""
        return read_record(self.out).entries[name].outcome.reason

    def visible(self) -> set[str]:
        """Return the result folders that a user sees."""
        return {path.name for path in self.out.iterdir() if path.is_dir() and not path.name.startswith(".")}

    def maker(self, name: str) -> str:
        """Return what tells one conversion of a pair from another."""
        path = self.out / name / "run.toml"
        return f"{path.read_text()} {path.stat().st_mtime_ns}"

    def note(self, name: str) -> dict[str, Any] | None:
        """Return what the worker of a pair says it does."""
        try:
            found: dict[str, Any] = json.loads((self.out / ".batch" / "notes" / f"{name}.json").read_text())
            return found
        except (OSError, ValueError):
            return None

    def worker_at(self, name: str, stage: str) -> int:
        """Wait until a pair is in a stage; return its worker's process."""
        note = wait_until(lambda: (n := self.note(name)) and n["stage"] == stage and n, f"{name} in {stage}")
        return int(note["process"])


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    """A place for a batch; its processes are gone at the end."""
    monkeypatch.syspath_prepend(HERE)
    (tmp_path / "captures").mkdir()
    shutil.copy(asset_folder("calib") / "rigs" / "simulated-illum-20mm.toml", tmp_path / "rig.toml")
    found = Site(tmp_path)
    yield found
    for process in found.started:
        if process.poll() is None:
            os.killpg(process.pid, 9)
        process.communicate()
