"""Where white images are kept that the user imported, and what was computed from them once."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import platformdirs
from filelock import FileLock

from lfstereo.errors import OutputError
from lfstereo.outputs import atomic_file

ValueT = TypeVar("ValueT")
HOME_VARIABLE = "LFSTEREO_HOME"
"""Environment variable that names one folder for both, in place of the platform's own."""


def library_folder() -> Path:
    """Return the folder of imported white images: in the platform's folder for users' data."""
    home = os.environ.get(HOME_VARIABLE)
    return Path(home) / "whites" if home else platformdirs.user_data_path("lfstereo") / "whites"


def cache_folder() -> Path:
    """Return the folder of what can be computed again: in the platform's folder for caches."""
    home = os.environ.get(HOME_VARIABLE)
    return Path(home) / "cache" if home else platformdirs.user_cache_path("lfstereo")


def remembered(name: str, compute: Callable[[], dict[str, Any]], build: Callable[[Any], ValueT]) -> ValueT:
    """Return what was computed before under a name, or compute it now and keep it.

    Of several processes that ask at once one computes and the others wait for it. Where the cache cannot be
    written, the value is computed every time.

    Parameters
    ----------
    name
        File name inside the cache, without suffix; it must change whenever the value would.
    compute
        Gives an object that JSON can hold; its errors pass through and nothing is kept.
    build
        Turns that object, read from the cache or new, into the value. A stored one for which it raises ``KeyError``,
        ``TypeError`` or ``ValueError`` is computed again.
    """
    path = cache_folder() / f"{name}.json"
    found = _stored(path, build)
    if found is not None:
        return found
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path.with_suffix(".lock"))
        lock.acquire()
    except (OSError, NotImplementedError):
        return build(compute())
    try:
        found = _stored(path, build)
        if found is None:
            computed = compute()
            with suppress(OutputError), atomic_file(path, force=True) as scratch:
                scratch.write_text(json.dumps(computed), "ascii")
            found = build(computed)
        return found
    finally:
        lock.release()


def _stored(path: Path, build: Callable[[Any], ValueT]) -> ValueT | None:
    try:
        return build(json.loads(path.read_text("ascii")))
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return None
