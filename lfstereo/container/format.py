"""The byte layout of Lytro's LFP/LFR containers, and the value a read container is.

A file is a 16-byte head followed by sections. Every section is: 8-byte magic, 4-byte version (zero), length of
the data as a big-endian 32-bit number, 45 bytes ``sha1-`` and 40 hexadecimal digits, 35 zero bytes, the data, and
zero bytes up to a multiple of 16. A section of length zero ends after its length field.

References
----------
N. Patel, "lfptools" (2012), README, "lfp file format". Checked byte by byte against files of both cameras.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, TypeAlias

from lfstereo.container.fields import Json
from lfstereo.errors import ContainerError

Payload: TypeAlias = bytes | memoryview
"""Bytes of one section."""
SectionKind: TypeAlias = Literal["toc", "content"]

FILE_HEAD = b"\x89LFP\r\n\x1a\n\x00\x00\x00\x01\x00\x00\x00\x00"
"""Magic, version 1 and the length zero of the file itself."""
MAGICS: dict[bytes, SectionKind] = {b"\x89LFM\r\n\x1a\n": "toc", b"\x89LFC\r\n\x1a\n": "content"}
SECTION_VERSION = b"\x00\x00\x00\x00"
NAME_LENGTH = 45
NAME_PADDING = bytes(35)
EMPTY_SHA1 = hashlib.sha1(b"", usedforsecurity=False).hexdigest()
"""The name of a section of length zero, which does not state it."""
HEAD_LENGTH = 16
"""Bytes of magic, version and length."""
DATA_START = HEAD_LENGTH + NAME_LENGTH + len(NAME_PADDING)
"""Bytes from the start of a section to its data: 96."""
ALIGNMENT = 16


@dataclass(frozen=True, slots=True)
class Section:
    """Where one section of a container lies; its data stay in the file until they are asked for."""

    kind: SectionKind
    sha1: str
    """40 hexadecimal digits in lower case, as the section's head states them."""
    offset: int
    """Byte of the file at which the section's head starts."""
    length: int
    """Bytes of data."""

    @property
    def name(self) -> str:
        """The name by which the table of contents refers to the section."""
        return f"sha1-{self.sha1}"

    @property
    def data_offset(self) -> int:
        """Byte of the file at which the data start."""
        return self.offset + (DATA_START if self.length else HEAD_LENGTH)


@dataclass(frozen=True, slots=True)
class Container:
    """A Lytro file: its table of contents and the sections in the order of the file."""

    path: Path
    toc: Json
    """The parsed table of contents."""
    sections: tuple[Section, ...]
    size: int
    """Bytes of the whole file."""
    _by_sha1: dict[str, Section] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        first = {section.sha1: section for section in reversed(self.sections)}
        object.__setattr__(self, "_by_sha1", first)

    def find(self, name: str) -> Section | None:
        """Return the section with a name such as ``sha1-0360f8…``, or None where the file has none."""
        return self._by_sha1.get(name.lower().removeprefix("sha1-"))

    def read(self, section: Section) -> bytes:
        """Read the data of a section and verify their SHA-1.

        Raises
        ------
        ContainerError
            If the data do not have the SHA-1 that the section's head states, or the file has become shorter.
        """
        data = self.read_unverified(section)
        found = hashlib.sha1(data, usedforsecurity=False).hexdigest()
        if found != section.sha1:
            raise ContainerError(
                f"{self.path}: byte {section.data_offset}: found {section.length} bytes with SHA-1 {found}, expected "
                f"{section.sha1}; the file is damaged, copy it again from the camera"
            )
        return data

    def read_unverified(self, section: Section) -> bytes:
        """Read the data of a section as they are, for looking at a damaged file.

        Raises
        ------
        ContainerError
            If the file cannot be read, or has become shorter since it was opened.
        """
        try:
            with self.path.open("rb") as file:
                file.seek(section.data_offset)
                data = file.read(section.length)
        except OSError as error:
            raise ContainerError(f"{self.path}: cannot be read ({error.strerror}); check the path") from error
        if len(data) != section.length:
            raise ContainerError(
                f"{self.path}: byte {section.data_offset}: found {len(data)} bytes, expected {section.length}; "
                "the file was changed while it was read, run again"
            )
        return data


def section_bytes(kind: SectionKind, data: Payload) -> Iterator[Payload]:
    """Yield the pieces of one section: head, data (not copied), padding to a multiple of 16.

    Examples
    --------
    >>> pieces = list(section_bytes("content", b"abc"))
    >>> [len(piece) for piece in pieces], pieces[0][16:30]
    ([96, 3, 13], b'sha1-a9993e364')
    """
    magic = next(m for m, k in MAGICS.items() if k == kind)
    length = len(data)
    head = magic + SECTION_VERSION + struct.pack(">I", length)
    if not length:
        yield head
        return
    sha1 = hashlib.sha1(data, usedforsecurity=False).hexdigest()
    yield head + f"sha1-{sha1}".encode("ascii") + NAME_PADDING
    yield data
    yield bytes(-(DATA_START + length) % ALIGNMENT)
