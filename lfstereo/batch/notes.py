"""What a worker does right now and what became of its job, in small files on the shared storage.

By the notes attempts are counted and stages shown. The answers outlive their worker: its result may be lost on the way.
"""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from lfstereo.batch.jobs import Job, Outcome, outcome_from, values_of

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
    _replace_file(path, asdict(note))


def keep_answer(job: Job, outcome: Outcome) -> None:
    """Leave what became of a job where it is found without the worker."""
    _replace_file(job.answer, values_of(outcome))


def read_answer(job: Job) -> Outcome | None:
    """Return what became of a job; ``None`` where its worker has left nothing."""
    try:
        return outcome_from(json.loads(job.answer.read_text("utf-8")))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def trace_of(job: Job, attempt: int) -> Path:
    """Return the file that holds where an attempt hung, if its process was ended there without last words."""
    return job.note.with_name(f"{job.name}.{job.token}.{attempt}.trace")


def lost_note(job: Job) -> Note | None:
    """Return the note of the last attempt at this job, whose worker was lost; ``None`` if there was none."""
    lost = read_note(job.note)
    if lost is None or lost.token != job.token:
        return None
    with suppress(OSError):
        if trace_of(job, lost.attempt).stat().st_size:
            return replace(lost, stopped=TIME_LIMIT)
    return lost


def next_note(job: Job) -> tuple[Note | None, Note]:
    """Return the note of a lost attempt at this job, if there was one, and the note of the next attempt."""
    lost = lost_note(job)
    attempt = lost.attempt + 1 if lost else 1
    return lost, Note(job.token, attempt, socket.gethostname(), os.getpid(), "start", time.time())


def still_mine(path: Path, note: Note) -> bool:
    """Return whether no later attempt, of this batch or of another, has taken the job over."""
    found = read_note(path)
    return found is not None and (found.token, found.attempt) == (note.token, note.attempt)


def mark_stopped(path: Path, note: Note, reason: str) -> None:
    """Write down why an attempt is about to be ended."""
    found = read_note(path)
    if found is not None and still_mine(path, note):
        write_note(path, replace(found, stopped=reason))


def _replace_file(path: Path, values: Mapping[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    scratch = path.with_name(f".{path.name}.{os.getpid()}")
    scratch.write_text(json.dumps(values), "utf-8")
    os.replace(scratch, path)
