"""Raw mosaic to linear RGB on the same pixels."""

from __future__ import annotations

import numpy as np

from lfstereo.arrays import Float32, Rgb
from lfstereo.container.capture import Capture
from lfstereo.container.metadata import FrameMetadata
from lfstereo.develop.colour import grey_world_gains, to_linear_srgb, white_balance
from lfstereo.develop.demosaic import DEMOSAIC
from lfstereo.develop.highlights import lift_clipped
from lfstereo.develop.hotpixels import repair_hot_pixels
from lfstereo.develop.options import DevelopOptions
from lfstereo.develop.shading import devignette
from lfstereo.lenslet.flatten import site_levels


def develop(capture: Capture, shading: Float32, options: DevelopOptions = DevelopOptions()) -> Rgb:
    """Develop a raw mosaic: levels, devignetting, hot pixels, white balance, highlights, demosaic, colour.

    Parameters
    ----------
    capture
        The photograph.
    shading
        ``(H, W)`` float32 relative illumination of its pixels, 1 = full light.
    options
        Methods and limits.

    Returns
    -------
    ``(H, W, 3)`` float32 linear RGB; 1 = the level at which green clips in full light; neither clipped above nor
    below, so the result is linear in the light wherever the sensor was.

    Raises
    ------
    AssetError
        If the shading has another size.
    MetadataError
        If the colour matrix cannot be used.
    """
    meta = capture.metadata
    mosaic = devignette(normalise_levels(capture), shading, options.shading_floor)
    if options.hot_pixels:
        repair_hot_pixels(mosaic, options.hot_pixel_excess, noise=0.05)
    grey_world = options.white_balance == "grey-world"
    white_balance(mosaic, grey_world_gains(mosaic, meta.bayer) if grey_world else meta.white_balance, meta.bayer)
    lift_clipped(mosaic, capture.mosaic, meta)
    rgb = DEMOSAIC[options.demosaic](mosaic, meta.bayer)
    return to_linear_srgb(rgb, meta, options.exposure_bias) if options.colour_matrix else rgb


def normalise_levels(capture: Capture) -> Float32:
    """Return the mosaic with each site's black level at 0 and white level at 1, ``(H, W)`` float32."""
    meta: FrameMetadata = capture.metadata
    black, white = site_levels(meta.black, meta.bayer), site_levels(meta.white, meta.bayer)
    mosaic = capture.mosaic.astype(np.float32)
    for y in (0, 1):
        for x in (0, 1):
            mosaic[y::2, x::2] -= np.float32(black[y][x])
            mosaic[y::2, x::2] *= np.float32(1 / (white[y][x] - black[y][x]))
    return mosaic
