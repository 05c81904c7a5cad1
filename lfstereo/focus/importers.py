"""Focus sweeps of ordinary cameras: folders of pictures or RAW files, with focus distances from EXIF or a table."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import tifffile

from lfstereo.arrays import Float32, Float64, Rgb
from lfstereo.container.picture_size import PNG_START, is_picture
from lfstereo.errors import ConfigError, ContainerError, ShapeError
from lfstereo.focus.exif import FocusTags, focal_px_of, read_focus_tags
from lfstereo.focus.sweep import FocusSweep, LensData
from lfstereo.lightfield.encoding import srgb_to_linear
from lfstereo.options import option
from lfstereo.progress import Progress, silent

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".webp")
RAW_SUFFIXES = (".dng", ".nef", ".nrw", ".cr2", ".cr3", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw", ".3fr", ".iiq")
_ORIENTATION_TAG = 274
_BACKWARDS = {2: (1, -1), 3: (-1, -1), 4: (-1, 1), 6: (1, -1), 7: (-1, -1), 8: (-1, 1)}
"""Step along rows and columns, after they were exchanged, by orientation."""
_PNG_DEPTH_BYTE, _PNG_DEEP = 24, 16


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """How a folder is read."""

    distances: Path | None = option(None, "CSV of file name and focus distance in m; unset: from the pictures' EXIF")
    width_px: int = option(2000, "reduce pictures that are wider; 0: keep their size", "px")


def read_sweep(
    folder: Path, options: ImportOptions = ImportOptions(), progress: Progress = silent, fewest: int = 2
) -> FocusSweep:
    """Read a folder of pictures of one scene at several focus distances.

    RAW files are developed with the first one's white balance and without automatic brightness, so that all slices
    are alike. Pictures of 8 and 16 bits are taken as sRGB, floating-point ones as linear.

    Parameters
    ----------
    folder
        Holds the pictures, all RAW or all not; other files are left out.
    options
        Where the distances come from, and how large the slices become.
    progress
        Told the pictures read.
    fewest
        Pictures that there must be.

    Returns
    -------
    FocusSweep
        Near to far where every picture tells another distance, else in the order of the names.

    Raises
    ------
    ContainerError
        If the folder cannot be read, holds too few pictures, RAW beside others, or one that cannot be read.
    ShapeError
        If the pictures differ in size.
    ConfigError
        If the table does not fit the pictures, or an option is not possible.
    """
    if options.width_px < 0:
        raise ConfigError(f"width_px = {options.width_px}: expected 0 px or more")
    paths = find_pictures(folder, fewest)
    tags = [read_focus_tags(path) for path in paths]
    distances = _distances(paths, tags, options.distances)
    if distances is not None:
        order = np.argsort(distances, kind="stable")
        paths, tags, distances = [paths[k] for k in order], [tags[k] for k in order], distances[order]
    slices, full = _read_slices(paths, options.width_px, progress)
    names = tuple(path.name for path in paths)
    return FocusSweep(slices, names, distances, full, _lens(tags[0], (slices.shape[1], slices.shape[2])), str(folder))


def is_raw(path: Path) -> bool:
    """Say whether a file is a camera's RAW, by its name."""
    return path.suffix.lower() in RAW_SUFFIXES


def find_pictures(folder: Path, fewest: int = 2) -> list[Path]:
    """Return the pictures of a folder in the natural order of their names: 2 before 10.

    Raises
    ------
    ContainerError
        If it cannot be read, holds fewer than ``fewest`` pictures, or RAW files beside others.
    """
    try:
        found = sorted((p for p in folder.iterdir() if not p.name.startswith(".")), key=_natural)
    except OSError as error:
        raise ContainerError(f"{folder}: cannot be read ({error.strerror}); give a folder of pictures") from error
    raw = [p for p in found if is_raw(p)]
    pictures = [p for p in found if p.suffix.lower() in PICTURE_SUFFIXES]
    if raw and pictures:
        raise ContainerError(
            f"{folder}: found {len(raw)} RAW files beside {len(pictures)} other pictures, expected one kind; "
            "move the others elsewhere"
        )
    if len(raw) + len(pictures) < fewest:
        raise ContainerError(
            f"{folder}: found {len(raw) + len(pictures)} pictures, expected two or more of one scene at different "
            "focus; give the folder of a focus sweep"
        )
    return raw or pictures


def read_distances(path: Path) -> tuple[list[str], list[float]]:
    """Read a table of focus distances: lines of file name and distance in m, or of the distance alone.

    Commas, semicolons or tabs separate; ``inf`` is infinity; a first line that holds no number is a heading. Names
    are empty where the table has none.

    Raises
    ------
    ConfigError
        If the table cannot be read, or a line holds no distance above 0.
    """
    try:
        text = path.read_text("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read ({error}); give a CSV of file names and distances in m") from error
    lines = [line for line in re.split(r"\r\n|\r|\n", text) if line.strip() and not line.startswith("#")]
    cells = [
        [c.strip() for c in row] for row in csv.reader(line.replace(";", ",").replace("\t", ",") for line in lines)
    ]
    if cells and _number(cells[0][-1]) is None:
        cells = cells[1:]
    names, distances = [], []
    for row in cells:
        value = _number(row[-1])
        if len(row) > 2 or value is None or not value > 0:
            raise ConfigError(
                f"{path}: found the line '{','.join(row)}', expected a file name and a distance above 0 m, or inf"
            )
        names.append(row[0] if len(row) == 2 else "")
        distances.append(value)
    return names, distances


def _distances(paths: list[Path], tags: list[FocusTags], table: Path | None) -> Float64 | None:
    """Return the distance of every picture in m; ``None`` where EXIF does not tell them all apart."""
    if table is None:
        told = [tag.distance_m for tag in tags if tag.distance_m is not None]
        return np.array(told) if len(told) == len(paths) == len(set(told)) else None
    names, distances = read_distances(table)
    if len(distances) != len(paths):
        raise ConfigError(
            f"{table}: found {len(distances)} distances, expected {len(paths)}, one per picture in {paths[0].parent}"
        )
    if len(set(distances)) < len(distances):
        twice = next(d for d in distances if distances.count(d) > 1)
        raise ConfigError(f"{table}: found the distance {twice:g} m twice, expected all different; keep one of them")
    if not any(names):
        return np.array(distances)
    by_name = dict(zip(names, distances, strict=True))
    missing = [path.name for path in paths if path.name not in by_name]
    if missing:
        raise ConfigError(f"{table}: found no line for {missing[0]}, expected the names in {paths[0].parent}")
    return np.array([by_name[path.name] for path in paths])


def _read_slices(paths: list[Path], width_px: int, progress: Progress) -> tuple[Float32, tuple[int, int]]:
    """Return ``(K, V, U, 3)`` linear RGB, and rows and columns before they were reduced."""
    slices: Float32 | None = None
    full, gains = (0, 0), None
    for k, path in enumerate(paths):
        if is_raw(path):
            picture, gains = _read_raw(path, width_px, gains)
        else:
            picture = _read_picture(path)
        size = (picture.shape[0], picture.shape[1])
        if slices is None:
            full = size
            shrink = min(1.0, width_px / size[1]) if width_px else 1.0
            slices = np.empty((len(paths), round(size[0] * shrink), round(size[1] * shrink), 3), np.float32)
        if size != full:
            raise ShapeError(
                f"{path}: found {size[1]} x {size[0]} px, expected {full[1]} x {full[0]} as {paths[0].name} has; "
                "keep only the pictures of one sweep in the folder"
            )
        shape = (slices.shape[2], slices.shape[1])
        slices[k] = picture if shape[::-1] == size else cv2.resize(picture, shape, interpolation=cv2.INTER_AREA)
        progress(k + 1, len(paths))
    assert slices is not None
    return slices, full


def _read_raw(path: Path, width_px: int, gains: list[float] | None) -> tuple[Rgb, list[float]]:
    """Develop a RAW file to linear sRGB with the given white balance, or else the camera's, which is returned."""
    import rawpy

    try:
        with rawpy.imread(str(path)) as raw:
            used = gains or [float(g) for g in raw.camera_whitebalance]
            fast = 0 < 2 * width_px <= raw.sizes.width
            rgb = raw.postprocess(
                user_wb=used if max(used) > 0 else None,
                use_camera_wb=False,
                no_auto_bright=True,
                gamma=(1, 1),
                output_bps=16,
                output_color=rawpy.ColorSpace.sRGB,
                demosaic_algorithm=rawpy.DemosaicAlgorithm.LINEAR if fast else None,
            )
    except (rawpy.LibRawError, OSError) as error:
        reason = " ".join(str(error).split())
        raise ContainerError(f"{path}: cannot be developed ({reason}); give RAW files that LibRaw knows") from error
    return rgb.astype(np.float32) / np.float32(65535), used


def _read_picture(path: Path) -> Rgb:
    """Return a picture as linear RGB, turned upright."""
    import imageio.v3 as iio

    try:
        data = path.read_bytes()
        is_picture(data, str(path))  # no decoder allocates what a head says before this
        deep_png = data.startswith(PNG_START) and data[_PNG_DEPTH_BYTE : _PNG_DEPTH_BYTE + 1] == bytes([_PNG_DEEP])
        plugin: dict[str, Any] = {"plugin": "pillow", "rotate": True}
        if deep_png:  # which Pillow would bring to 8 bits
            plugin = {"plugin": "opencv", "flags": cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH}
        elif path.suffix.lower() in (".tif", ".tiff"):
            plugin = {"plugin": "tifffile"}
        pixels = np.asarray(iio.imread(path, **plugin))
        if plugin == {"plugin": "tifffile"}:
            pixels = _turned(pixels, _tiff_orientation(path))
    except ContainerError:
        raise
    except Exception as error:  # every decoder has its own kinds
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ContainerError(f"{path}: cannot be read as a picture ({reason}); export it again") from error
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., None], 3, axis=2)
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4) or pixels.dtype not in (np.uint8, np.uint16, np.float32):
        raise ContainerError(
            f"{path}: found {pixels.dtype} of shape {pixels.shape}, expected one picture, grey or RGB, of 8 or 16 bits "
            "or float32; export it again"
        )
    pixels = pixels[..., :3]
    return pixels if pixels.dtype == np.float32 else srgb_to_linear(pixels)


def _tiff_orientation(path: Path) -> int:
    with tifffile.TiffFile(path) as file:
        return int(file.pages.first.tags.valueof(_ORIENTATION_TAG, default=1))


def _turned(pixels: npt.NDArray[Any], orientation: int) -> npt.NDArray[Any]:
    """Return a picture upright that lies as the tag says: 5 to 8 have rows and columns exchanged.

    References
    ----------
    CIPA DC-008 (Exif 2.32), Orientation.
    """
    if orientation in (5, 6, 7, 8):
        pixels = pixels.swapaxes(0, 1)
    rows, columns = _BACKWARDS.get(orientation, (1, 1))
    return pixels[::rows, ::columns]


def _lens(tags: FocusTags, size: tuple[int, int]) -> LensData:
    aperture = tags.focal_mm / tags.f_number / 1000 if tags.focal_mm and tags.f_number else None
    return LensData(focal_px_of(tags.focal_35mm_mm, size) if tags.focal_35mm_mm else None, aperture)


def _natural(path: Path) -> tuple[tuple[int, int, str], ...]:
    parts = re.split(r"(\d+)", path.name.lower())
    return tuple((1, int(p), "") if p.isdigit() else (0, 0, p) for p in parts)


def _number(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return None if math.isnan(number) else number
