"""Who converts the pairs: local processes or a Dask cluster, both as executors with the steps they take."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor
from dataclasses import dataclass
from typing import Any, Protocol

from lfstereo.batch.jobs import Outcome, Work
from lfstereo.batch.memory import fitting_workers, free_memory_gib, usable_cores
from lfstereo.batch.notes import Note
from lfstereo.batch.options import BatchOptions
from lfstereo.batch.pool import WorkerPool


@dataclass(frozen=True, slots=True)
class PairWork:
    """The functions that convert a pair."""

    whole: Work
    """All steps in one worker."""
    focus: Work
    """The steps before the network."""
    match: Work
    """The network and the rest."""


@dataclass(frozen=True, slots=True)
class Step:
    """One step of every pair, and who takes it."""

    work: Callable[[Any], Outcome]
    executor: Executor
    capacity: Callable[[], int]
    """Jobs to hand out at a time."""


class Crew(Protocol):
    """Workers of one kind."""

    description: str
    """One line for the user."""
    steps: tuple[Step, ...]

    def lost_a_worker(self, error: Exception, /) -> bool:
        """Return whether a call ended with this error because its worker died."""

    def stop(self, note: Note, /) -> None:
        """End a worker that is over its time and cannot end itself, where that can be done from here."""

    def close(self, at_once: bool, /) -> None:
        """Let the workers go."""


class LocalCrew:
    """Processes of this machine."""

    def __init__(self, options: BatchOptions, pair_gib: float, work: PairWork, cuda: bool) -> None:
        free, cores = free_memory_gib(), usable_cores()
        workers = options.workers or fitting_workers(pair_gib, free, cores)
        apart = options.network_workers if options.network_workers >= 0 else int(cuda)
        threads = max(1, cores // workers)
        self._pools = [WorkerPool(workers, threads)]
        if apart:
            self._pools.append(WorkerPool(apart, threads))
            parts = ((work.focus, self._pools[0], workers), (work.match, self._pools[1], apart))
            self.steps = tuple(Step(w, pool, _always(count)) for w, pool, count in parts)
        else:
            self.steps = (Step(work.whole, self._pools[0], _always(workers)),)
        beside = f" and {apart} for the network" if apart else ""
        self.description = (
            f"{workers} worker{'s' * (workers > 1)}{beside} of {threads} thread{'s' * (threads > 1)}: "
            f"{cores} cores, {pair_gib:.1f} GiB each of {free:.1f} GiB free"
        )

    def lost_a_worker(self, error: Exception, /) -> bool:
        """Return whether its pool broke."""
        return isinstance(error, BrokenExecutor)

    def stop(self, note: Note, /) -> None:
        """Kill the worker."""
        for pool in self._pools:
            pool.kill(note.process)

    def close(self, at_once: bool, /) -> None:
        """End the processes."""
        for pool in self._pools:
            pool.shutdown(wait=not at_once)


def _always(count: int) -> Callable[[], int]:
    return lambda: count
