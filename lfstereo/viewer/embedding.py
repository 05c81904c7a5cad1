"""Pictures and arrays as text inside a page."""

from __future__ import annotations

import base64

import cv2
import numpy as np

from lfstereo.arrays import Bool, UInt8, UInt16
from lfstereo.container.picture_size import decoded_picture
from lfstereo.depth.colormap import DisparityScale, colour_disparity
from lfstereo.errors import ContainerError

JPEG_QUALITY = 86
_JPEG_START = "data:image/jpeg;base64,"


def jpeg_uri(picture: UInt8, quality: int = JPEG_QUALITY) -> str:
    """Return a ``(V, U, 3)`` sRGB picture as a data URI, colours at full resolution."""
    return _JPEG_START + _text(jpeg_bytes(picture, quality))


def jpeg_bytes(picture: UInt8, quality: int = JPEG_QUALITY) -> bytes:
    """Return a ``(V, U, 3)`` sRGB picture as JPEG, colours at full resolution."""
    settings = [
        cv2.IMWRITE_JPEG_QUALITY,
        quality,
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444,
    ]
    _, coded = cv2.imencode(".jpg", np.ascontiguousarray(picture[..., ::-1]), settings)
    return bytes(coded.tobytes())


def picture_from_uri(uri: str) -> UInt8:
    """Return the ``(V, U, 3)`` sRGB picture of a data URI.

    Raises
    ------
    ContainerError
        If it holds no picture.
    """
    try:
        coded = base64.b64decode(uri.removeprefix(_JPEG_START), validate=True)
    except ValueError:
        coded = b""
    picture = decoded_picture(coded, cv2.IMREAD_COLOR, "page")
    if picture is None:
        raise ContainerError(f"page: found '{uri[:32]}…', expected a JPEG picture; run the pair again")
    turned: UInt8 = np.ascontiguousarray(picture[..., ::-1])
    return turned


def array_text(array: UInt8 | UInt16) -> str:
    """Return the bytes of an array, little-endian, row by row, in base64."""
    return _text(array.astype(array.dtype.newbyteorder("<")).tobytes())


def mask_text(mask: Bool) -> str:
    """Return a mask as bits, the first in the highest bit of the first byte, in base64."""
    return _text(np.packbits(mask).tobytes())


def colour_table() -> str:
    """Return the 256 colours of disparity pictures, far to near, in base64."""
    steps = np.arange(256, dtype=np.float32)[None]
    return array_text(colour_disparity(steps, None, DisparityScale(near_px=255.0)))


def _text(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")
