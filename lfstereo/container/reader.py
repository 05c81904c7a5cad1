"""Read Lytro containers: sections in any order and number, every byte accounted for."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import BinaryIO

from lfstereo.container.fields import Json
from lfstereo.container.format import (
    DATA_START,
    EMPTY_SHA1,
    FILE_HEAD,
    HEAD_LENGTH,
    MAGICS,
    NAME_LENGTH,
    NAME_PADDING,
    SECTION_VERSION,
    Container,
    Section,
)
from lfstereo.container.metadata import frame_entries
from lfstereo.errors import ContainerError

LARGEST_JSON_BYTES = 8 << 20
"""No camera writes more than some 100 kB; refused above, so that a damaged file cannot fill the memory."""
DEEPEST_JSON = 64
"""The cameras' own metadata are nested 8 deep."""
_MOST_SECTIONS = 10_000
"""A picture has up to 30, a camera's backup volume some hundred."""
_COPY_AGAIN = "the file is damaged, copy it again from the camera"
_CUT_OFF = "the file is cut off, copy it again from the camera"
_PADDING_BLOCK = 1 << 16
_HEX_DIGITS = frozenset(b"0123456789abcdef")


def read_container(path: Path) -> Container:
    """Read the table of contents and the places of all sections of an LFR or LFP file.

    The data of content sections are read, and their SHA-1 verified, when they are asked for (`Container.read`).
    Of several tables the first that lists frames or a picture is the table of contents.

    Parameters
    ----------
    path
        File of any Lytro camera or program.

    Raises
    ------
    ContainerError
        If the file cannot be read, is no Lytro container, is cut off or damaged, or has no table of contents.
    """
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            sections = _find_sections(path, file, size)
    except OSError as error:
        raise ContainerError(
            f"{path}: cannot be read ({error.strerror}); give the path of an LFR or LFP file"
        ) from error
    found = Container(path=path, toc={}, sections=sections, size=size)
    tables = [read_json(found, section) for section in sections if section.kind == "toc"]
    if not tables:
        raise ContainerError(
            f"{path}: byte {size}: the file ends here without a table of contents, expected a section LFM; {_CUT_OFF}"
        )
    toc = next((table for table in tables if "views" in table or frame_entries(table)), tables[0])
    return Container(path=path, toc=toc, sections=sections, size=size)


def read_json(container: Container, section: Section) -> Json:
    """Read, verify and parse a section that holds a JSON object, on one line or many.

    Raises
    ------
    ContainerError
        If the data do not have the stated SHA-1, or are not a JSON object.
    """
    where = f"{container.path}: byte {section.data_offset}"
    if section.length > LARGEST_JSON_BYTES:
        raise ContainerError(
            f"{where}: found {section.length} bytes of metadata, expected at most {LARGEST_JSON_BYTES}; {_COPY_AGAIN}"
        )
    return parse_json(container.read(section), where)


def parse_json(data: bytes, where: str) -> Json:
    """Parse a JSON object; zero bytes after its end, as in some cameras' text files, are passed over.

    Raises
    ------
    ContainerError
        If the bytes are not UTF-8, not JSON, nested deeper than any metadata, or JSON of another kind.
    """
    try:
        value = json.loads(data.rstrip(b"\0").decode("utf-8-sig"))
        shallow = _is_shallow(value)
    except RecursionError:
        shallow = False
    except ValueError as error:
        raise ContainerError(f"{where}: found no valid JSON ({error}), expected metadata; {_COPY_AGAIN}") from error
    if not shallow:
        raise ContainerError(f"{where}: found JSON nested too deeply, expected metadata; {_COPY_AGAIN}")
    if not isinstance(value, dict):
        raise ContainerError(f"{where}: found JSON of type {type(value).__name__}, expected an object; {_COPY_AGAIN}")
    return value


def _is_shallow(value: object) -> bool:
    """Return whether objects and lists are nested at most `DEEPEST_JSON` deep."""
    level = [value]
    for _ in range(DEEPEST_JSON + 1):
        inner = (item.values() if isinstance(item, dict) else item for item in level if isinstance(item, dict | list))
        level = [item for items in inner for item in items]
    return not level


def _find_sections(path: Path, file: BinaryIO, size: int) -> tuple[Section, ...]:
    file.seek(0)
    head = file.read(len(FILE_HEAD))
    if head != FILE_HEAD:
        raise ContainerError(
            f"{path}: byte 0: found {_shown(head)}, expected {_shown(FILE_HEAD)}; this is no Lytro container, "
            "give an LFR or LFP file"
        )
    sections: list[Section] = []
    offset = len(FILE_HEAD)
    while (offset := _skip_padding(file, offset)) < size:
        if len(sections) == _MOST_SECTIONS:
            raise ContainerError(
                f"{path}: byte {offset}: found more than {_MOST_SECTIONS} sections, expected a few dozen; {_COPY_AGAIN}"
            )
        section = _read_head(path, file, offset, size)
        sections.append(section)
        offset = section.data_offset + section.length
    return tuple(sections)


def _read_head(path: Path, file: BinaryIO, offset: int, size: int) -> Section:
    file.seek(offset)
    head = file.read(HEAD_LENGTH)
    if len(head) < HEAD_LENGTH:
        raise ContainerError(
            f"{path}: byte {offset}: found {len(head)} bytes up to the end of the file, expected a section's head of "
            f"{HEAD_LENGTH}; {_CUT_OFF}"
        )
    kind = MAGICS.get(head[:8])
    if kind is None or head[8:12] != SECTION_VERSION:
        expected = " or ".join(_shown(magic + SECTION_VERSION) for magic in MAGICS)
        raise ContainerError(
            f"{path}: byte {offset}: found {_shown(head[:12])}, expected the start of a section ({expected}); "
            f"{_COPY_AGAIN}"
        )
    length = struct.unpack(">I", head[12:])[0]
    if length == 0:
        return Section(kind=kind, sha1=EMPTY_SHA1, offset=offset, length=0)
    rest = size - offset - DATA_START
    if length > rest:
        raise ContainerError(
            f"{path}: byte {offset}: found {max(rest, 0)} bytes of data up to the end of the file at byte {size}, "
            f"expected {length}; {_CUT_OFF}"
        )
    name = file.read(NAME_LENGTH)
    if not name.startswith(b"sha1-") or not _HEX_DIGITS.issuperset(name[5:].lower()):
        raise ContainerError(
            f"{path}: byte {offset + HEAD_LENGTH}: found {_shown(name)}, expected 'sha1-' and 40 hexadecimal digits; "
            f"{_COPY_AGAIN}"
        )
    if (padding := file.read(len(NAME_PADDING))) != NAME_PADDING:
        raise ContainerError(
            f"{path}: byte {offset + HEAD_LENGTH + NAME_LENGTH}: found {_shown(padding)}, expected "
            f"{len(NAME_PADDING)} zero bytes; {_COPY_AGAIN}"
        )
    return Section(kind=kind, sha1=name[5:].decode("ascii").lower(), offset=offset, length=length)


def _skip_padding(file: BinaryIO, offset: int) -> int:
    """Return the place of the first byte from ``offset`` on that is not zero, or the end of the file."""
    file.seek(offset)
    while block := file.read(_PADDING_BLOCK):
        rest = block.lstrip(b"\0")
        if rest:
            return offset + len(block) - len(rest)
        offset += len(block)
    return offset


def _shown(data: bytes) -> str:
    """Return bytes for a message: as text where they are text, otherwise as hexadecimal numbers."""
    if not data:
        return "nothing"
    if data.isascii() and data.decode("ascii").isprintable():
        return repr(data.decode("ascii"))
    return data[:16].hex(" ") + (" ..." if len(data) > 16 else "")
