"""Lenslet-packed pictures (ESLF): one PNG in which each view pixel is a block of all its views."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np

from lfstereo.arrays import UInt8, UInt16
from lfstereo.container.picture_size import PNG_START, decoded_picture
from lfstereo.develop.colour_spaces import PRIMARIES
from lfstereo.errors import ContainerError, OutputError
from lfstereo.lightfield.encoding import from_picture, to_picture
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.interchange.description import PLAIN, Description, from_text, to_text
from lfstereo.lightfield.interchange.png_chunks import HEAD_BYTES, chunk, colour_chunk
from lfstereo.lightfield.options import PictureOptions
from lfstereo.outputs import atomic_file, check_absent
from lfstereo.progress import Progress, silent

SUFFIX = ".png"
_KEYWORD = b"lfstereo"
_USUAL_VIEWS = 14
"""Views per direction in the pictures of Lytro's own programs and of the Stanford archive."""


def write_eslf(
    path: Path,
    light_field: LightField,
    force: bool = False,
    progress: Progress = silent,
    pictures: PictureOptions = PLAIN,
) -> None:
    """Write all views into one 16-bit picture, the weights as its alpha channel.

    The pixel in row ``v * T + t`` and column ``u * S + s`` belongs to view ``(t, s)``. The colour space is written as
    other programs read it; the number of views and where they lie on the sensor travel in a text chunk.

    Raises
    ------
    OutputError
        If the file exists and ``force`` is not set, or it cannot be written.

    References
    ----------
    Stanford, "Lytro Light Field Archive" (2016): pictures of 7574 x 5264 px, blocks of 14 x 14 views.
    W3C, "Portable Network Graphics specification", third edition (2023), chunk layout and iTXt.
    """
    check_absent(path, force)
    rows, columns, height, width, _ = light_field.views.shape
    channels = 3 if light_field.weight is None else 4
    packed = np.empty((height, rows, width, columns, channels), np.uint16)
    for t in range(rows):
        for s in range(columns):
            coded = to_picture(light_field.views[t, s], light_field.colour_space, pictures)
            packed[:, t, :, s, :3] = np.rint(coded * np.float32(65535))[..., ::-1]
            if light_field.weight is not None:
                packed[:, t, :, s, 3] = light_field.weight[t, s].astype(np.uint16) * np.uint16(257)
            progress(t * columns + s + 1, rows * columns + 1)
    picture = packed.reshape(height * rows, width * columns, channels)
    done, encoded = cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    if not done:
        raise OutputError(f"{path}: {width * columns} x {height * rows} px cannot be written as PNG; export views")
    text = chunk(b"iTXt", _KEYWORD + bytes(5) + to_text(light_field, pictures).encode("utf-8"))
    with atomic_file(path, force) as scratch, scratch.open("wb") as file:
        file.write(encoded[:HEAD_BYTES].tobytes() + colour_chunk(pictures.colour_space) + text)
        file.write(encoded[HEAD_BYTES:].data)
    progress(1, 1)


def read_eslf(path: Path) -> LightField:
    """Read a lenslet-packed picture; without a description in it, 14 x 14 views are taken for granted.

    Raises
    ------
    ContainerError
        If the file is no picture, or the views do not divide it.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ContainerError(f"{path}: cannot be read ({error.strerror}); give a PNG file") from error
    picture = decoded_picture(data, cv2.IMREAD_UNCHANGED, str(path)) if data.startswith(PNG_START) else None
    if picture is None or picture.ndim != 3 or picture.shape[2] < 3 or picture.dtype not in (np.uint8, np.uint16):
        raise ContainerError(f"{path}: cannot be read as a PNG in colour; export the light field again")
    found = _description(data, path)
    rows, columns = found.views if found is not None else (_USUAL_VIEWS, _USUAL_VIEWS)
    height, width = picture.shape[:2]
    if height % rows or width % columns:
        raise ContainerError(
            f"{path}: found {width} x {height} px, expected a multiple of {columns} x {rows} views per lenslet; give a "
            "lenslet-packed picture (ESLF)"
        )
    packed = picture.reshape(height // rows, rows, width // columns, columns, picture.shape[2])
    views = np.empty((rows, columns, height // rows, width // columns, 3), np.float32)
    space = PLAIN.colour_space if found is None else found.colour_space
    exposure_ev = 0.0 if found is None else found.exposure_ev
    for t in range(rows):
        views[t] = from_picture(packed[:, t, :, :, 2::-1], space, exposure_ev).transpose(2, 0, 1, 3)
    weight = None
    if picture.shape[2] == 4:
        weight = _eight_bits(packed[..., 3]).transpose(1, 3, 0, 2)
    return LightField(
        views=views,
        weight=None if weight is None else np.ascontiguousarray(weight),
        sampling=None if found is None else found.sampling,
        serial="" if found is None else found.serial,
        source=str(path),
        colour_space=PRIMARIES[space],
    )


def _eight_bits(codes: UInt8 | UInt16) -> UInt8:
    wide = codes.dtype == np.uint16
    return ((codes.astype(np.uint32) + 128) // 257 if wide else codes).astype(np.uint8)


def _description(data: bytes, path: Path) -> Description | None:
    """Return what the text chunk of lfstereo says, if there is one."""
    place = 8
    while place + 12 <= len(data):
        (length,), kind = struct.unpack(">I", data[place : place + 4]), data[place + 4 : place + 8]
        content = data[place + 8 : place + 8 + length]
        if kind == b"IDAT":
            return None
        if kind == b"iTXt" and content.startswith(_KEYWORD + bytes(5)):
            return from_text(content[len(_KEYWORD) + 5 :].decode("utf-8", "replace"), f"{path}: text chunk")
        place += 12 + length
    return None
