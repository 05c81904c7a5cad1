"""The ICC profile of sRGB, for pictures whose format has no other way to name their colours."""

from __future__ import annotations

import struct

_WHITE_D50 = (0.9642, 1.0, 0.8249)
_PRIMARIES = {
    b"rXYZ": (0.4360747, 0.2225045, 0.0139322),
    b"gXYZ": (0.3850649, 0.7168786, 0.0971045),
    b"bXYZ": (0.1430804, 0.0606169, 0.7141733),
}
_D65_TO_D50 = (1.0478112, 0.0228866, -0.0501270, 0.0295424, 0.9904844, -0.0170491, -0.0092345, 0.0150436, 0.7521316)
_CURVE = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)


def srgb_profile() -> bytes:
    """Return an ICC profile, version 4.3, of sRGB.

    References
    ----------
    ISO 15076-1:2010 (ICC.1:2010), sections 7.2 (header), 10.15 (parametric curve, type 3).
    IEC 61966-2-1:1999, primaries, white point and curve; adapted to D50 by Bradford's matrix.

    Examples
    --------
    >>> profile = srgb_profile()
    >>> profile[36:40], int.from_bytes(profile[:4], "big") == len(profile)
    (b'acsp', True)
    """
    curve = b"para" + struct.pack(">IHH", 0, 3, 0) + _fixed(*_CURVE)
    tags = {
        b"desc": _text("sRGB"),
        b"cprt": _text("Public domain"),
        b"wtpt": b"XYZ " + bytes(4) + _fixed(*_WHITE_D50),
        b"chad": b"sf32" + bytes(4) + _fixed(*_D65_TO_D50),
        **{name: b"XYZ " + bytes(4) + _fixed(*xyz) for name, xyz in _PRIMARIES.items()},
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
    return (head + made + b"acsp" + bytes(28) + _fixed(*_WHITE_D50)).ljust(128, b"\0")


def _fixed(*values: float) -> bytes:
    """Return signed 15.16 fixed-point numbers."""
    return struct.pack(f">{len(values)}i", *(round(value * 65536) for value in values))


def _text(text: str) -> bytes:
    letters = text.encode("utf-16-be")
    return b"mluc" + struct.pack(">3I4sII", 0, 1, 12, b"enUS", len(letters), 28) + letters
