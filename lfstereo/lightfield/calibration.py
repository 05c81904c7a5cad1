"""What a photograph is decoded with, found in a library of white images or in the photograph itself."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from lfstereo.arrays import Float32, UInt16
from lfstereo.container.capture import Capture
from lfstereo.develop.shading import shading_from_photograph, shading_from_white_image
from lfstereo.errors import QualityWarning
from lfstereo.lenslet.choice import choose_grid
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.options import GridOptions
from lfstereo.lightfield.decoding import check_method, part_of, views_from
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.lftoolbox import decode_as_lftoolbox
from lfstereo.lightfield.options import DecodeOptions
from lfstereo.progress import Progress, silent


@dataclass(frozen=True, slots=True)
class LensletCalibration:
    """Grid, illumination and bad pixels of one photograph."""

    grid: LensletGrid
    shading: Float32
    """``(H, W)`` relative illumination of its pixels, 1 = full light."""
    white: Capture | None
    """The white image that was used; ``None`` where the photograph itself had to do."""
    white_grid: LensletGrid | None
    """That white image's own grid."""
    hot_pixels: UInt16 | None
    """``(N, 2)`` (x, y) pixels that the factory found bad."""
    offset_px: float | None
    """RMS distance of the grid from the photograph's micro-images; ``None`` where it was taken from them."""


def calibrate_photograph(
    photograph: Capture, whites: Path | None, options: GridOptions = GridOptions(), progress: Progress = silent
) -> LensletCalibration:
    """Find grid and illumination as `choose_grid` tells, and warn where the photograph itself had to do.

    Parameters
    ----------
    photograph
        The capture to decode.
    whites
        Folder or archive of white images, or one white image; ``None`` looks among those imported before.
    options
        Of the grid.
    progress
        Told of the work done.

    Warns
    -----
    QualityWarning
        If no white image fits, or the photograph does not tell its camera; with a figure of the grid's quality.

    Raises
    ------
    AssetError, ContainerError, MetadataError, GridFitError
        As `choose_grid`.
    """
    choice = choose_grid(photograph, whites, options, progress)
    if choice.warning:
        warnings.warn(choice.warning, QualityWarning, stacklevel=2)
    if choice.white is None:
        shading = shading_from_photograph(photograph, choice.grid)
    else:
        shading = shading_from_white_image(choice.white)
        moved = choice.white_moved()
        if moved is not None:
            size = shading.shape[1], shading.shape[0]
            flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
            warped = cv2.warpAffine(shading, moved, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
            shading = np.maximum(np.asarray(warped, np.float32), 0)
    return LensletCalibration(
        choice.grid, shading, choice.white, choice.white_grid, choice.hot_pixels, choice.offset_px
    )


def decode_photograph(
    photograph: Capture,
    whites: Path | None,
    options: DecodeOptions = DecodeOptions(),
    progress: Progress = silent,
) -> LightField:
    """Decode a photograph with the white images that fit it best, or without any.

    Parameters
    ----------
    photograph
        The capture.
    whites
        As in `calibrate_photograph`.
    options
        Number and distance of the views, and the options of each step.
    progress
        Told of the work done, in hundredths.

    Returns
    -------
    The light field, as `lfstereo.lightfield.decoding.decode` returns it.

    Warns
    -----
    QualityWarning
        As `calibrate_photograph`.

    Raises
    ------
    AssetError, ConfigError, ContainerError, MetadataError, GridFitError
        As `choose_grid` and `lfstereo.lightfield.decoding.decode`.
    """
    found = calibrate_photograph(photograph, whites, options.grid, part_of(progress, 0, 25))
    return decode_with(photograph, found, options, part_of(progress, 25, 100))


def decode_with(
    photograph: Capture,
    calibration: LensletCalibration,
    options: DecodeOptions = DecodeOptions(),
    progress: Progress = silent,
) -> LightField:
    """Decode a photograph with what `calibrate_photograph` found."""
    check_method(options, calibration.white)
    if options.method == "lftoolbox" and calibration.white is not None and calibration.white_grid is not None:
        return decode_as_lftoolbox(photograph, calibration.white, calibration.white_grid, progress)
    return views_from(
        photograph, calibration.grid, calibration.shading, options, progress, hot_pixels=calibration.hot_pixels
    )
