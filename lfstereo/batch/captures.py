"""The captures under a folder, with what tells cameras and exposures apart; no pixel is read."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from lfstereo.container.capture import BARE_SUFFIX, CONTAINER_SUFFIXES, read_metadata, read_sidecar
from lfstereo.container.contents import frame_section
from lfstereo.container.metadata import FrameMetadata
from lfstereo.container.reader import read_container
from lfstereo.errors import InputError
from lfstereo.lightfield.store import SUFFIXES as DECODED_SUFFIXES

_WHITE_IMAGE_NAME = "MOD_"


@dataclass(frozen=True, slots=True)
class CaptureFile:
    """One capture on disk."""

    path: Path
    """Absolute."""
    place: Path
    """Relative to the folder that was searched."""
    metadata: FrameMetadata | None = None
    """``None`` for a light field that is decoded already, and where they cannot be read."""
    frame_sha1: str = ""
    """SHA-1 that the container states for the raw frame; empty for other files."""
    problem: str = ""
    """Why the metadata cannot be read, on one line."""

    @property
    def serial(self) -> str:
        """Serial number of the camera; empty where unknown."""
        return self.metadata.serial if self.metadata else ""

    @property
    def taken_s(self) -> float | None:
        """Seconds since 1970 by the camera's own clock; ``None`` where unknown."""
        try:
            moment = datetime.fromisoformat(self.metadata.captured_at if self.metadata else "")
        except ValueError:
            return None
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def list_captures(folder: Path, skip: Iterable[Path] = ()) -> tuple[CaptureFile, ...]:
    """List the captures under a folder, in the order of their paths; white images and dark frames are passed over.

    Parameters
    ----------
    folder
        Searched with its sub-folders, hidden ones left out.
    skip
        Folders inside it that hold no captures, such as the results.

    Raises
    ------
    InputError
        If there is no such folder.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: found no such folder, expected one with captures; check the path")
    root, skipped = folder.resolve(), {path.resolve() for path in skip}
    found: list[CaptureFile] = []
    for place, folders, files in os.walk(root):
        here = Path(place)
        folders[:] = sorted(f for f in folders if not f.startswith(".") and here / f not in skipped)
        found += [capture for name in files if (capture := _described(here / name, root))]
    return tuple(sorted(found, key=lambda capture: capture.place))


def _described(path: Path, root: Path) -> CaptureFile | None:
    suffix, place = path.suffix.lower(), path.relative_to(root)
    if suffix in DECODED_SUFFIXES:
        return CaptureFile(path, place)
    if suffix not in (*CONTAINER_SUFFIXES, BARE_SUFFIX) or path.name.startswith("."):
        return None
    if suffix == BARE_SUFFIX and _WHITE_IMAGE_NAME in path.name.upper():
        return None
    try:
        metadata, sha1 = _read(path)
    except InputError as error:
        return CaptureFile(path, place, problem=str(error))
    if metadata.is_white_image or metadata.is_dark_frame:
        return None
    return CaptureFile(path, place, metadata, sha1)


def _read(path: Path) -> tuple[FrameMetadata, str]:
    if path.suffix.lower() == BARE_SUFFIX:
        return read_sidecar(path), ""
    container = read_container(path)
    return read_metadata(container), frame_section(container, "imageRef").sha1
