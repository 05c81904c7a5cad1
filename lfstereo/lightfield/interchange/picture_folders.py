"""Folders of views: 16-bit TIFF with a colour profile, and the layout of the HCI 4-D light field benchmark."""

from __future__ import annotations

import configparser
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tifffile

from lfstereo.arrays import Rgb
from lfstereo.errors import ContainerError
from lfstereo.lightfield.encoding import to_picture
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.interchange.description import FILE_NAME, MOST_VIEWS, PLAIN, Description, from_text, to_text
from lfstereo.lightfield.interchange.icc import icc_profile
from lfstereo.lightfield.options import PictureOptions
from lfstereo.lightfield.views_folder import read_views_folder, write_png
from lfstereo.outputs import atomic_folder
from lfstereo.progress import Progress, silent

PARAMETERS = "parameters.cfg"


def write_tiff_folder(
    folder: Path,
    light_field: LightField,
    force: bool = False,
    progress: Progress = silent,
    pictures: PictureOptions = PLAIN,
) -> None:
    """Write each view as ``view_TT_SS.tif``, 16 bits, with the ICC profile of its colour space.

    Raises
    ------
    OutputError
        If the folder exists and ``force`` is not set, or it cannot be written.
    """
    profile = icc_profile(pictures.colour_space)

    def write(path: Path, view: Rgb) -> None:
        coded = to_picture(view, light_field.colour_space, pictures)
        codes = np.rint(coded * np.float32(65535)).astype(np.uint16)
        tifffile.imwrite(path, codes, photometric="rgb", iccprofile=profile, metadata=None, software="lfstereo")

    with atomic_folder(folder, force) as scratch:
        _write_views(scratch, "view_{t:02d}_{s:02d}.tif", write, light_field, progress, pictures)


SENSOR_SIZE_MM = 35.0
"""The benchmark's sensor; only its ratio to the focal length counts."""


@dataclass(frozen=True, slots=True)
class HciLengths:
    """What turns disparities of the HCI benchmark into depth."""

    focal_length_mm: float
    """For a sensor whose longer side is ``SENSOR_SIZE_MM``."""
    baseline_mm: float
    """Between neighbouring views."""
    focus_distance_m: float
    """Depth of disparity 0."""


def write_hci_folder(
    folder: Path,
    light_field: LightField,
    force: bool = False,
    progress: Progress = silent,
    pictures: PictureOptions = PLAIN,
    lengths: HciLengths | None = None,
) -> None:
    """Write the views as the HCI benchmark has them: ``input_Cam000.png`` row by row, and ``parameters.cfg``.

    The benchmark's disparity is the slope here, px per view and positive for nearer.

    Parameters
    ----------
    folder
        Folder to write.
    light_field
        What to write.
    force
        Replace an existing folder.
    progress
        Told of the views written.
    pictures
        How linear light becomes pictures; the benchmark's are sRGB.
    lengths
        What turns disparity into depth; left out of ``parameters.cfg`` where it is ``None``, as a light field alone
        does not tell it.

    Raises
    ------
    OutputError
        If the folder exists and ``force`` is not set, or it cannot be written.

    References
    ----------
    Honauer, Johannsen, Kondermann, Goldluecke, "A dataset and evaluation methodology for depth estimation on 4D light
    fields" (ACCV 2016), and the parameter files of its scenes.
    """
    rows, columns, height, width = light_field.views.shape[:4]
    intrinsics = {"image_resolution_x_px": str(width), "image_resolution_y_px": str(height)}
    extrinsics = {"num_cams_x": str(columns), "num_cams_y": str(rows)}
    if lengths is not None:
        intrinsics |= {"focal_length_mm": str(float(lengths.focal_length_mm)), "sensor_size_mm": str(SENSOR_SIZE_MM)}
        extrinsics |= {
            "baseline_mm": str(float(lengths.baseline_mm)),
            "focus_distance_m": str(float(lengths.focus_distance_m)),
        }
    parameters = configparser.ConfigParser(interpolation=None)
    parameters.read_dict({"intrinsics": intrinsics, "extrinsics": extrinsics, "meta": {"scene": folder.name}})

    def write(path: Path, view: Rgb) -> None:
        write_png(path, view, light_field.colour_space, pictures)

    with atomic_folder(folder, force) as scratch:
        _write_views(scratch, "input_Cam{n:03d}.png", write, light_field, progress, pictures)
        with (scratch / PARAMETERS).open("w", encoding="utf-8") as file:
            parameters.write(file)


def read_picture_folder(folder: Path) -> LightField:
    """Read a folder of views of any of these layouts, and what is written beside them.

    Raises
    ------
    ContainerError
        If the folder holds no views, one is missing or unreadable, or the text beside them cannot be used.
    ShapeError
        If the views differ in size.
    """
    found = _beside(folder)
    light_field = read_views_folder(folder, found.views if found is not None else _hci_views(folder), found)
    if found is None:
        return light_field
    if light_field.views.shape[:2] != found.views:
        rows, columns = light_field.views.shape[:2]
        raise ContainerError(
            f"{folder}: found {rows} x {columns} views, expected {found.views[0]} x {found.views[1]} as in "
            f"{FILE_NAME}; complete the folder or remove that file"
        )
    return replace(light_field, sampling=found.sampling, serial=found.serial)


def _write_views(
    folder: Path,
    name: str,
    write: Callable[[Path, Rgb], None],
    light_field: LightField,
    progress: Progress,
    pictures: PictureOptions,
) -> None:
    rows, columns = light_field.views.shape[:2]
    for t in range(rows):
        for s in range(columns):
            write(folder / name.format(t=t, s=s, n=t * columns + s), light_field.views[t, s])
            progress(t * columns + s + 1, rows * columns)
    (folder / FILE_NAME).write_text(to_text(light_field, pictures), "utf-8")


def _beside(folder: Path) -> Description | None:
    path = folder / FILE_NAME
    if not path.is_file():
        return None
    return from_text(path.read_text("utf-8", "replace"), str(path))


def _hci_views(folder: Path) -> tuple[int, int] | None:
    path = folder / PARAMETERS
    if not path.is_file():
        return None
    parameters = configparser.ConfigParser(interpolation=None)
    try:
        parameters.read_string(path.read_text("utf-8", "replace"))
        extrinsics = parameters["extrinsics"]
        rows, columns = int(extrinsics["num_cams_y"]), int(extrinsics["num_cams_x"])
        if not (1 <= rows <= MOST_VIEWS and 1 <= columns <= MOST_VIEWS):
            raise ValueError(f"found {rows} x {columns} views, expected 1 to {MOST_VIEWS} each")
    except (configparser.Error, KeyError, ValueError) as error:
        reason = str(error).splitlines()[0]
        raise ContainerError(
            f"{path}: found no num_cams_x and num_cams_y under [extrinsics] ({reason}); correct or remove that file"
        ) from error
    return rows, columns
