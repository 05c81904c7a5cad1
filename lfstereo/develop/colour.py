"""White balance, camera colours to linear sRGB, exposure."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32, Float64, Rgb
from lfstereo.container.metadata import FrameMetadata, Quad
from lfstereo.errors import ConfigError, MetadataError
from lfstereo.lenslet.flatten import site_levels


def white_balance(mosaic: Float32, gains: Quad, bayer: str) -> None:
    """Multiply every site by the gain of its colour, in place.

    Parameters
    ----------
    mosaic
        ``(H, W)`` float32 linear mosaic.
    gains
        Gains of r, gr, gb, b.
    bayer
        Colours of the top-left 2 x 2 sites row by row.
    """
    sites = site_levels(gains, bayer)
    for y in (0, 1):
        for x in (0, 1):
            mosaic[y::2, x::2] *= np.float32(sites[y][x])


def grey_world_gains(mosaic: Float32, bayer: str) -> Quad:
    """Return the gains that make the mean of the well-lit pixels grey, green = 1.

    Parameters
    ----------
    mosaic
        ``(H, W)`` float32 devignetted mosaic, 1 = the sensor's white level.
    bayer
        Colours of the top-left 2 x 2 sites row by row.

    References
    ----------
    Buchsbaum, "A spatial processor model for object colour perception" (J. Franklin Institute 1980).
    """
    cells = np.stack([mosaic[y::2, x::2] for y in (0, 1) for x in (0, 1)])
    usable = (cells.max(0) < 0.9) & (cells.min(0) > 0.002)
    means = dict.fromkeys("rgb", 0.0)
    for k, colour in enumerate(bayer):
        share = 0.5 if colour == "g" else 1.0
        means[colour] += share * (float(cells[k][usable].mean()) if usable.any() else 1.0)
    return means["g"] / means["r"], 1.0, 1.0, means["g"] / means["b"]


def camera_matrix(metadata: FrameMetadata, temperature_k: float | None = None) -> Float64:
    """Return ``(3, 3)``: white-balanced camera RGB to linear sRGB, greys unchanged.

    Parameters
    ----------
    metadata
        Colour matrices of the photograph. Rows are scaled to sum 1, which keeps greys.
    temperature_k
        Colour temperature of the light, kelvin: interpolates between the factory's matrices, linearly in kelvin as
        the cameras do, and takes the first or last one beyond them. ``None`` takes the photograph's own matrix, which
        the camera interpolated in this way for the temperature it found.

    Raises
    ------
    ConfigError
        If the temperature is not one that light has.
    MetadataError
        If a row of the matrix does not have a positive sum, or a temperature is given and the metadata hold no
        matrices to interpolate between.

    """
    matrix = np.asarray(metadata.ccm, np.float64)
    if temperature_k is not None:
        if not 1000 <= temperature_k <= 40000:
            raise ConfigError(f"temperature_k: found {temperature_k:g}, expected 1000 to 40000 K; daylight has 5500")
        if not metadata.ccm_by_cct:
            raise MetadataError(
                f"perCcm: found no colour matrices to interpolate at {temperature_k:g} K, expected some in the "
                "metadata; leave the temperature out to take the photograph's own matrix"
            )
        known = np.array([cct for cct, _ in metadata.ccm_by_cct])
        stack = np.array([numbers for _, numbers in metadata.ccm_by_cct], np.float64)
        matrix = np.array([np.interp(temperature_k, known, column) for column in stack.T])
    matrix = matrix.reshape(3, 3)
    sums = matrix.sum(1)
    if not (sums > 0.1).all():
        raise MetadataError(f"ccm: found rows with sums {sums.round(3).tolist()}, expected about 1; check the metadata")
    scaled: Float64 = matrix / sums[:, None]
    return scaled


def to_linear(rgb: Rgb, matrix: Float64) -> Rgb:
    """Turn white-balanced camera colours into linear RGB by a matrix, in place."""
    return np.asarray(cv2.transform(rgb, matrix, dst=rgb), np.float32)
