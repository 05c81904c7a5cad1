"""Results appear whole or not at all: write beside, then rename."""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lfstereo.errors import OutputError

_RESERVED_ON_WINDOWS = frozenset(
    ("con", "prn", "aux", "nul", *(f"{port}{number}" for port in ("com", "lpt") for number in range(10)))
)
"""Microsoft, "Naming Files, Paths, and Namespaces": devices, with any suffix."""


def check_absent(target: Path, force: bool) -> None:
    """Refuse an output that exists already, before any work is done.

    Raises
    ------
    OutputError
        If ``target`` exists and ``force`` is not set.
    """
    if target.exists() and not force:
        raise OutputError(f"{target}: exists already; give another output path, or --force to replace it")


def check_space(target: Path, size_bytes: int) -> None:
    """Refuse to begin a large file for which the disk has no room.

    Raises
    ------
    OutputError
        If less than ``size_bytes`` are free where ``target`` is to lie.
    """
    place = next((p for p in target.absolute().parents if p.is_dir()), Path())
    free = shutil.disk_usage(place).free
    if free < size_bytes:
        raise OutputError(
            f"{target}: the disk is full; needs {size_bytes / 2**20:.0f} MiB, {free / 2**20:.0f} MiB are free"
        )


def portable_name(text: str) -> str:
    """Return a file name that every system allows: letters, digits, ``-``, ``_`` and single dots inside.

    Examples
    --------
    >>> portable_name("B51:43/..9"), portable_name("con.txt"), portable_name("MOD_0001.RAW"), portable_name("")
    ('B51_43_.9', '_con.txt', 'MOD_0001.RAW', '_')
    """
    kept = "".join(c if c.isascii() and (c.isalnum() or c in "-_.") else "_" for c in text)
    name = re.sub(r"\.+", ".", kept).strip(".")
    reserved = name.partition(".")[0].lower() in _RESERVED_ON_WINDOWS
    return f"_{name}" if reserved or not name else name


@contextmanager
def atomic_file(target: Path, force: bool = False) -> Iterator[Path]:
    """Give a scratch path beside ``target``; rename it to ``target`` when the block ends without an error.

    Raises
    ------
    OutputError
        If ``target`` exists and ``force`` is not set, or it cannot be written (disk full, read-only).
    """
    check_absent(target, force)
    if target.is_dir():
        raise OutputError(f"{target}: is a folder, expected a file name; give another output path")
    scratch = _scratch_path(target)
    try:
        with _explained(target):
            yield scratch
            os.replace(scratch, target)
    finally:
        scratch.unlink(missing_ok=True)


@contextmanager
def atomic_folder(target: Path, force: bool = False) -> Iterator[Path]:
    """Give a scratch folder beside ``target``; rename it to ``target`` when the block ends without an error.

    Raises
    ------
    OutputError
        If ``target`` exists and ``force`` is not set, or it cannot be written (disk full, read-only).
    """
    check_absent(target, force)
    if target.exists() and not target.is_dir():
        raise OutputError(f"{target}: is a file, expected a folder; give another output path")
    scratch = _scratch_path(target)
    try:
        with _explained(target):
            scratch.mkdir(parents=True)
            yield scratch
            _swap(scratch, target)
    except OutputError as error:
        raise OutputError(str(error).replace(str(scratch), str(target))) from error
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _swap(scratch: Path, target: Path) -> None:
    if not target.exists():
        os.replace(scratch, target)
        return
    old = _scratch_path(target)
    os.replace(target, old)
    os.replace(scratch, target)
    shutil.rmtree(old, ignore_errors=True)


def _scratch_path(target: Path) -> Path:
    return target.parent / f".{target.name}.{secrets.token_hex(4)}.partial"


@contextmanager
def _explained(target: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise OutputError(f"{target}: the disk is full; nothing was kept, free some space and run again") from error
        if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOENT, errno.ENOTDIR):
            raise OutputError(f"{target}: cannot be written ({error.strerror}); choose another place") from error
        raise
