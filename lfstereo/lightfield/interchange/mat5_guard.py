"""MAT-files of version 5: how large they become, before anything is read for good."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from lfstereo.container.expansion import ALWAYS_ALLOWED_BYTES, LARGEST_RATIO, check_expansion

_HEAD_BYTES = 128
_COMPRESSED = 15
_BLOCK = 1 << 20


def check_mat5(path: Path) -> None:
    """Refuse a MAT-file whose compressed parts would fill the memory.

    References
    ----------
    MathWorks, "MAT-File Format" (2023), "Level 5 MAT-file format": 128 bytes of head, then data elements of type,
    length and data; type 15 is compressed by zlib.

    Raises
    ------
    ContainerError
        If they hold more than `check_expansion` allows.
    OSError
        If the file cannot be read.
    """
    size = path.stat().st_size
    allowed = max(ALWAYS_ALLOWED_BYTES, LARGEST_RATIO * size)
    expanded = 0
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
        order = ">" if head[126:128] == b"MI" else "<"
        while len(tag := file.read(8)) == 8:
            kind, length = struct.unpack(f"{order}II", tag)
            if kind != _COMPRESSED:
                file.seek(min(length, size), 1)
                continue
            decompressor, rest = zlib.decompressobj(), length
            while rest > 0 and expanded <= allowed and (block := file.read(min(rest, _BLOCK))):
                rest -= len(block)
                while block and expanded <= allowed:
                    expanded += len(decompressor.decompress(block, _BLOCK))
                    block = decompressor.unconsumed_tail
            check_expansion(size, expanded, str(path))
