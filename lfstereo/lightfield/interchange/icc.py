"""ICC profiles, by which pictures name their colour space."""

from __future__ import annotations

import struct
from functools import cache

from lfstereo.develop.colour_spaces import CURVES, NAMES, PRIMARIES, WHITE_D50, d50_from, to_d50
from lfstereo.develop.options import ColourSpace


@cache
def icc_profile(space: ColourSpace) -> bytes:
    """Return an ICC profile, version 4.3, of a colour space.

    References
    ----------
    ISO 15076-1:2010 (ICC.1:2010), sections 7.2 (header), 10.15 (parametric curve, type 3), annex E (adaptation).

    Examples
    --------
    >>> profile = icc_profile("srgb")
    >>> profile[36:40], int.from_bytes(profile[:4], "big") == len(profile)
    (b'acsp', True)
    """
    matrix = to_d50(PRIMARIES[space])
    curve = b"para" + struct.pack(">IHH", 0, 3, 0) + _fixed(*CURVES[space])
    columns = {name: b"XYZ " + bytes(4) + _fixed(*matrix[:, k]) for k, name in enumerate((b"rXYZ", b"gXYZ", b"bXYZ"))}
    tags = {
        b"desc": _text(NAMES[space]),
        b"cprt": _text("Public domain"),
        b"wtpt": b"XYZ " + bytes(4) + _fixed(*WHITE_D50),
        b"chad": b"sf32" + bytes(4) + _fixed(*d50_from(PRIMARIES[space]).ravel()),
        **columns,
        b"rTRC": curve,
        b"gTRC": curve,
        b"bTRC": curve,
    }
    start = 128 + 4 + 12 * len(tags)
    table, content, places = struct.pack(">I", len(tags)), b"", dict[bytes, int]()
    for name, data in tags.items():
        if data not in places:
            places[data] = start + len(content)
            content += data + bytes(-len(data) % 4)
        table += struct.pack(">4sII", name, places[data], len(data))
    return _header(start + len(content)) + table + content


def _header(size: int) -> bytes:
    made = struct.pack(">6H", 2026, 1, 1, 0, 0, 0)
    head = struct.pack(">I4sI4s4s4s", size, bytes(4), 0x04300000, b"mntr", b"RGB ", b"XYZ ")
    return (head + made + b"acsp" + bytes(28) + _fixed(*WHITE_D50)).ljust(128, b"\0")


def _fixed(*values: float) -> bytes:
    """Return signed 15.16 fixed-point numbers."""
    return struct.pack(f">{len(values)}i", *(round(value * 65536) for value in values))


def _text(text: str) -> bytes:
    letters = text.encode("utf-16-be")
    return b"mluc" + struct.pack(">3I4sII", 0, 1, 12, b"enUS", len(letters), 28) + letters
