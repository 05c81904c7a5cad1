"""One attempt at a job inside a worker: within its time, and without harm to the jobs that follow."""

from __future__ import annotations

import errno
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from lfstereo.batch.jobs import Job, Outcome
from lfstereo.batch.notes import TIME_LIMIT, Note, mark_stopped, next_note, still_mine, write_note
from lfstereo.batch.process import restore_malloc, time_limit
from lfstereo.errors import LfstereoError
from lfstereo.progress import Progress, StageClock

DISK_FULL = "disk full"
"""Kind of a failure that would meet every other pair too."""
SUPERSEDED = "superseded"
JobT = TypeVar("JobT", bound=Job)
_ONE_AT_A_TIME = threading.Lock()
"""A worker with several threads still converts one pair at a time: its memory is for one."""


@dataclass(frozen=True, slots=True)
class NotingClock(StageClock):
    """A clock that also tells the stage in the worker's note."""

    path: Path = field(default_factory=Path)
    note: Note = field(default_factory=lambda: Note("", 1, "", 0, "", 0.0))

    @contextmanager
    def stage(self, label: str) -> Iterator[Progress]:
        """Write the note, then measure the ``with`` block."""
        write_note(self.path, replace(self.note, stage=label))
        with StageClock.stage(self, label) as progress:
            yield progress


def attempt(job: JobT, body: Callable[[JobT, NotingClock], Outcome]) -> Outcome:
    """Do a job; an error becomes a failed outcome, and a second loss of the worker too where retries are used up.

    Parameters
    ----------
    job
        What to do.
    body
        Does it; :func:`check_not_superseded` guards what it makes visible.
    """
    with _ONE_AT_A_TIME:
        restore_malloc()
        lost, note = next_note(job)
        if lost is not None and (refused := verdict_on_loss(job, lost)) is not None:
            job.note.unlink(missing_ok=True)
            return refused
        clock = NotingClock(path=job.note, note=note)
        with time_limit(job.time_limit_s, lambda: mark_stopped(job.note, TIME_LIMIT)):
            outcome = _isolated(job, clock, body)
        if still_mine(job, note):
            job.note.unlink(missing_ok=True)
        return replace(
            outcome,
            seconds={name: round(seconds, 3) for name, seconds in clock.seconds.items()},
            peak_gib=round(max(clock.peak_gib.values(), default=0.0), 3),
            attempt=note.attempt,
            workers=(note.worker,),
        )


def verdict_on_loss(job: Job, lost: Note) -> Outcome | None:
    """Return the failure of a job whose worker was lost, or ``None`` if it may be tried again."""
    if lost.stopped == TIME_LIMIT:
        reason = f"stopped after {job.time_limit_s:g} s in stage '{lost.stage}'; raise --time-limit-s if it needs more"
        return Outcome(job.name, "failed", reason, TIME_LIMIT, attempt=lost.attempt, workers=(lost.worker,))
    if lost.attempt > job.retries:
        times = "once" if lost.attempt == 1 else f"{lost.attempt} times"
        reason = (
            f"its worker was lost {times}, last in stage '{lost.stage}' on {lost.worker}: killed, or out "
            "of memory; use fewer --workers"
        )
        return Outcome(job.name, "failed", reason, "worker lost", attempt=lost.attempt, workers=(lost.worker,))
    return None


def check_not_superseded(job: Job, clock: NotingClock) -> None:
    """Refuse to make a result visible when a later attempt has taken the job over.

    Raises
    ------
    Superseded
        If so.
    """
    if not still_mine(job, clock.note):
        raise Superseded(f"{job.name}: a later batch or attempt took this pair over; its result counts")


class Superseded(LfstereoError):
    """This attempt is out of date."""


def _isolated(job: JobT, clock: NotingClock, body: Callable[[JobT, NotingClock], Outcome]) -> Outcome:
    try:
        write_note(job.note, clock.note)
        return body(job, clock)
    except Superseded as error:
        return Outcome(job.name, "failed", str(error), SUPERSEDED)
    except LfstereoError as error:
        kind = DISK_FULL if _is_full(error) else type(error).__name__
        return Outcome(job.name, "failed", _one_line(error), kind)
    except MemoryError as error:
        reason = f"out of memory ({_one_line(error) or 'no details'}); use fewer --workers"
        return Outcome(job.name, "failed", reason, "out of memory")
    except OSError as error:
        kind = DISK_FULL if _is_full(error) else type(error).__name__
        return Outcome(job.name, "failed", _one_line(error), kind)
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        reason = f"bug: {_one_line(error)} ({Path(place.filename).name}, line {place.lineno}); please report it"
        return Outcome(job.name, "failed", reason, type(error).__name__)


def _is_full(error: BaseException | None) -> bool:
    """Return whether an error, or what it came from, is a full disk."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            return True
        error = error.__cause__
    return False


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
