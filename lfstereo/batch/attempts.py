"""One attempt at a job inside a worker: within its time, and without harm to the jobs that follow."""

from __future__ import annotations

import errno
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from lfstereo.batch.jobs import Job, Outcome
from lfstereo.batch.notes import (
    TIME_LIMIT,
    Note,
    keep_answer,
    mark_stopped,
    next_note,
    read_answer,
    still_mine,
    trace_of,
    write_note,
)
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
        """Write the note, then measure the ``with`` block.

        Raises
        ------
        Superseded
            If the job was taken over; it would be for nothing to go on.
        """
        self.check_not_superseded()
        write_note(self.path, replace(self.note, stage=label))
        with StageClock.stage(self, label) as progress:
            yield progress

    def check_not_superseded(self) -> None:
        """Refuse to go on, or to make a result visible, when a later attempt has taken the job over.

        Raises
        ------
        Superseded
            If so.
        """
        if not still_mine(self.path, self.note):
            raise Superseded(f"{self.path.stem}: a later batch or attempt took this pair over; its result counts")


def attempt(job: JobT, body: Callable[[JobT, NotingClock], Outcome]) -> Outcome:
    """Do a job; an error becomes a failed outcome, and a second loss of the worker too where retries are used up.

    Parameters
    ----------
    job
        What to do.
    body
        Does it; :meth:`NotingClock.check_not_superseded` guards what it makes visible.
    """
    with _ONE_AT_A_TIME:
        restore_malloc()
        if (known := read_answer(job)) is not None:
            return known  # of a worker that was lost with its answer, once the work was done
        lost, note = next_note(job)
        if lost is not None and (refused := verdict_on_loss(job, lost)) is not None:
            return _left(job, lost, refused)
        clock = NotingClock(path=job.note, note=note)
        trace = trace_of(job, note.attempt)
        with time_limit(job.time_limit_s, lambda: mark_stopped(job.note, note, TIME_LIMIT), trace):
            outcome = _isolated(job, clock, body)
        outcome = replace(
            outcome,
            seconds={name: round(seconds, 3) for name, seconds in clock.seconds.items()},
            peak_gib=round(max(clock.peak_gib.values(), default=0.0), 3),
            attempt=note.attempt,
            workers=(note.worker,),
        )
        return _left(job, note, outcome)


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


class Superseded(LfstereoError):
    """This attempt is out of date."""


def _left(job: Job, note: Note, outcome: Outcome) -> Outcome:
    """Leave the outcome on the storage, if there is room, unless another attempt is at the job by now."""
    if still_mine(job.note, note):
        with suppress(OSError):
            keep_answer(job, outcome)
        job.note.unlink(missing_ok=True)
    return outcome


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
