"""All white images of a folder or archive, by camera, zoom and focus."""

from __future__ import annotations

import dataclasses
import hashlib
import operator
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from lfstereo.arrays import UInt16
from lfstereo.container.capture import BARE_SUFFIX, SIDECAR_SUFFIXES, Capture, check_raw_size, unpack_capture
from lfstereo.container.factory_files import (
    FACTORY_LATTICES,
    HOT_PIXELS,
    MANIFEST,
    UNIT_INFO,
    FactoryLattice,
    parse_factory_lattices,
    parse_hot_pixels,
    parse_manifest,
    parse_serial,
)
from lfstereo.container.members import Member, finished_files, is_archive, list_members
from lfstereo.container.metadata import FrameMetadata, parse_metadata
from lfstereo.container.reader import parse_json
from lfstereo.container.serials import same_camera
from lfstereo.errors import AssetError, InputError
from lfstereo.lenslet.home import remembered

_CAMERA_NAME_PART = "MOD_"
"""Part of the file name that the cameras give their white images."""
_LAYOUT = 3
"""To be raised when the stored index changes its form."""
_FARTHEST_BYTE = 1 << 62


@dataclass(frozen=True, slots=True)
class WhiteImage:
    """One white image, not read yet."""

    raw: Member
    text: Member
    serial: str
    """Of its camera: ``unit_info.json`` goes before the image's own text file."""
    zoom_step: int
    focus_step: int
    width: int
    height: int
    references: tuple[str, ...] = ()
    """Names by which pictures refer to it (`FrameMetadata.geometry_ref`)."""
    hot_pixels: Member | None = None
    """The camera's list of bad pixels."""
    factory: Member | None = None
    """The camera's table of factory lattices."""
    unit_info: Member | None = None
    """The file that states the camera's serial number."""
    manifest: Member | None = None
    """The file that gives the references."""

    def read(self) -> Capture:
        """Read the frame.

        Raises
        ------
        ContainerError, MetadataError
            If it or its text file is damaged.
        """
        metadata = dataclasses.replace(_metadata(self.text), serial=self.serial)
        check_raw_size(self.raw.length, metadata, self.raw.where)
        return unpack_capture(self.raw.read(), metadata, self.raw.where)

    def bad_pixels(self) -> UInt16 | None:
        """Return ``(N, 2)`` (x, y) pixels that the factory found bad; None where it left no list.

        Raises
        ------
        ContainerError
            If the list is damaged.
        """
        member = self.hot_pixels
        return None if member is None else parse_hot_pixels(member.read(), member.where)

    def factory_lattices(self) -> tuple[FactoryLattice, ...]:
        """Return the factory's lattices of its camera; none where it left no table.

        Raises
        ------
        ContainerError, MetadataError
            If the table is damaged.
        """
        member = self.factory
        return () if member is None else parse_factory_lattices(member.read(), member.where)


@dataclass(frozen=True, slots=True)
class WhiteLibrary:
    """The white images of one place."""

    place: Path
    whites: tuple[WhiteImage, ...]
    problems: tuple[str, ...]
    """What could not be read, one line each."""

    def of_camera(self, metadata: FrameMetadata) -> tuple[WhiteImage, ...]:
        """Return the white images of a picture's camera, the nearest in zoom, then in focus, first.

        One that the picture itself names goes before all others. A picture without serial number gets those of every
        camera of its size.
        """
        size = metadata.width, metadata.height
        fitting = [
            white
            for white in self.whites
            if (white.width, white.height) == size
            and (not metadata.serial or (white.serial and same_camera(white.serial, metadata.serial)))
        ]

        def distance(white: WhiteImage) -> tuple[bool, int, int, str]:
            zoom = abs(white.zoom_step - metadata.lens.zoom_step)
            focus = abs(white.focus_step - metadata.lens.focus_step)
            return metadata.geometry_ref not in white.references, zoom, focus, white.raw.where

        return tuple(sorted(fitting, key=distance))


def open_library(place: Path) -> WhiteLibrary:
    """Find the white images of a folder, of the archives in it, or of one archive.

    What was found is kept in the user's cache folder and looked at again only after a file has changed.

    Parameters
    ----------
    place
        Folder with white images (``MOD_*.RAW`` with ``.TXT`` beside, in any sub-folder), ``.tar`` archives or backup
        volumes (``data.C.0``, …), or one such archive.

    Raises
    ------
    AssetError
        If there is no such folder or archive.
    ContainerError
        If an archive is damaged.
    """
    if not place.is_dir() and not (place.is_file() and is_archive(place)):
        raise AssetError(f"{place}: found no such folder, expected the camera's white images; check the path")
    files = finished_files(place) if place.is_dir() else [place]
    state = [(str(path.resolve()), path.stat().st_size, path.stat().st_mtime_ns) for path in files]
    # Whole paths, as the index is read again from other working folders.
    whole = place.resolve()
    name = hashlib.sha256(repr((_LAYOUT, str(whole), state)).encode()).hexdigest()
    return remembered(
        f"index-{name[:32]}", lambda: to_json(_index(whole)), lambda stored: library_from_json(stored, place)
    )


def _index(place: Path) -> WhiteLibrary:
    members = {member.name: member for member in list_members(place)}
    problems: list[str] = []
    serials = _by_folder(members, (UNIT_INFO,))
    hot, factory = _by_folder(members, (HOT_PIXELS,)), _by_folder(members, FACTORY_LATTICES)
    manifests = _by_folder(members, (MANIFEST,))
    whites = []
    for name, raw in members.items():
        path = PurePosixPath(name)
        if path.suffix.lower() != BARE_SUFFIX:
            continue
        try:
            text = next((members[n] for s in SIDECAR_SUFFIXES if (n := str(path.with_suffix(s))) in members), None)
            if text is None:
                raise AssetError(f"{raw.where}: found no metadata beside it, expected {path.stem}.TXT; copy it too")
            metadata = _metadata(text)
            is_white = metadata.is_white_image or _CAMERA_NAME_PART in path.name.upper()
            if metadata.is_dark_frame or not is_white:
                continue
            info, manifest = _nearest(serials, path), _nearest(manifests, path)
            named = parse_manifest(manifest.read(), manifest.where) if manifest else {}
            white = WhiteImage(
                raw=raw,
                text=text,
                serial=parse_serial(info.read(), info.where) if info else metadata.serial,
                zoom_step=metadata.lens.zoom_step,
                focus_step=metadata.lens.focus_step,
                width=metadata.width,
                height=metadata.height,
                references=tuple(sorted(r for r, stem in named.items() if stem.upper() == path.stem.upper())),
                hot_pixels=_nearest(hot, path),
                factory=_nearest(factory, path),
                unit_info=info,
                manifest=manifest,
            )
        except InputError as error:
            problems.append(str(error))
        else:
            whites.append(white)
    return WhiteLibrary(place, tuple(whites), tuple(problems))


def _metadata(text: Member) -> FrameMetadata:
    return parse_metadata(parse_json(text.read(), text.where), None, text.where)


def _by_folder(members: dict[str, Member], names: Iterable[str]) -> dict[str, Member]:
    """Return the members that end with one of some names, by the folder that they lie in."""
    endings = tuple(names)
    return {str(PurePosixPath(n).parent): m for n, m in members.items() if n.lower().endswith(endings)}


def _nearest(by_folder: dict[str, Member], path: PurePosixPath) -> Member | None:
    """Return the member that lies beside a file, or in the nearest folder above it."""
    return next((by_folder[str(folder)] for folder in path.parents if str(folder) in by_folder), None)


def to_json(library: WhiteLibrary) -> dict[str, Any]:
    """Return a library as JSON can hold it."""

    def plain(value: object) -> object:
        return str(value) if isinstance(value, Path) else value

    def factory(pairs: list[tuple[str, object]]) -> dict[str, object]:
        return {name: plain(value) for name, value in pairs}

    return {
        "whites": [dataclasses.asdict(white, dict_factory=factory) for white in library.whites],
        "problems": list(library.problems),
    }


def library_from_json(stored: Any, place: Path) -> WhiteLibrary:
    """Return the library that `to_json` stored.

    Raises
    ------
    KeyError, TypeError, ValueError
        If a part of it is missing or cannot be.
    """
    problems = tuple(_text(problem) for problem in stored["problems"])
    return WhiteLibrary(place, tuple(_white_from_json(white) for white in stored["whites"]), problems)


def _white_from_json(white: Any) -> WhiteImage:
    def optional(name: str) -> Member | None:
        return None if white[name] is None else _member_from_json(white[name])

    return WhiteImage(
        raw=_member_from_json(white["raw"]),
        text=_member_from_json(white["text"]),
        serial=_text(white["serial"]),
        zoom_step=operator.index(white["zoom_step"]),
        focus_step=operator.index(white["focus_step"]),
        width=operator.index(white["width"]),
        height=operator.index(white["height"]),
        references=tuple(_text(name) for name in white["references"]),
        hot_pixels=optional("hot_pixels"),
        factory=optional("factory"),
        unit_info=optional("unit_info"),
        manifest=optional("manifest"),
    )


def _member_from_json(member: Any) -> Member:
    place = operator.index(member["offset"]), operator.index(member["length"])
    if min(place) < 0 or max(place) > _FARTHEST_BYTE:
        raise ValueError(f"found a file at byte {place[0]} of {place[1]} bytes")
    return Member(_text(member["name"]), Path(_text(member["file"])), *place, _text(member["sha1"]))


def _text(value: object) -> str:
    if not isinstance(value, str) or "\0" in value:
        raise TypeError(f"found {value!r}, expected a text")
    return value
