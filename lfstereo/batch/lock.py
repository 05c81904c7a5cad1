"""One batch per output folder, or the shards of one batch: an advisory lock that ends with its process."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from lfstereo.batch.jobs import WORK_FOLDER
from lfstereo.errors import OutputError


@contextmanager
def output_lock(output: Path, shard: tuple[int, int]) -> Iterator[None]:
    """Hold an output folder against other batches.

    A whole batch excludes everybody. Shards i/n of one n exclude a whole batch, shards of another n, and a second i/n.
    The kernel lets the lock go when the process ends, however it ends.

    Raises
    ------
    OutputError
        If another batch holds it.
    """
    part, parts = shard
    folder = output / WORK_FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    whole, own = folder / "lock", folder / f"lock.{part}-of-{parts}"
    with whole.open("a+") as common, own.open("a+") as mine:
        if not _taken(common.fileno(), fcntl.LOCK_EX):
            if parts == 1 or not _taken(common.fileno(), fcntl.LOCK_SH):
                raise OutputError(f"{output}: {_holder(whole)} writes here; wait for it, or give another folder")
            if _holder(whole).split(",")[0] != f"a batch of {parts} shards":
                raise OutputError(f"{output}: {_holder(whole)} writes here; give --shard i/n with the same n")
        elif parts > 1:
            _write(common.fileno(), f"a batch of {parts} shards, first process {_process()}")
            fcntl.flock(common.fileno(), fcntl.LOCK_SH)
        else:
            _write(common.fileno(), f"another batch, process {_process()},")
        if not _taken(mine.fileno(), fcntl.LOCK_EX):
            raise OutputError(f"{output}: {_holder(own)} does shard {part}/{parts} already; wait for it")
        _write(mine.fileno(), f"process {_process()}")
        yield


def _taken(file: int, how: int) -> bool:
    with suppress(BlockingIOError):
        fcntl.flock(file, how | fcntl.LOCK_NB)
        return True
    return False


def _write(file: int, text: str) -> None:
    os.ftruncate(file, 0)
    os.pwrite(file, text.encode(), 0)


def _holder(path: Path) -> str:
    return path.read_text("utf-8") or "another batch"


def _process() -> str:
    return f"{os.getpid()} on {os.uname().nodename}"
