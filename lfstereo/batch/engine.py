"""Hands jobs to executors, one step after the other, and takes every end of them in: done, failed or lost.

What a worker left on the storage counts before what its future says, which may hang or err where a worker is lost.
"""

from __future__ import annotations

import secrets
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass, replace
from typing import Any

from lfstereo.batch.attempts import DISK_FULL, SUPERSEDED, verdict_on_loss
from lfstereo.batch.crew import Crew, Step
from lfstereo.batch.jobs import Job, Outcome, together
from lfstereo.batch.notes import TIME_LIMIT, Note, lost_note, read_answer, read_note

_TICK_S = 1.0
_GRACE_S = 20.0
"""Beyond the time limit, for a worker to end itself."""


@dataclass(frozen=True, slots=True)
class Flight:
    """A job in an executor."""

    job: Any
    at: int
    """Number of the step."""
    before: Outcome | None
    """What the step before made."""


class Engine:
    """The run of some jobs through the steps of a crew.

    Parameters
    ----------
    crew
        Who works.
    steps
        What is done with each job.
    ended
        Told the outcome of each job.
    tick
        Told, about every second, what the workers do.
    """

    def __init__(
        self,
        crew: Crew,
        steps: Sequence[Step],
        ended: Callable[[Outcome], None],
        tick: Callable[[Sequence[Note]], None],
    ) -> None:
        self._crew, self._steps, self._ended, self._tick = crew, steps, ended, tick
        self._waiting: list[deque[Flight]] = [deque() for _ in steps]
        self._flying: dict[Future[Outcome], Flight] = {}
        self._lost: Counter[str] = Counter()
        self._seen: dict[tuple[str, int, int], float] = {}
        self._answered: set[str] = set()
        self._looked = 0.0
        self._stopped = ""

    def run(self, jobs: Sequence[Job]) -> str:
        """Take all jobs to an end.

        Returns
        -------
        Empty, or why jobs were left that nothing is known of: the disk is full, the scheduler is gone.
        """
        self._waiting[0].extend(Flight(job, 0, None) for job in jobs)
        while self._flying or (any(self._waiting) and not self._stopped):
            self._hand_out()
            done, _ = wait(self._flying, _TICK_S, FIRST_COMPLETED)
            for future in done:
                self._take_in(self._flying.pop(future), future)
            if time.monotonic() - self._looked >= _TICK_S:
                self._looked = time.monotonic()
                self._look_after()
        return self._stopped

    def _hand_out(self) -> None:
        if self._stopped:
            return
        for at in reversed(range(len(self._steps))):
            step, queue = self._steps[at], self._waiting[at]
            room = step.capacity() - sum(flight.at == at for flight in self._flying.values()) if queue else 0
            if at + 1 < len(self._steps):
                room = min(room, 2 * self._steps[at + 1].capacity() - len(self._waiting[at + 1]))
            for _ in range(min(room, len(queue))):
                flight = queue.popleft()
                try:
                    self._flying[step.executor.submit(step.work, flight.job)] = flight
                except Exception as error:  # a closed client has its own kind
                    queue.appendleft(flight)
                    self._stopped = f"no work can be handed out ({error})"
                    return

    def _take_in(self, flight: Flight, future: Future[Outcome]) -> None:
        """Take in a job whose future ended."""
        answer = read_answer(flight.job)
        if answer is not None:
            self._accept(flight, answer)
            return
        try:
            outcome = future.result()
        except CancelledError:
            self._stopped = "the scheduler was lost"
        except Exception as error:
            if self._crew.lost_a_worker(error):
                self._again(flight)
                return
            words = " ".join(str(error).split())
            self._accept(flight, Outcome(flight.job.name, "failed", f"worker: {words}", type(error).__name__))
        else:
            self._accept(flight, outcome)

    def _accept(self, flight: Flight, outcome: Outcome) -> None:
        """Go on with what a worker made of a job."""
        if outcome.kind == SUPERSEDED:  # by work of an earlier batch that a cluster did not drop in time
            self._again(flight)
            return
        outcome = together(flight.before, outcome)
        if outcome.kind == DISK_FULL:
            self._stopped = outcome.reason
        if outcome.state == "focused":
            following = replace(flight.job, token=secrets.token_hex(8))
            self._waiting[flight.at + 1].append(Flight(following, flight.at + 1, outcome))
        else:
            self._ended(outcome)

    def _again(self, flight: Flight) -> None:
        """Try a job again whose worker died, unless it died of the job too often."""
        job = flight.job
        self._lost[job.name] += 1
        note = lost_note(job) or Note(job.token, self._lost[job.name], "", 0, "start", 0.0)
        since = self._seen.get((job.name, flight.at, note.attempt), time.monotonic())
        if time.monotonic() - since >= job.time_limit_s:
            note = replace(note, stopped=TIME_LIMIT)  # it did not answer any more, and was killed
        verdict = verdict_on_loss(job, replace(note, attempt=max(note.attempt, self._lost[job.name])))
        if verdict is None:
            self._waiting[flight.at].appendleft(flight)
        else:
            job.note.unlink(missing_ok=True)
            self._ended(together(flight.before, verdict))

    def _look_after(self) -> None:
        """Read what the workers left; end a worker that is over its time and did not end itself.

        An answer is taken in without its future if that has not ended a tick later.
        """
        notes = []
        for future, flight in list(self._flying.items()):
            answer = read_answer(flight.job)
            if answer is not None and flight.job.token in self._answered:
                self._accept(self._flying.pop(future), answer)
                continue
            if answer is not None:
                self._answered.add(flight.job.token)
            note = read_note(flight.job.note)
            if note is None or note.token != flight.job.token:
                continue
            notes.append(note)
            since = self._seen.setdefault((flight.job.name, flight.at, note.attempt), time.monotonic())
            if time.monotonic() - since > flight.job.time_limit_s + _GRACE_S:
                self._crew.stop(note)
        self._tick(notes)
