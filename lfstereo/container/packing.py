"""Sensor pixels to packed bytes and back, exactly."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Mosaic, UInt8, check_shape
from lfstereo.errors import ContainerError

PACKINGS: dict[tuple[int, str], tuple[int, int]] = {
    (8, "little"): (1, 1),
    (8, "big"): (1, 1),
    (10, "little"): (5, 4),
    (12, "big"): (3, 2),
    (16, "little"): (2, 1),
    (16, "big"): (2, 1),
}
"""(bits per pixel, endianness) -> (bytes, pixels) of one group."""

_GROUPS_AT_ONCE = 1 << 16
"""So that a block of bytes and pixels stays in the processor's cache."""


def packed_size(width: int, height: int, bits: int, endianness: str, where: str) -> int:
    """Return the bytes that a packed frame takes.

    Raises
    ------
    ContainerError
        If the packing is unknown, or the frame does not end with a whole group of pixels.

    Examples
    --------
    >>> packed_size(7728, 5368, 10, "little", "IMG_0001.LFR")
    51854880
    """
    if (bits, endianness) not in PACKINGS:
        known = ", ".join(f"{b} bits {e}-endian" for b, e in PACKINGS)
        raise ContainerError(
            f"{where}: found pixels of {bits} bits {endianness}-endian, expected one of {known}; "
            "no other packing of a Lytro camera is known"
        )
    group_bytes, group_pixels = PACKINGS[bits, endianness]
    groups, rest = divmod(width * height, group_pixels)
    if rest:
        raise ContainerError(
            f"{where}: found {width} x {height} pixels of {bits} bits, expected a multiple of {group_pixels} pixels; "
            "correct the width and height"
        )
    return groups * group_bytes


def check_packed_size(found: int, width: int, height: int, bits: int, endianness: str, where: str) -> None:
    """Refuse a number of bytes that is not what a packed frame takes.

    Raises
    ------
    ContainerError
        If the number differs, or the packing is unknown.
    """
    expected = packed_size(width, height, bits, endianness, where)
    if found != expected:
        raise ContainerError(
            f"{where}: found a raw frame of {found} bytes, expected {expected} for {width} x {height} pixels of "
            f"{bits} bits; give the complete file with its own metadata"
        )


def unpack(data: bytes | memoryview, width: int, height: int, bits: int, endianness: str, where: str) -> Mosaic:
    """Unpack the bytes of a raw frame into its pixels.

    Parameters
    ----------
    data
        The packed frame, without any head.
    width, height
        Pixels of the frame.
    bits, endianness
        As in the metadata: 10 little-endian is the Illum, 12 big-endian the F01.
    where
        File name for messages.

    Returns
    -------
    Mosaic
        ``(height, width)`` uint16 in digital numbers.

    Raises
    ------
    ContainerError
        If the number of bytes does not fit the size of the frame, or the packing is unknown.

    References
    ----------
    D. G. Dansereau, "Light Field Toolbox" v0.5 (2019), LFUnpackRawBuffer: byte layouts of both cameras.

    Examples
    --------
    Four pixels of 10 bits: bytes 0-3 are the high 8 bits, byte 4 the low 2 bits with pixel 0 lowest.

    >>> unpack(bytes([255, 0, 128, 1, 0b11_10_00_01]), 4, 1, 10, "little", "example").tolist()
    [[1021, 0, 514, 7]]

    Two pixels of 12 bits in three bytes.

    >>> [hex(p) for p in unpack(bytes([0x12, 0x34, 0x56]), 2, 1, 12, "big", "example")[0]]
    ['0x123', '0x456']
    """
    raw = np.frombuffer(data, dtype=np.uint8)
    check_packed_size(raw.size, width, height, bits, endianness, where)
    if bits == 8:
        return raw.reshape(height, width).astype(np.uint16)
    if bits == 16:
        return raw.view(_DTYPE_16[endianness]).reshape(height, width).astype(np.uint16)
    group_bytes, group_pixels = PACKINGS[bits, endianness]
    groups, pixels = raw.reshape(-1, group_bytes), np.empty((raw.size // group_bytes, group_pixels), np.uint16)
    from lfstereo.container.unpack_kernels import unpack_10, unpack_12

    (unpack_10 if bits == 10 else unpack_12)(groups, pixels)
    return pixels.reshape(height, width)


def pack(mosaic: Mosaic, bits: int, endianness: str, where: str) -> UInt8:
    """Pack the pixels of a frame into bytes: the exact inverse of `unpack`.

    Parameters
    ----------
    mosaic
        ``(height, width)`` uint16 digital numbers below ``2 ** bits``.
    bits, endianness
        As for `unpack`.
    where
        File name for messages.

    Returns
    -------
    UInt8
        ``(bytes,)`` the packed frame.

    Raises
    ------
    ShapeError
        If the mosaic does not have two axes.
    ContainerError
        If a pixel needs more bits than there are, or the packing is unknown.

    Examples
    --------
    >>> pack(np.array([[1021, 0, 514, 7]], np.uint16), 10, "little", "example").tolist()
    [255, 0, 128, 1, 225]
    """
    check_shape("mosaic", mosaic, (None, None))
    height, width = mosaic.shape
    size = packed_size(width, height, bits, endianness, where)
    largest = int(mosaic.max(initial=0))
    if largest >= 1 << bits or not np.issubdtype(mosaic.dtype, np.unsignedinteger):
        raise ContainerError(
            f"{where}: found a mosaic of {mosaic.dtype} up to {largest}, expected uint16 digital numbers below "
            f"{1 << bits}; round and clip it first"
        )
    if bits == 8:
        return mosaic.astype(np.uint8).ravel()
    if bits == 16:
        return np.ascontiguousarray(mosaic, dtype=_DTYPE_16[endianness]).view(np.uint8).ravel()
    group_bytes, group_pixels = PACKINGS[bits, endianness]
    pixels = np.ascontiguousarray(mosaic, dtype=np.uint16).reshape(-1, group_pixels)
    groups = np.empty((size // group_bytes, group_bytes), np.uint8)
    for block in _blocks(len(groups)):
        (_pack_10 if bits == 10 else _pack_12)(pixels[block], groups[block])
    return groups.ravel()


_DTYPE_16 = {"little": np.dtype("<u2"), "big": np.dtype(">u2")}


def _blocks(groups: int) -> Iterator[slice]:
    return (slice(start, start + _GROUPS_AT_ONCE) for start in range(0, groups, _GROUPS_AT_ONCE))


def _pack_10(pixels: npt.NDArray[np.uint16], groups: UInt8) -> None:
    groups[:, :4] = pixels >> 2
    low = pixels & 3
    groups[:, 4] = low[:, 0] | low[:, 1] << 2 | low[:, 2] << 4 | low[:, 3] << 6


def _pack_12(pixels: npt.NDArray[np.uint16], groups: UInt8) -> None:
    groups[:, 0] = pixels[:, 0] >> 4
    groups[:, 1] = (pixels[:, 0] & 15) << 4 | pixels[:, 1] >> 8
    groups[:, 2] = pixels[:, 1] & 255
