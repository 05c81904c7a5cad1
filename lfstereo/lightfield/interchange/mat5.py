"""One array of numbers out of a MAT-file of version 5, 6 or 7, read with every length checked.

SciPy's reader is not used: some damaged files end the whole process in it.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from lfstereo.container.expansion import ALWAYS_ALLOWED_BYTES, LARGEST_RATIO, check_expansion

_HEAD_BYTES = 128
_MATRIX, _COMPRESSED = 14, 15
_STORED = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Type of an element -> how its numbers are stored."""
_CLASSES = {6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8"}
"""Class of an array -> its numbers, which may be stored in fewer bytes."""
_MOST_AXES = 32


def read_array(path: Path, name: str) -> npt.NDArray[Any] | None:
    """Return an array of real numbers by its name; None where the file has none.

    References
    ----------
    MathWorks, "MAT-File Format" (2023), "Level 5 MAT-file format": 128 bytes of head, then elements of type, length
    and data; type 15 is compressed by zlib, type 14 an array of flags, dimensions, name and numbers.

    Raises
    ------
    ContainerError
        If a compressed part would be larger than `check_expansion` allows.
    ValueError
        If the file is none or damaged; with the reason.
    OSError
        If it cannot be read.
    """
    data = path.read_bytes()
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is None:
        raise ValueError("no head of a MAT-file of version 5")
    for kind, content in _elements(data[_HEAD_BYTES:], order):
        inner = next(_elements(_inflated(content, path), order)) if kind == _COMPRESSED else (kind, content)
        if inner[0] == _MATRIX and (found := _array(inner[1], order, name)) is not None:
            return found
    return None


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Yield type and data of elements that follow each other, padded to 8 bytes."""
    at = 0
    while at + 8 <= len(data):
        kind, length = struct.unpack_from(f"{order}II", data, at)
        start = at + 8
        if kind >> 16:  # up to four bytes stand in the place of the length's upper half
            kind, length, start = kind & 0xFFFF, kind >> 16, at + 4
        if length > len(data) - start or (start == at + 4 and length > 4):
            raise ValueError(f"an element of {length} bytes where {len(data) - start} are left")
        yield kind, data[start : start + length]
        at = at + 8 if start == at + 4 else start + length + (0 if kind == _COMPRESSED else -length % 8)
    if at < len(data):
        raise ValueError("cut off in the head of an element")


def _inflated(content: bytes, path: Path) -> bytes:
    allowed = max(ALWAYS_ALLOWED_BYTES, LARGEST_RATIO * len(content))
    decompressor = zlib.decompressobj()
    try:
        found = decompressor.decompress(content, allowed + 1)
    except zlib.error as error:
        raise ValueError(f"damaged compression: {error}") from error
    check_expansion(len(content), len(found), str(path))
    if not decompressor.eof:
        raise ValueError("cut off in a compressed part")
    return found


def _array(data: bytes, order: str, name: str) -> npt.NDArray[Any] | None:
    """Return the numbers of an array element if it has that name."""
    parts = _elements(data, order)
    (_, flags), (_, sizes), (_, named) = (next(parts, (0, b"")) for _ in range(3))
    if named != name.encode("ascii"):
        return None
    if len(flags) != 8 or len(sizes) % 4 or not 2 <= len(sizes) // 4 <= _MOST_AXES:
        raise ValueError(f"{name} without flags or dimensions")
    word = struct.unpack(f"{order}I", flags[:4])[0]
    shape = struct.unpack(f"{order}{len(sizes) // 4}i", sizes)
    kind, numbers = next(parts, (0, b""))
    if word & 0xFF not in _CLASSES or word & 0x0800 or kind not in _STORED:
        raise ValueError(f"{name} is no array of real numbers")
    stored = np.dtype(order + _STORED[kind])
    if min(shape) < 0 or math.prod(shape) * stored.itemsize != len(numbers):
        raise ValueError(f"{name} of size {' x '.join(map(str, shape))} holds {len(numbers)} bytes")
    wanted = np.dtype(_CLASSES[word & 0xFF])
    return np.frombuffer(numbers, stored).astype(wanted).reshape(shape, order="F")
