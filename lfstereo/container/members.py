"""The files of a folder, a tar archive or a camera's backup volumes (``data.C.0``, ``data.C.1``, …), seen alike."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from lfstereo.container.fields import Json
from lfstereo.container.reader import read_container
from lfstereo.container.tar_entries import tar_entries
from lfstereo.errors import ContainerError

TAR_SUFFIX = ".tar"
_VOLUME_NAME = re.compile(r"\.C\.\d+$", re.IGNORECASE)
"""The desktop program of the first camera keeps its backup in ``data.C.0`` and the volumes that follow."""
_DRIVE = re.compile(r"^[A-Za-z]:")
_LONGEST_NAME = 1024
_UNFINISHED = ".partial"
"""How `lfstereo.outputs` names what it has not finished."""


@dataclass(frozen=True, slots=True)
class Member:
    """One file, wherever it lies."""

    name: str
    """Path inside its folder or archive, parts joined by ``/``."""
    file: Path
    """File on disk that holds its bytes."""
    offset: int
    """Byte of that file at which they start."""
    length: int
    sha1: str = ""
    """40 hexadecimal digits that the archive states; empty where it states none."""

    @property
    def where(self) -> str:
        """Name for messages."""
        return str(self.file) if self.offset == 0 else f"{self.file}: {self.name}"

    def read(self) -> bytes:
        """Read its bytes, and verify their SHA-1 where the archive states one.

        Raises
        ------
        ContainerError
            If they cannot be read, are cut off or damaged.
        """
        try:
            with self.file.open("rb") as file:
                rest = file.seek(0, 2) - self.offset
                file.seek(self.offset)
                data = file.read(min(self.length, rest)) if rest > 0 else b""
        except OSError as error:
            raise ContainerError(f"{self.where}: cannot be read ({error.strerror}); check its permissions") from error
        if len(data) != self.length:
            raise ContainerError(
                f"{self.where}: found {len(data)} bytes, expected {self.length}; the file is cut off, copy it again"
            )
        if self.sha1 and hashlib.sha1(data, usedforsecurity=False).hexdigest() != self.sha1:
            raise ContainerError(f"{self.where}: found bytes of another SHA-1 than {self.sha1}; copy the archive again")
        return data


def is_archive(path: Path) -> bool:
    """Return whether a name is that of a tar archive or of a camera's backup volume.

    Examples
    --------
    >>> is_archive(Path("caldata-B5143909630.tar")), is_archive(Path("data.C.2")), is_archive(Path("MOD_0001.RAW"))
    (True, True, False)
    """
    return path.suffix.lower() == TAR_SUFFIX or _VOLUME_NAME.search(path.name) is not None


def finished_files(folder: Path) -> list[Path]:
    """Return the files in and below a folder, sorted, without those that another process is still writing."""
    return sorted(p for p in folder.rglob("*") if not p.name.endswith(_UNFINISHED) and p.is_file())


def list_members(place: Path) -> Iterator[Member]:
    """Yield the files of a folder and of all archives in it, or of one archive, sorted by path.

    Nothing is unpacked: a member says where its bytes lie. Of backup volumes that lie side by side each is read by
    itself; a volume that another names as its successor and that is missing is an error.

    Parameters
    ----------
    place
        Folder, ``.tar`` archive (not compressed, as Lytro's programs write it), or one backup volume.

    Raises
    ------
    ContainerError
        If an archive is damaged, or a volume is missing.
    """
    if place.is_dir():
        for path in finished_files(place):
            inside = path.relative_to(place)
            if is_archive(path):
                yield from (_moved(member, inside.parent) for member in _archive_members(path))
            else:
                yield Member(inside.as_posix(), path, 0, path.stat().st_size)
    else:
        yield from _archive_members(place)


def _moved(member: Member, folder: Path) -> Member:
    name = (PurePosixPath(folder.as_posix()) / member.name).as_posix()
    return Member(name, member.file, member.offset, member.length, member.sha1)


def _archive_members(path: Path) -> Iterator[Member]:
    if path.suffix.lower() == TAR_SUFFIX:
        yield from _tar_members(path)
    elif _VOLUME_NAME.search(path.name):
        yield from _volume_members(path)
    else:
        raise ContainerError(f"{path}: found no archive, expected .tar or a volume such as data.C.0; give a folder")


def _tar_members(path: Path) -> Iterator[Member]:
    try:
        for entry in tar_entries(path):
            yield Member(_clean(entry.name, path), path, entry.offset, entry.length)
    except OSError as error:
        raise ContainerError(f"{path}: cannot be read ({error.strerror}); check its permissions") from error


def _volume_members(path: Path) -> Iterator[Member]:
    """Yield what the ``files`` of a volume's table of contents name.

    References
    ----------
    D. G. Dansereau, Light Field Toolbox v0.5.3, LFUtilUnpackLytroArchive: ``files[].name`` such as
    ``C:\\T1CALIB\\MOD_0000.RAW``, ``files[].dataRef`` the section's SHA-1, ``nextFile`` the volume that follows.
    """
    container = read_container(path)
    following = container.toc.get("nextFile")
    if isinstance(following, str) and following and not (path.parent / Path(following).name).is_file():
        raise ContainerError(
            f"{path}: found that volume {Path(following).name!r} follows, which is missing; copy all volumes"
        )
    for name, reference in _listed_files(container.toc, path):
        section, inside = container.find(reference), _clean(name, path)
        if section is None:
            raise ContainerError(
                f"{path}: byte {container.size}: the file ends here, expected the section of {inside}; copy it again"
            )
        yield Member(inside, path, section.data_offset, section.length, section.sha1)


def _listed_files(toc: Json, path: Path) -> Iterator[tuple[str, str]]:
    files = toc.get("files")
    if not isinstance(files, list):
        raise ContainerError(
            f"{path}: found a table of contents without 'files', expected one; give a camera's backup volumes"
        )
    for entry in files:
        name, reference = (entry.get(key) if isinstance(entry, dict) else None for key in ("name", "dataRef"))
        if not isinstance(name, str) or not isinstance(reference, str):
            raise ContainerError(
                f"{path}: found an entry of 'files' without name or dataRef, expected both; copy it again"
            )
        yield name, reference


def _clean(name: str, path: Path) -> str:
    """Return a name of an archive as a relative path that stays inside its folder.

    Examples
    --------
    >>> _clean("C:\\\\T1CALIB\\\\MOD_0000.RAW", Path("data.C.0"))
    'T1CALIB/MOD_0000.RAW'
    """
    parts = PurePosixPath(_DRIVE.sub("", name).replace("\\", "/").lstrip("/")).parts
    if not parts or ".." in parts or not name.isprintable() or len(name) > _LONGEST_NAME:
        shown = repr(name[:60])
        raise ContainerError(f"{path}: found a file named {shown}, expected a path inside the archive; do not use it")
    return "/".join(parts)
