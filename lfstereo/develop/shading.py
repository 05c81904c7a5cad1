"""How brightly each pixel is lit behind its lenslet: from a white image, or from the photograph's own gaps."""

from __future__ import annotations

import cv2
import numba
import numpy as np

from lfstereo.arrays import Float32, Float64, Mosaic, check_shape
from lfstereo.container.capture import Capture
from lfstereo.errors import AssetError
from lfstereo.lenslet.flatten import flatten, site_levels
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.lattice import Lattice
from lfstereo.lenslet.profile import BINS_PER_PIXEL, mean_micro_image

_FULL_LIGHT_PERCENTILE = 99.5
_SAMPLE_STRIDE = 5


def shading_from_white_image(white: Capture) -> Float32:
    """Turn a white image into the relative illumination of every pixel.

    The colour of its light and of the Bayer filters is divided out with the mean response of each of the four
    sites, so that devignetting changes no colours.

    Parameters
    ----------
    white
        White image.

    Returns
    -------
    ``(H, W)`` float32, 1 = full light (the 99.5th percentile), 0 = none; may exceed 1 a little.
    """
    meta = white.metadata
    black = np.array(site_levels(meta.black, meta.bayer), np.float32)
    scale = np.empty((2, 2), np.float32)
    for y in (0, 1):
        for x in (0, 1):
            plane = white.mosaic[y::2, x::2]
            smooth = np.zeros(plane[1:-1:_SAMPLE_STRIDE, 1:-1:_SAMPLE_STRIDE].shape, np.float32)
            for row in range(3):
                for column in range(3):
                    last = (row - 2 or None, column - 2 or None)
                    smooth += plane[row : last[0] : _SAMPLE_STRIDE, column : last[1] : _SAMPLE_STRIDE]
            full = float(np.percentile(smooth / 9, _FULL_LIGHT_PERCENTILE)) - float(black[y, x])
            scale[y, x] = 1 / max(full, 1.0)
    shading: Float32 = np.empty(white.mosaic.shape, np.float32)
    _scale_sites(white.mosaic, black, scale, shading)
    return shading


def shading_from_photograph(photograph: Capture, grid: LensletGrid) -> Float32:
    """Estimate the relative illumination inside the micro-images from a photograph, for want of a white image.

    The mean of all micro-images is taken as the illumination of each; the fall-off of the main lens over the
    sensor cannot be told from the scene and stays in the picture.

    Parameters
    ----------
    photograph
        Raw frame of any scene.
    grid
        Its lenslet grid.

    Returns
    -------
    ``(H, W)`` float32, 1 = full light.
    """
    pitch = float(np.hypot(*grid.step_u_px))
    lattice = Lattice.of(grid)
    profile = mean_micro_image(flatten(photograph, pitch), lattice).brightness
    centre = profile.shape[0] // 2
    reach = int(0.3 * pitch * BINS_PER_PIXEL)
    inner = profile[centre - reach : centre + reach + 1, centre - reach : centre + reach + 1]
    profile = np.clip(profile / np.percentile(inner, 90), 0, None).astype(np.float32)
    spread: Float32 = _spread(profile, lattice.matrix, lattice.reciprocal, lattice.origin, *grid.sensor_shape)
    return spread


def devignette(mosaic: Float32, shading: Float32, floor: float) -> Float32:
    """Divide a linear mosaic by the relative illumination, in place; nothing is clipped.

    Parameters
    ----------
    mosaic
        ``(H, W)`` float32, 0 = black, 1 = the sensor's white level.
    shading
        ``(H, W)`` float32, 1 = full light.
    floor
        Least illumination divided by; darker places stay dark instead of amplifying noise.

    Raises
    ------
    AssetError
        If the two sizes differ.
    """
    if mosaic.shape != shading.shape:
        raise AssetError(
            f"white image: found {shading.shape[1]} x {shading.shape[0]} px, expected {mosaic.shape[1]} x "
            f"{mosaic.shape[0]} as the capture; give the white image of the same camera"
        )
    check_shape("mosaic", mosaic, (None, None))
    return np.asarray(cv2.divide(mosaic, cv2.max(shading, float(floor)), dst=mosaic), np.float32)


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _scale_sites(mosaic: Mosaic, black: Float32, scale: Float32, out: Float32) -> None:  # pragma: no cover
    """Fill ``out`` with the light above black, in each site's own unit, not below 0."""
    for y in range(mosaic.shape[0]):
        for x in range(mosaic.shape[1]):
            light = (np.float32(mosaic[y, x]) - black[y & 1, x & 1]) * scale[y & 1, x & 1]
            out[y, x] = max(light, np.float32(0.0))


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _spread(
    profile: Float32, matrix: Float64, reciprocal: Float64, origin: Float64, height: int, width: int
) -> Float32:  # pragma: no cover
    """Repeat a micro-image over the sensor: bilinear lookup at the offset from the nearest lattice point."""
    out = np.empty((height, width), np.float32)
    half = profile.shape[0] // 2
    for y in range(height):
        for x in range(width):
            qx, qy = x - origin[0], y - origin[1]
            i = reciprocal[0, 0] * qx + reciprocal[0, 1] * qy
            j = reciprocal[1, 0] * qx + reciprocal[1, 1] * qy
            i -= np.floor(i)
            j -= np.floor(j)
            best = 1e9
            bx, by = 0.0, 0.0
            for di in range(2):
                for dj in range(2):
                    ox = matrix[0, 0] * (i - di) + matrix[0, 1] * (j - dj)
                    oy = matrix[1, 0] * (i - di) + matrix[1, 1] * (j - dj)
                    if ox * ox + oy * oy < best:
                        best = ox * ox + oy * oy
                        bx, by = ox, oy
            fx, fy = bx * BINS_PER_PIXEL + half, by * BINS_PER_PIXEL + half
            left, top = int(fx), int(fy)
            wx, wy = fx - left, fy - top
            upper = (1 - wx) * profile[top, left] + wx * profile[top, left + 1]
            lower = (1 - wx) * profile[top + 1, left] + wx * profile[top + 1, left + 1]
            out[y, x] = (1 - wy) * upper + wy * lower
    return out
