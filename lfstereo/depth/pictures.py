"""Linear pictures to sRGB files."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from lfstereo.arrays import Float32, UInt8, UInt16
from lfstereo.errors import ShapeError
from lfstereo.outputs import atomic_file


def srgb8(linear: Float32) -> UInt8:
    """Return 8-bit sRGB of linear RGB, 1.0 = 255; values outside 0..1 are clipped.

    Examples
    --------
    >>> srgb8(np.array([0.0, 0.18, 1.0, 2.0], np.float32)).tolist()
    [0, 118, 255, 255]
    """
    coded: UInt8 = np.rint(_encoded(linear) * np.float32(255)).astype(np.uint8)
    return coded


def srgb16(linear: Float32) -> UInt16:
    """Return 16-bit sRGB of linear RGB, 1.0 = 65535; values outside 0..1 are clipped."""
    coded: UInt16 = np.rint(_encoded(linear) * np.float32(65535)).astype(np.uint16)
    return coded


def write_png(path: Path, picture: UInt8 | UInt16, force: bool = False) -> None:
    """Write an 8- or 16-bit RGB or grey picture as PNG.

    Parameters
    ----------
    path
        The file to write.
    picture
        ``(V, U, 3)`` RGB or ``(V, U)`` grey, already encoded.
    force
        Replace an existing file.

    Raises
    ------
    ShapeError
        If the array is no 8- or 16-bit picture.
    OutputError
        If the file exists and ``force`` is not set, or cannot be written.
    """
    fits = picture.ndim == 2 or (picture.ndim == 3 and picture.shape[2] == 3)
    if not fits or picture.size == 0 or picture.dtype not in (np.uint8, np.uint16):
        raise ShapeError(f"{path}: found {picture.dtype} of shape {picture.shape}, expected 8- or 16-bit RGB or grey")
    _, coded = cv2.imencode(".png", picture if picture.ndim == 2 else np.ascontiguousarray(picture[..., ::-1]))
    with atomic_file(path, force) as scratch:
        scratch.write_bytes(coded.tobytes())


def _encoded(linear: Float32) -> Float32:
    """IEC 61966-2-1 (1999), sRGB transfer curve."""
    clipped = np.clip(linear, 0.0, 1.0).astype(np.float32)
    bent = np.float32(1.055) * np.power(clipped, np.float32(1 / 2.4)) - np.float32(0.055)
    encoded: Float32 = np.where(clipped <= 0.0031308, np.float32(12.92) * clipped, bent)
    return encoded
