"""Where the files of a tar archive lie in it; the names are bounded, nothing else is read or unpacked.

Python's own module is not used: it reserves memory for whatever size a damaged head states, and some of its versions
search without end (CVE-2024-6232, CVE-2025-8194).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from lfstereo.errors import ContainerError

_BLOCK = 512
_REGULAR = (b"0", b"\0", b"7")
_LONG_NAME, _EXTENDED, _GLOBAL = b"L", b"x", b"g"
_SPARSE = b"S"
_LARGEST_EXTENSION = 1 << 16
"""Bytes of a head that only extends the next one."""
_MOST_ENTRIES = 10_000
_COPY_AGAIN = "copy the archive again"


@dataclass(frozen=True, slots=True)
class TarEntry:
    """One regular file."""

    name: str
    """As the archive writes it."""
    offset: int
    """Byte of the archive at which its data start."""
    length: int


@dataclass(frozen=True, slots=True)
class _Extension:
    """What the heads before an entry say of it."""

    name: str | None = None
    length: int | None = None


def tar_entries(path: Path) -> Iterator[TarEntry]:
    """Yield the regular files of an uncompressed tar archive, in its order.

    Long names of GNU tar and names and sizes of POSIX's extended heads count; folders, links and devices are passed
    over. An archive may end without its blocks of zeros.

    References
    ----------
    IEEE Std 1003.1-2017, ``pax``: ustar and extended heads. GNU tar manual, "Basic Tar Format": long names, sizes in
    base 256.

    Raises
    ------
    ContainerError
        If the file is no such archive, is cut off or damaged, or stores a file with holes.
    OSError
        If it cannot be read.
    """
    with path.open("rb") as file:
        size = file.seek(0, 2)
        offset, extension = 0, _Extension()
        for _ in range(_MOST_ENTRIES):
            file.seek(offset)
            head = file.read(_BLOCK)
            if not head.strip(b"\0") and offset:
                return
            where = f"{path}: byte {offset}"
            kind = _checked_kind(head, where)
            length = _number(head[124:136], where) if extension.length is None else extension.length
            data = offset + _BLOCK
            if length > size - data:
                raise ContainerError(
                    f"{where}: found {size - data} bytes up to the end, expected {length}; {_COPY_AGAIN}"
                )
            if kind in (_LONG_NAME, _EXTENDED, _GLOBAL):
                extension = _extended(kind, _text(file, length, where), extension, where)
            else:
                if kind in _REGULAR:
                    yield TarEntry(extension.name or _name(head), data, length)
                extension = _Extension()
            offset = data + length + -length % _BLOCK
    raise ContainerError(f"{path}: found more than {_MOST_ENTRIES} entries, expected white images; give their archive")


def _checked_kind(head: bytes, where: str) -> bytes:
    if len(head) < _BLOCK:
        raise ContainerError(f"{where}: found {len(head)} bytes, expected a tar head of {_BLOCK}; {_COPY_AGAIN}")
    found = _number(head[148:156], where)
    summed = sum(head[:148]) + sum(head[156:]) + 8 * ord(" ")
    if found != summed:
        raise ContainerError(f"{where}: found checksum {found}, expected {summed}: no tar head; {_COPY_AGAIN}")
    kind = head[156:157]
    if kind == _SPARSE:
        raise ContainerError(f"{where}: found a file stored with holes, expected whole files; pack them without -S")
    return kind


def _number(field: bytes, where: str) -> int:
    """Return a number in octal digits, or in base 256 where the first bit is set."""
    if field[0] & 0x80:
        return int.from_bytes(bytes([field[0] & 0x7F]) + field[1:], "big")
    digits = field.strip(b" \0")
    if not all(c in b"01234567" for c in digits):
        raise ContainerError(f"{where}: found {digits[:12]!r}, expected an octal number; {_COPY_AGAIN}")
    return int(digits or b"0", 8)


def _name(head: bytes) -> str:
    name, prefix = (part.partition(b"\0")[0] for part in (head[:100], head[345:500]))
    is_ustar = head[257:263] == b"ustar\0"
    return (prefix + b"/" + name if prefix and is_ustar else name).decode("utf-8", "replace")


def _text(file: BinaryIO, length: int, where: str) -> bytes:
    if length > _LARGEST_EXTENSION:
        raise ContainerError(
            f"{where}: found a name or extended head of {length} bytes, expected at most {_LARGEST_EXTENSION}; "
            f"{_COPY_AGAIN}"
        )
    return file.read(length)


def _extended(kind: bytes, text: bytes, before: _Extension, where: str) -> _Extension:
    if kind == _LONG_NAME:
        return replace(before, name=text.partition(b"\0")[0].decode("utf-8", "replace"))
    found = before
    while text:
        digits, _, rest = text.partition(b" ")
        length = int(digits) if digits.isdigit() and len(digits) <= 6 else 0
        record = rest[: length - len(digits) - 1]
        key, equal, value = record.removesuffix(b"\n").partition(b"=")
        if not 0 < length <= len(text) or not record.endswith(b"\n") or not equal:
            raise ContainerError(f"{where}: found {text[:12]!r}, expected 'length key=value'; {_COPY_AGAIN}")
        if kind == _EXTENDED and key == b"path":
            found = replace(found, name=value.decode("utf-8", "replace"))
        elif kind == _EXTENDED and key == b"size":
            if not value.isdigit() or len(value) > 15:
                raise ContainerError(f"{where}: found size {value[:20]!r}, expected a number; {_COPY_AGAIN}")
            found = replace(found, length=int(value))
        elif key.startswith(b"GNU.sparse"):
            raise ContainerError(f"{where}: found a file stored with holes, expected whole files; pack it without -S")
        text = text[length:]
    return found
