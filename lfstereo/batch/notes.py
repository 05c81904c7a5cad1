"""What a worker does right now, in a small file on the shared storage: attempts are counted and stages shown by it."""

from __future__ import annotations

import json
import os
import socket
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from lfstereo.batch.jobs import Job

TIME_LIMIT = "time limit"


@dataclass(frozen=True, slots=True)
class Note:
    """State of a running job."""

    token: str
    """Of the batch it belongs to."""
    attempt: int
    host: str
    process: int
    stage: str
    started: float
    """Seconds since 1970."""
    stopped: str = ""
    """``"time limit"`` where that ended the attempt."""

    @property
    def worker(self) -> str:
        """``host:process``."""
        return f"{self.host}:{self.process}"


def read_note(path: Path) -> Note | None:
    """Return a note; ``None`` where there is none."""
    try:
        return Note(**json.loads(path.read_text("utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def write_note(path: Path, note: Note) -> None:
    """Replace a note."""
    path.parent.mkdir(parents=True, exist_ok=True)
    scratch = path.with_name(f".{path.name}.{note.process}")
    scratch.write_text(json.dumps(asdict(note)), "utf-8")
    os.replace(scratch, path)


def next_note(job: Job) -> tuple[Note | None, Note]:
    """Return the note of a lost attempt at this job, if there was one, and the note of the next attempt."""
    lost = read_note(job.note)
    if lost is not None and lost.token != job.token:
        lost = None
    attempt = lost.attempt + 1 if lost else 1
    return lost, Note(job.token, attempt, socket.gethostname(), os.getpid(), "start", time.time())


def still_mine(job: Job, note: Note) -> bool:
    """Return whether no later attempt, of this batch or of another, has taken the job over."""
    found = read_note(job.note)
    return found is not None and (found.token, found.attempt) == (note.token, note.attempt)


def mark_stopped(path: Path, reason: str) -> None:
    """Write down why an attempt is about to be ended."""
    note = read_note(path)
    if note is not None:
        write_note(path, replace(note, stopped=reason))
