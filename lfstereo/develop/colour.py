"""White balance, camera colours to linear sRGB, exposure."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32, Rgb
from lfstereo.container.metadata import FrameMetadata, Quad
from lfstereo.errors import MetadataError
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


def to_linear_srgb(rgb: Rgb, metadata: FrameMetadata, apply_exposure_bias: bool) -> Rgb:
    """Turn white-balanced camera colours into linear sRGB, in place; greys stay grey.

    Parameters
    ----------
    rgb
        ``(H, W, 3)`` white-balanced camera RGB.
    metadata
        Colour matrix and exposure bias of the photograph. The matrix's rows are scaled to sum 1, which keeps
        greys.
    apply_exposure_bias
        Brighten or darken by the camera's ``modulationExposureBias``.

    Raises
    ------
    MetadataError
        If a row of the colour matrix does not have a positive sum.
    """
    matrix = np.asarray(metadata.ccm, np.float64).reshape(3, 3)
    sums = matrix.sum(1)
    if not (sums > 0.1).all():
        raise MetadataError(f"ccm: found rows with sums {sums.round(3).tolist()}, expected about 1; check the metadata")
    matrix = matrix / sums[:, None]
    if apply_exposure_bias:
        matrix = matrix * 2.0**metadata.exposure_bias_ev
    return np.asarray(cv2.transform(rgb, matrix, dst=rgb), np.float32)
