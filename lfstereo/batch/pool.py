"""Local worker processes as one executor: the standard process pool, one per worker.

A standard pool fails every job it holds when one of its processes dies; pools of one process each tell whose it was.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import suppress
from typing import ParamSpec, TypeVar

from lfstereo.batch.process import start_worker

P = ParamSpec("P")
T = TypeVar("T")


class WorkerPool(Executor):
    """Processes started with spawn, replaced when they die.

    Parameters
    ----------
    workers
        Number of processes.
    threads
        Threads that numerical libraries may use in each.
    """

    def __init__(self, workers: int, threads: int) -> None:
        self._threads = threads
        self._pools = [self._new() for _ in range(workers)]
        self._held: list[set[Future[object]]] = [set() for _ in range(workers)]

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Hand a call to the worker with the least to do."""
        index = min(range(len(self._pools)), key=lambda i: len(self._held[i]))
        try:
            future = self._pools[index].submit(fn, *args, **kwargs)
        except RuntimeError:  # its process died while it had nothing to do, or has just died
            self._replace(index)
            future = self._pools[index].submit(fn, *args, **kwargs)
        held = self._held[index]
        held.add(future)  # type: ignore[arg-type]
        future.add_done_callback(held.discard)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the workers; with ``wait`` after what they do now, else at once."""
        for pool in self._pools:
            if not wait:
                for pid in _processes(pool):
                    self.kill(pid)
            pool.shutdown(cancel_futures=cancel_futures or not wait)

    def kill(self, pid: int) -> None:
        """Kill a worker by its process number, if it is one of these; its call ends with a broken pool."""
        if any(pid in _processes(pool) for pool in self._pools):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def _replace(self, index: int) -> None:
        self._pools[index].shutdown(wait=False)
        self._pools[index] = self._new()
        self._held[index] = set()

    def _new(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), start_worker, (self._threads,))


def _processes(pool: ProcessPoolExecutor) -> tuple[int, ...]:
    """Return the process numbers of a standard pool, which has no public way to tell them."""
    return tuple(getattr(pool, "_processes", None) or ())
