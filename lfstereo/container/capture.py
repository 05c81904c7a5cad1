"""A raw frame with its metadata: what every decode starts from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from lfstereo.arrays import Mosaic
from lfstereo.container.contents import frame_section
from lfstereo.container.fields import Json
from lfstereo.container.format import Container
from lfstereo.container.metadata import FrameMetadata, frame_entries, parse_metadata
from lfstereo.container.packing import check_packed_size, unpack
from lfstereo.container.reader import LARGEST_JSON_BYTES, parse_json, read_container, read_json
from lfstereo.errors import ContainerError

CONTAINER_SUFFIXES = (".lfr", ".lfp")
BARE_SUFFIX = ".raw"
DNG_SUFFIX = ".dng"
SIDECAR_SUFFIXES = (".TXT", ".txt", ".json", ".JSON")
IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".tif", ".tiff")


@dataclass(frozen=True, slots=True)
class Capture:
    """One exposure of a light-field camera."""

    mosaic: Mosaic
    """``(height, width)`` uint16 Bayer mosaic in digital numbers."""
    metadata: FrameMetadata
    source: str
    """File it came from, for messages."""


def read_capture(path: Path) -> Capture:
    """Read the raw frame and the metadata of a capture.

    Parameters
    ----------
    path
        ``.LFR`` or ``.LFP`` container of either camera, a bare ``.RAW`` with its ``.TXT`` or ``.json`` of the same
        name beside it, or a ``.DNG`` that lfstereo wrote; upper or lower case.

    Raises
    ------
    ContainerError
        If the file is damaged, cut off, of another kind, or a processed picture without a raw frame.
    MetadataError
        If the metadata lack a field or hold a value that cannot be.
    """
    suffix = path.suffix.lower()
    if suffix == BARE_SUFFIX:
        return _read_bare(path)
    if suffix == DNG_SUFFIX:
        from lfstereo.container.dng import read_dng

        return read_dng(path)
    if suffix in IMAGE_SUFFIXES:
        raise ContainerError(
            f"{path}: found an image file, expected .LFR, .LFP or .RAW; if it is a mosaic, name its camera "
            "(--camera lytro-f01 or --camera lytro-illum)"
        )
    if suffix not in CONTAINER_SUFFIXES:
        raise ContainerError(
            f"{path}: found the suffix '{path.suffix}', expected .LFR, .LFP or .RAW; give a raw capture"
        )
    container = read_container(path)
    section = frame_section(container, "imageRef")
    metadata = read_metadata(container)
    check_raw_size(section.length, metadata, str(path))
    return unpack_capture(container.read(section), metadata, str(path))


def check_raw_size(found: int, metadata: FrameMetadata, where: str) -> None:
    """Refuse a number of bytes that is not what the frame takes by its metadata.

    Raises
    ------
    ContainerError
        If the number differs, or the packing is unknown.
    """
    m = metadata
    check_packed_size(found, m.width, m.height, m.bits_per_pixel, m.endianness, where)


def read_metadata(container: Container) -> FrameMetadata:
    """Read the metadata of a container's frame, from its sections or from the table of contents itself.

    Raises
    ------
    ContainerError
        If the section that holds them is missing or damaged.
    MetadataError
        If the metadata lack a field or hold a value that cannot be.
    """
    entries = frame_entries(container.toc)
    entry = entries[0] if entries else {}
    frame = entry.get("frame")
    inline: Json = frame if isinstance(frame, dict) else {}
    if isinstance(inline.get("metadata"), dict):
        public, private = inline["metadata"], inline.get("privateMetadata")
    else:
        public = read_json(container, frame_section(container, "metadataRef"))
        named = "privateMetadataRef" in inline
        private = read_json(container, frame_section(container, "privateMetadataRef")) if named else None
    public = public | {"parameters": entry.get("parameters", {})}
    metadata = parse_metadata(public, private if isinstance(private, dict) else None, str(container.path))
    geometry = inline.get("geometryCorrectionRef")
    return replace(metadata, geometry_ref=geometry.lower()) if isinstance(geometry, str) else metadata


def read_sidecar(path: Path) -> FrameMetadata:
    """Read the metadata that lie beside a bare raw frame.

    Raises
    ------
    ContainerError
        If there is no such file, or it is not JSON.
    MetadataError
        If the metadata lack a field or hold a value that cannot be.
    """
    beside = [path.with_suffix(suffix) for suffix in SIDECAR_SUFFIXES]
    sidecar = next((candidate for candidate in beside if candidate.is_file()), None)
    if sidecar is None:
        raise ContainerError(
            f"{path}: found no metadata beside it, expected {beside[0].name} or {path.stem}.json; copy that file too"
        )
    try:
        if sidecar.stat().st_size > LARGEST_JSON_BYTES:
            raise ContainerError(
                f"{sidecar}: found {sidecar.stat().st_size} bytes, expected metadata of at most {LARGEST_JSON_BYTES}; "
                "give the file that the camera wrote"
            )
        data = sidecar.read_bytes()
    except OSError as error:
        raise ContainerError(f"{sidecar}: cannot be read ({error.strerror}); check its permissions") from error
    return parse_metadata(parse_json(data, str(sidecar)), None, str(sidecar))


def _read_bare(path: Path) -> Capture:
    try:
        size = path.stat().st_size
        metadata = read_sidecar(path)
        check_raw_size(size, metadata, str(path))
        data = path.read_bytes()
    except OSError as error:
        raise ContainerError(f"{path}: cannot be read ({error.strerror}); give the path of a RAW file") from error
    return unpack_capture(data, metadata, str(path))


def unpack_capture(data: bytes, metadata: FrameMetadata, source: str) -> Capture:
    """Unpack the bytes of a raw frame.

    Raises
    ------
    ContainerError
        If there are more or fewer than the frame takes by its metadata.
    """
    m = metadata
    mosaic = unpack(data, m.width, m.height, m.bits_per_pixel, m.endianness, source)
    return Capture(mosaic=mosaic, metadata=metadata, source=source)
