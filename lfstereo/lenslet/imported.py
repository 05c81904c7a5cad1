"""Import white images: copy what a camera left into the user's library."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from lfstereo.container.members import Member
from lfstereo.errors import AssetError
from lfstereo.lenslet.library import WhiteImage, open_library
from lfstereo.outputs import atomic_file, portable_name
from lfstereo.progress import Progress, silent


@dataclass(frozen=True, slots=True)
class Imported:
    """What an import did."""

    whites: tuple[WhiteImage, ...]
    copied: int
    """Files copied."""
    kept: int
    """Files that were there already, with the same bytes."""


def import_whites(source: Path, library: Path, progress: Progress = silent) -> Imported:
    """Copy the white images of a folder or archive into a library, one sub-folder per camera.

    Every file appears whole or not at all; several imports may run at once. Files that are there already with the same
    bytes are left alone; others of the same name are replaced.

    Parameters
    ----------
    source
        Folder, ``.tar`` archive or backup volumes with white images, as `open_library` reads them.
    library
        Folder to copy to.
    progress
        Told of the files done.

    Raises
    ------
    AssetError
        If the source does not exist, holds no white image, or one of them tells no serial number.
    ContainerError
        If a file is damaged.
    OutputError
        If the library cannot be written.
    """
    found = open_library(source)
    if not found.whites:
        reason = f"; the first unreadable one: {found.problems[0]}" if found.problems else ""
        raise AssetError(f"{source}: found no white image, expected MOD_*.RAW with .TXT beside{reason}")
    nameless = [white.raw.where for white in found.whites if not white.serial]
    if nameless:
        raise AssetError(
            f"{nameless[0]}: found no serial number, expected one, in its text file or in unit_info.json beside it; "
            "give this folder with --whites instead"
        )
    wanted = dict(target for white in found.whites for target in _targets(white, library))
    copied = 0
    for done, (target, member) in enumerate(wanted.items()):
        copied += _copy(member, target)
        progress(done + 1, len(wanted))
    return Imported(found.whites, copied, len(wanted) - copied)


def _targets(white: WhiteImage, library: Path) -> Iterator[tuple[Path, Member]]:
    folder = library / portable_name(white.serial)
    for member in (white.raw, white.text, white.hot_pixels, white.factory, white.unit_info, white.manifest):
        if member is not None:
            yield folder / portable_name(PurePosixPath(member.name).name), member


def _copy(member: Member, target: Path) -> bool:
    """Copy one file, unless it is there already; return whether it was copied."""
    data = member.read()
    if target.is_file() and target.stat().st_size == len(data) and target.read_bytes() == data:
        return False
    target.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(target, force=True) as scratch:
        scratch.write_bytes(data)
    return True
