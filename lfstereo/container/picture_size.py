"""Pictures of other programs: how large they say they are, before they are decoded."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from lfstereo.container.contents import jpeg_size
from lfstereo.container.expansion import check_expansion

PNG_START = b"\x89PNG\r\n\x1a\n"
_JPEG_START = b"\xff\xd8"
_TIFF_STARTS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PLAIN_STARTS = (b"BM", b"P4", b"P5", b"P6")
_MOST_BYTES_PER_PX = 8
"""Four channels of 16 bits."""


def is_picture(data: bytes, where: str) -> bool:
    """Return whether bytes are a PNG, JPEG, TIFF, BMP or PPM of a size that can be.

    Raises
    ------
    ContainerError
        If the head says more pixels than `check_expansion` allows for so many bytes.
    """
    size = _size(data)
    if size is None:
        return False
    check_expansion(len(data), size[0] * size[1] * _MOST_BYTES_PER_PX, where)
    return min(size) > 0


def decoded_picture(data: bytes, flags: int, where: str) -> Any:
    """Return what OpenCV makes of a picture, or None.

    Raises
    ------
    ContainerError
        As :func:`is_picture`.
    """
    if not is_picture(data, where):
        return None
    try:
        return cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        return None


def picture_in(path: Path, flags: int) -> Any:
    """Return what OpenCV makes of a file, or None where it cannot be read or is no picture.

    Raises
    ------
    ContainerError
        As :func:`is_picture`.
    """
    try:
        data = path.read_bytes()
    except OSError:
        return None
    return decoded_picture(data, flags, str(path))


def _size(data: bytes) -> tuple[int, int] | None:
    """Return (width, height), or None where there is no head that tells."""
    if data.startswith(PNG_START):
        return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")
    if data.startswith(_JPEG_START):
        return jpeg_size(data)
    try:
        if data.startswith(_TIFF_STARTS):
            return _tiff_size(data)
        if data.startswith(_PLAIN_STARTS):
            from PIL import Image

            with Image.open(io.BytesIO(data)) as picture:
                return picture.size
    except Exception:  # damaged heads fail in many ways there
        return None
    return None


def _tiff_size(data: bytes) -> tuple[int, int]:
    import tifffile

    with tifffile.TiffFile(io.BytesIO(data)) as file:
        page: Any = file.pages.first
        samples, depth = int(page.samplesperpixel), int(page.imagedepth)
        tiles = int(page.tilewidth or 0) * int(page.tilelength or 0)
        width, height = int(page.imagewidth) * samples * depth, int(page.imagelength)
        return (tiles, 1) if tiles > width * height else (width, height)
