"""Raw mosaic to linear RGB on the same pixels."""

from __future__ import annotations

import numpy as np

from lfstereo.arrays import Float32, Float64, Rgb, UInt16
from lfstereo.container.capture import Capture
from lfstereo.container.metadata import FrameMetadata
from lfstereo.develop.colour import camera_matrix, grey_world_gains, to_linear, white_balance
from lfstereo.develop.colour_spaces import conversion
from lfstereo.develop.demosaic import DEMOSAIC
from lfstereo.develop.demosaic_david import david2017
from lfstereo.develop.highlights import lift_clipped
from lfstereo.develop.hotpixels import repair_hot_pixels
from lfstereo.develop.options import DevelopOptions
from lfstereo.develop.shading import devignette
from lfstereo.errors import ConfigError
from lfstereo.lenslet.flatten import site_levels
from lfstereo.lenslet.grid import LensletGrid


def develop(
    capture: Capture,
    shading: Float32,
    options: DevelopOptions = DevelopOptions(),
    hot_pixels: UInt16 | None = None,
    grid: LensletGrid | None = None,
) -> Rgb:
    """Develop a raw mosaic to a picture: :func:`develop_mosaic`, demosaic, :func:`output_matrix`.

    Parameters
    ----------
    capture, shading, options, hot_pixels
        As for :func:`develop_mosaic`.
    grid
        The lenslet grid, which ``david2017`` alone needs.

    Returns
    -------
    ``(H, W, 3)`` float32 linear RGB of the primaries that the options name; 1 = the level at which green clips in full
    light; neither clipped above nor below, so the result is linear in the light wherever the sensor was.

    Raises
    ------
    AssetError
        If the shading has another size.
    ConfigError
        If the colour temperature cannot be, a colour space is asked for without the colour matrix, or a demosaic that
        needs a grid has none.
    MetadataError
        If the colour matrix cannot be used, or there are none for a colour temperature.
    """
    if options.demosaic == "david2017" and grid is None:
        raise ConfigError("demosaic: found david2017 without a lenslet grid, expected one; choose another demosaic")
    matrix = output_matrix(capture.metadata, options)
    mosaic = develop_mosaic(capture, shading, options, hot_pixels)
    bayer = capture.metadata.bayer
    if options.demosaic == "david2017" and grid is not None:
        return to_linear(david2017(mosaic, bayer, shading, grid), matrix)
    return to_linear(DEMOSAIC[options.demosaic](mosaic, bayer), matrix)


def develop_mosaic(
    capture: Capture,
    shading: Float32,
    options: DevelopOptions = DevelopOptions(),
    hot_pixels: UInt16 | None = None,
) -> Float32:
    """Develop a raw mosaic up to the demosaic: levels, devignetting, hot pixels, white balance, highlights.

    Parameters
    ----------
    capture
        The photograph.
    shading
        ``(H, W)`` float32 relative illumination of its pixels, 1 = full light.
    options
        Methods and limits.
    hot_pixels
        ``(N, 2)`` (x, y) pixels that are known to be bad, as the camera's ``HOTPIXEL.BIN`` lists them.

    Returns
    -------
    ``(H, W)`` float32, still one colour per pixel, greys equal in all colours; 1 = the level at which green clips in
    full light.

    Raises
    ------
    AssetError
        If the shading has another size.
    """
    meta = capture.metadata
    mosaic = devignette(normalise_levels(capture), shading, options.shading_floor)
    if options.hot_pixels:
        repair_hot_pixels(mosaic, shading, options.hot_pixel_excess, noise=0.05, known=hot_pixels)
    grey_world = options.white_balance == "grey-world"
    gains = grey_world_gains(mosaic, meta.bayer) if grey_world else meta.white_balance
    white_balance(mosaic, gains, meta.bayer)
    lift_clipped(mosaic, capture.mosaic, meta, gains)
    return mosaic


def output_matrix(metadata: FrameMetadata, options: DevelopOptions = DevelopOptions()) -> Float64:
    """Return ``(3, 3)``: white-balanced camera RGB to linear RGB of the options' colour space, with the exposure bias.

    Raises
    ------
    ConfigError
        If the colour temperature cannot be, or a colour space is asked for without the colour matrix.
    MetadataError
        If the colour matrix cannot be used, or there are none for a colour temperature.
    """
    if not options.colour_matrix:
        if options.colour_space != "srgb":
            raise ConfigError(
                f"colour_space: found {options.colour_space} without the colour matrix, expected one with the other; "
                "leave the camera's own colours as they are, or apply the matrix"
            )
        return np.eye(3)
    matrix = conversion("srgb", options.colour_space) @ camera_matrix(metadata, options.temperature_k)
    exposed: Float64 = matrix * 2.0 ** (metadata.exposure_bias_ev if options.exposure_bias else 0.0)
    return exposed


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
