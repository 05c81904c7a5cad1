"""Whether two files are of one camera, told by its serial number or by a short mark that does not give it away."""

from __future__ import annotations

import hashlib

_SIGN = "#"
_DIGITS = 4


def camera_mark(serial: str) -> str:
    """Return what stands for a camera in files that are handed on: a mark of 16 bits; empty where it is unknown.

    Some hundred thousand of the possible serial numbers share each mark, so it does not tell which camera it is; two
    given cameras have the same one once in 65536 times. A mark is its own mark.

    Examples
    --------
    >>> camera_mark("B5143909630"), camera_mark(camera_mark("B5143909630")), camera_mark("")
    ('#1887', '#1887', '')
    """
    if not serial or is_mark(serial):
        return serial
    digest = hashlib.sha256(f"lfstereo camera {serial}".encode("utf-8", "replace")).hexdigest()
    return _SIGN + digest[:_DIGITS]


def is_mark(serial: str) -> bool:
    """Return whether a text is a mark and no serial number."""
    return serial.startswith(_SIGN)


def same_camera(one: str, other: str) -> bool:
    """Return whether two serial numbers or marks may be of one camera; an empty one may be of any.

    Examples
    --------
    >>> same_camera("B5143909630", "#1887"), same_camera("B5143909630", "B5143909631"), same_camera("", "B51")
    (True, False, True)
    """
    if not one or not other:
        return True
    return one == other if is_mark(one) == is_mark(other) else camera_mark(one) == camera_mark(other)
