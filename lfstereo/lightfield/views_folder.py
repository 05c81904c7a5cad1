"""Light fields as folders with one image per view, as benchmarks and other tools keep them."""

from __future__ import annotations

import math
import re
from pathlib import Path

import cv2
import numpy as np

from lfstereo.arrays import Rgb, UInt8, UInt16
from lfstereo.container.picture_size import decoded_picture
from lfstereo.develop.colour_spaces import PRIMARIES
from lfstereo.develop.options import Primaries
from lfstereo.errors import ContainerError, ShapeError
from lfstereo.lightfield.encoding import from_picture, to_picture
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.interchange.description import FILE_NAME, PLAIN, Description, to_text
from lfstereo.lightfield.interchange.png_chunks import HEAD_BYTES, colour_chunk
from lfstereo.lightfield.options import PictureOptions
from lfstereo.outputs import atomic_folder
from lfstereo.progress import Progress, silent

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm")
_ROW_COLUMN = re.compile(r"(?:^|[^0-9])(\d{1,3})[_-](\d{1,3})$")
_COUNTED = re.compile(r"(?:cam|view|im|img)_?(\d{2,4})$", re.IGNORECASE)


def read_views_folder(
    folder: Path, count: tuple[int, int] | None = None, found: Description | None = None
) -> LightField:
    """Read a folder of views named by row and column, or numbered row by row.

    ``..._RR_CC.png`` (row first, counted from 0 or 1) and the HCI benchmark's ``input_Cam000.png`` to
    ``input_Cam080.png`` (a square number of views) are understood; values are taken as sRGB unless told otherwise.

    Parameters
    ----------
    folder
        The folder.
    count
        Rows and columns of numbered views, where they are known; ``None`` takes them for a square.
    found
        What was written beside the views: here their colour space and exposure.

    Returns
    -------
    A light field without weights and without a place on a sensor.

    Raises
    ------
    ContainerError
        If the folder holds no views, a view is missing or unreadable.
    ShapeError
        If the views differ in size.
    """
    paths = _numbered(folder, count)
    rows, columns = (1 + max(key[axis] for key in paths) for axis in (0, 1))
    missing = [(t, s) for t in range(rows) for s in range(columns) if (t, s) not in paths]
    if missing:
        t, s = missing[0]
        raise ContainerError(
            f"{folder}: found {len(paths)} views, expected {rows} x {columns}; row {t}, column {s} (counted from 0) is "
            f"the first of {len(missing)} missing"
        )
    space = PLAIN.colour_space if found is None else found.colour_space
    exposure_ev = 0.0 if found is None else found.exposure_ev
    views: np.ndarray[tuple[int, ...], np.dtype[np.float32]] | None = None
    for (t, s), path in sorted(paths.items()):
        picture = _read_picture(path)
        if views is None:
            views = np.empty((rows, columns, *picture.shape), np.float32)
        if picture.shape != views.shape[2:]:
            raise ShapeError(f"{path}: found a view of shape {picture.shape}, expected {views.shape[2:]} as the others")
        views[t, s] = from_picture(picture, space, exposure_ev)
    assert views is not None
    return LightField(
        views=views, weight=None, sampling=None, serial="", source=str(folder), colour_space=PRIMARIES[space]
    )


def write_views_folder(
    folder: Path,
    light_field: LightField,
    force: bool = False,
    progress: Progress = silent,
    pictures: PictureOptions = PLAIN,
) -> None:
    """Write each view as ``view_TT_SS.png``, 8 bits, and what they do not say as TOML.

    Raises
    ------
    OutputError
        If the folder exists and ``force`` is not set, or it cannot be written.
    """
    rows, columns = light_field.views.shape[:2]
    with atomic_folder(folder, force) as scratch:
        for t in range(rows):
            for s in range(columns):
                view = light_field.views[t, s]
                write_png(scratch / f"view_{t:02d}_{s:02d}.png", view, light_field.colour_space, pictures)
                progress(t * columns + s + 1, rows * columns)
        (scratch / FILE_NAME).write_text(to_text(light_field, pictures), "utf-8")


def write_png(path: Path, view: Rgb, primaries: Primaries = "srgb", pictures: PictureOptions = PLAIN) -> None:
    """Write one view with 8 bits, its colour space named.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    coded = np.rint(to_picture(view, primaries, pictures) * np.float32(255)).astype(np.uint8)
    encoded = cv2.imencode(".png", coded[..., ::-1])[1]
    with path.open("wb") as file:
        file.write(encoded[:HEAD_BYTES].tobytes() + colour_chunk(pictures.colour_space))
        file.write(encoded[HEAD_BYTES:].data)


def _numbered(folder: Path, count: tuple[int, int] | None) -> dict[tuple[int, int], Path]:
    pictures = sorted(p for p in folder.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES)
    pairs = [(found, path) for path in pictures if (found := _ROW_COLUMN.search(path.stem))]
    if pairs:
        return _from_zero([((int(m[1]), int(m[2])), path) for m, path in pairs], folder)
    counted = [(int(found[1]), path) for path in pictures if (found := _COUNTED.search(path.stem))]
    if not counted:
        raise ContainerError(
            f"{folder}: found {len(pictures)} images but none named like a view, expected names such as "
            "view_00_00.png (row, column) or input_Cam000.png"
        )
    first = min(number for number, _ in counted)
    number_of_views = max(number for number, _ in counted) - first + 1
    if count is not None and count[0] * count[1] == number_of_views:
        return _from_zero([(divmod(number - first, count[1]), path) for number, path in counted], folder)
    side = math.isqrt(number_of_views)
    if side * side != number_of_views:
        raise ContainerError(
            f"{folder}: found {len(counted)} numbered views, expected a square number; name them by row and column "
            "(view_00_00.png)"
        )
    return _from_zero([(divmod(number - first, side), path) for number, path in counted], folder)


def _from_zero(named: list[tuple[tuple[int, int], Path]], folder: Path) -> dict[tuple[int, int], Path]:
    first = tuple(min(key[axis] for key, _ in named) for axis in (0, 1))
    paths: dict[tuple[int, int], Path] = {}
    for key, path in named:
        place = (key[0] - first[0], key[1] - first[1])
        if place in paths:
            raise ContainerError(
                f"{folder}: {paths[place].name} and {path.name} are both row {key[0]}, column {key[1]}; keep one"
            )
        paths[place] = path
    return paths


def _read_picture(path: Path) -> UInt8 | UInt16:
    try:
        picture = decoded_picture(path.read_bytes(), cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH, str(path))
    except OSError as error:
        raise ContainerError(f"{path}: cannot be read ({error.strerror}); check its permissions") from error
    if picture is None or picture.dtype not in (np.uint8, np.uint16):
        raise ContainerError(f"{path}: cannot be read as an 8-bit or 16-bit image; write it again")
    turned: UInt8 | UInt16 = np.ascontiguousarray(picture[..., ::-1])
    return turned
