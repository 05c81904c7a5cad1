"""Where white images are kept that the user imported, and what was computed from them once."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import platformdirs
from filelock import FileLock

from lfstereo.errors import OutputError
from lfstereo.outputs import atomic_file

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


def remembered(name: str, compute: Callable[[], dict[str, Any]], usable: Callable[[dict[str, Any]], bool]) -> Any:
    """Return what was computed before under a name, or compute it now and keep it.

    Of several processes that ask at once one computes and the others wait for it. Where the cache cannot be
    written, the value is computed every time.

    Parameters
    ----------
    name
        File name inside the cache, without suffix; it must change whenever the value would.
    compute
        Gives the value, an object that JSON can hold; its errors pass through and nothing is kept.
    usable
        Tells whether a stored value has the expected form; one that has not is computed again.
    """
    path = cache_folder() / f"{name}.json"
    found = _stored(path, usable)
    if found is not None:
        return found
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock = FileLock(path.with_suffix(".lock"))
        lock.acquire()
    except (OSError, NotImplementedError):
        return compute()
    try:
        found = _stored(path, usable)
        if found is None:
            found = compute()
            with suppress(OutputError), atomic_file(path, force=True) as scratch:
                scratch.write_text(json.dumps(found), "ascii")
        return found
    finally:
        lock.release()


def _stored(path: Path, usable: Callable[[dict[str, Any]], bool]) -> dict[str, Any] | None:
    try:
        found = json.loads(path.read_text("ascii"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and usable(found) else None
