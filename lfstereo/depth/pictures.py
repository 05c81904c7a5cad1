"""Encoded pictures to PNG files."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from lfstereo.arrays import UInt8, UInt16
from lfstereo.errors import ShapeError
from lfstereo.outputs import atomic_file


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
