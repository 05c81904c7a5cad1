"""What a file of a light-field camera holds, in words and numbers, damaged sections included."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from lfstereo.container.capture import BARE_SUFFIX, check_raw_size, read_metadata, read_sidecar
from lfstereo.container.contents import (
    Reference,
    by_section,
    find_frame_section,
    frame_section,
    processed_picture,
    references,
    section_text,
)
from lfstereo.container.format import Container, Section
from lfstereo.container.metadata import FrameMetadata
from lfstereo.container.reader import read_container
from lfstereo.errors import ContainerError


@dataclass(frozen=True, slots=True)
class SectionReport:
    """One row of the table of sections."""

    kind: str
    """``"toc"`` or ``"content"``."""
    offset: int
    """Byte of the file at which the section's head starts."""
    length: int
    """Bytes of data."""
    sha1: str
    """40 hexadecimal digits as the section's head states them."""
    intact: bool
    """Whether the data have that SHA-1."""
    what: str


@dataclass(frozen=True, slots=True)
class Description:
    """What a file holds."""

    path: str
    size: int
    """Bytes of the file."""
    what: str
    """One line, for people."""
    has_raw: bool
    """Whether the file holds a raw lenslet image that can be decoded."""
    metadata: FrameMetadata | None
    sections: tuple[SectionReport, ...]
    """Empty for a bare raw frame."""
    missing: tuple[str, ...]
    """References of the table of contents, such as ``frames[0].frame.imageRef``, whose sections are not there."""


def describe(path: Path) -> Description:
    """Look at a container or a bare raw frame and tell what it is; every section's SHA-1 is checked.

    A damaged content section is reported, not refused, so that the rest of the file can still be looked at.

    Raises
    ------
    ContainerError
        If the file is no Lytro file, is cut off, or its table of contents is damaged.
    MetadataError
        If the metadata lack a field or hold a value that cannot be.
    """
    if path.suffix.lower() == BARE_SUFFIX:
        return _describe_bare(path)
    container = read_container(path)
    known = references(container.toc)
    named = by_section(container, known)
    sections = tuple(_report(container, section, named.get(section)) for section in container.sections)
    processed = processed_picture(container)
    raw = find_frame_section(container, "imageRef")
    if raw is None and not processed:
        frame_section(container, "imageRef")  # says what is missing
    try:
        metadata = read_metadata(container)
    except ContainerError:
        if raw is not None and all(section.intact for section in sections):
            raise
        metadata = None
    if raw is not None and metadata is not None:
        check_raw_size(raw.length, metadata, str(path))
    return Description(
        path=str(path),
        size=container.size,
        what=processed if raw is None else _capture_text(metadata),
        has_raw=raw is not None,
        metadata=metadata,
        sections=sections,
        missing=tuple(r.path for r in known if container.find(r.name) is None),
    )


def _describe_bare(path: Path) -> Description:
    try:
        size = path.stat().st_size
    except OSError as error:
        raise ContainerError(f"{path}: cannot be read ({error.strerror}); give the path of a RAW file") from error
    metadata = read_sidecar(path)
    check_raw_size(size, metadata, str(path))
    what = f"{_capture_text(metadata)}, bare frame with its metadata beside it"
    return Description(path=str(path), size=size, what=what, has_raw=True, metadata=metadata, sections=(), missing=())


def _capture_text(metadata: FrameMetadata | None) -> str:
    if metadata is None:
        return "a raw capture with damaged metadata"
    kind = "a white image" if metadata.is_white_image else "a dark frame" if metadata.is_dark_frame else "a raw capture"
    return f"{kind} of a Lytro {metadata.model}"


def _report(container: Container, section: Section, reference: Reference | None) -> SectionReport:
    data = container.read_unverified(section)
    return SectionReport(
        kind=section.kind,
        offset=section.offset,
        length=section.length,
        sha1=section.sha1,
        intact=hashlib.sha1(data, usedforsecurity=False).hexdigest() == section.sha1,
        what=section_text(container, section, data, reference),
    )
