"""A worker process: started light, ended when its parent is gone or its time is up."""

from __future__ import annotations

import ctypes
import faulthandler
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO

_GRACE_S = 2.0
"""Time for the watching thread to act before the hard stop, which also ends code that holds the interpreter."""
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_LARGEST_ADAPTED = 32 << 20
"""Where glibc's own adaption ends on 64-bit machines; bytes."""
_THREAD_SETTINGS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def start_worker(threads: int) -> None:
    """Prepare a local worker process, before it imports anything large.

    Parameters
    ----------
    threads
        Threads that numerical libraries may use.
    """
    for name in _THREAD_SETTINGS:
        os.environ[name] = str(threads)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:

        def follow() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=follow, daemon=True).start()


def restore_malloc() -> None:
    """Undo Dask's setting that makes every array of more than 128 KiB fresh memory, zeroed by the kernel.

    A nanny sets ``MALLOC_TRIM_THRESHOLD_``, which also ends glibc's own adaption of the size from which memory is
    mapped (mallopt(3)); decoding then spends as much time in the kernel as in computing. Does nothing elsewhere.
    """
    if "MALLOC_TRIM_THRESHOLD_" in os.environ:
        with suppress(OSError, AttributeError):
            mallopt = ctypes.CDLL(None).mallopt
            mallopt(_M_MMAP_THRESHOLD, _LARGEST_ADAPTED)
            mallopt(_M_TRIM_THRESHOLD, 2 * _LARGEST_ADAPTED)


@contextmanager
def time_limit(limit_s: float, last_words: Callable[[], None], trace: Path) -> Iterator[None]:
    """End this process if the block takes longer.

    Parameters
    ----------
    limit_s
        Wall time.
    last_words
        Called before the end, where the interpreter still runs.
    trace
        Written where it does not: the place in the code. Nothing is in it otherwise; removed at the end of the block.
    """

    def stop() -> None:
        with suppress(OSError):
            last_words()
        os._exit(1)

    timer = threading.Timer(limit_s, stop)
    timer.daemon = True
    with _opened(trace) as file:
        timer.start()
        faulthandler.dump_traceback_later(limit_s + _GRACE_S, exit=True, file=file)
        try:
            yield
        finally:
            timer.cancel()
            faulthandler.cancel_dump_traceback_later()
    with suppress(OSError):
        trace.unlink()


def _opened(trace: Path) -> TextIO:
    """Return the file opened, or nowhere if it cannot be: what else cannot be written there will be told."""
    with suppress(OSError):
        trace.parent.mkdir(parents=True, exist_ok=True)
        return trace.open("w")
    return Path(os.devnull).open("w")
