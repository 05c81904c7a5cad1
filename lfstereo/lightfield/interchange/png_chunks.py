"""What OpenCV leaves out of a PNG: the chunks that name its colour space."""

from __future__ import annotations

import struct
import zlib

from lfstereo.develop.colour_spaces import NAMES
from lfstereo.develop.options import ColourSpace
from lfstereo.lightfield.interchange.icc import icc_profile

HEAD_BYTES = 33
"""Signature and IHDR chunk of a PNG; other chunks may follow."""
_PERCEPTUAL = bytes(1)


def colour_chunk(space: ColourSpace) -> bytes:
    """Return the chunk that names a colour space: sRGB has its own, others come with their ICC profile.

    References
    ----------
    W3C, "Portable Network Graphics specification", third edition (2023), sections 11.3.2.3 (iCCP), 11.3.2.5 (sRGB).
    """
    if space == "srgb":
        return chunk(b"sRGB", _PERCEPTUAL)
    return chunk(b"iCCP", NAMES[space].encode("latin-1") + bytes(2) + zlib.compress(icc_profile(space)))


def chunk(kind: bytes, content: bytes) -> bytes:
    """Return a chunk of a PNG: length, kind, content, checksum."""
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
