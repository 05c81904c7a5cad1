"""What of a file or folder can be looked at."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from lfstereo.errors import ContainerError
from lfstereo.lightfield.store import SUFFIXES
from lfstereo.lightfield.views_folder import IMAGE_SUFFIXES
from lfstereo.pipeline import CAPTURE_SUFFIXES
from lfstereo.viewer.content import PAGE_NAME

_CAPTURES_IN_FOLDERS = (".lfr", ".lfp")
"""Bare RAW files inside a folder mostly are white images."""
_MOST_ITEMS = 500


@dataclass(frozen=True, slots=True)
class Item:
    """One thing to look at."""

    name: str
    """Path below the opened folder."""
    path: Path
    kind: Literal["result", "light field", "capture"]


def find_items(path: Path) -> tuple[Item, ...]:
    """Return what can be looked at: one file, one result folder, or all that a folder holds, by name.

    Links that lead out of the folder are left out.

    Raises
    ------
    ContainerError
        If there is no such file or folder, or nothing in it can be looked at.
    """
    if path.is_file():
        kind: Literal["capture", "light field"] = (
            "capture" if path.suffix.lower() in CAPTURE_SUFFIXES else "light field"
        )
        return (Item(path.name, path, kind),)
    if not path.is_dir():
        raise ContainerError(f"{path}: found no such file or folder, expected a result, a light field or a capture")
    if (path / PAGE_NAME).is_file():
        return (Item(path.resolve().name, path, "result"),)
    found = _below(path)
    if found:
        return tuple(found[:_MOST_ITEMS])
    if any(entry.suffix.lower() in IMAGE_SUFFIXES for entry in path.iterdir()):
        return (Item(path.resolve().name, path, "light field"),)
    raise ContainerError(
        f"{path}: found no {PAGE_NAME}, light field (.h5) or capture (.LFR, .LFP); give a folder that holds some"
    )


def _below(root: Path) -> list[Item]:
    items = []
    inside = root.resolve()
    for place, folders, files in os.walk(root):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        here = Path(place)
        if PAGE_NAME in files:
            folders.clear()
            items.append(Item(here.relative_to(root).as_posix(), here, "result"))
            continue
        for name in sorted(files):
            path = here / name
            suffix = path.suffix.lower()
            if not name.startswith(".") and suffix in (*SUFFIXES, *_CAPTURES_IN_FOLDERS):
                kind = "light field" if suffix in SUFFIXES else "capture"
                items.append(Item(path.relative_to(root).as_posix(), path, kind))  # type: ignore[arg-type]
    items = [item for item in items if item.path.resolve().is_relative_to(inside)]
    return sorted(items, key=lambda item: item.name.casefold())
