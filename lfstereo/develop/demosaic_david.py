"""Demosaic of a lenslet image that respects the borders of the micro-images: David, Le Pendu and Guillemot 2017."""

from __future__ import annotations

from typing import TypeAlias

import cv2
import numba
import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Float32, Float64, Rgb
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.lattice import Lattice

IntArray: TypeAlias = npt.NDArray[np.int64]
_POWER = 10
"""Exponent of the illumination in a neighbour's weight."""
_LEAST = 1e-6


def david2017(mosaic: Float32, bayer: str, shading: Float32, grid: LensletGrid) -> Rgb:
    """Interpolate as Malvar does, each neighbour weighted by its light and left out if another lenslet's.

    Made for the rim of micro-images. Strong weights pull a value towards the micro-image's centre, so fine parallax
    suffers; ``micro-images`` does better at every slope.

    Parameters
    ----------
    mosaic
        ``(H, W)`` float32, devignetted and white balanced.
    bayer
        Colours of the top-left 2 x 2 sites row by row, such as ``"grbg"``.
    shading
        ``(H, W)`` float32 relative illumination of the pixels.
    grid
        The lenslet grid, which tells what pixel belongs to what lenslet.

    Returns
    -------
    ``(H, W, 3)`` linear RGB.

    References
    ----------
    David, Le Pendu, Guillemot, "White lenslet image guided demosaicing for plenoptic cameras" (MMSP 2017).
    Malvar, He, Cutler, "High-quality linear interpolation for demosaicing of Bayer-patterned color images"
    (ICASSP 2004): the gains 1/2, 5/8 and 3/4 of the corrections.
    """
    guide = np.minimum(cv2.GaussianBlur(shading, (3, 3), 0), 1) ** _POWER + np.float32(_LEAST)
    lattice = Lattice.of(grid)
    sites = np.array(["rgb".index(colour) for colour in bayer]).reshape(2, 2)
    lenslets = _nearest_lenslet(*mosaic.shape, lattice.matrix, lattice.reciprocal, lattice.origin)
    rgb: Rgb = np.empty((*mosaic.shape, 3), np.float32)
    _fill(mosaic, np.asarray(guide, np.float32), lenslets, sites, rgb)
    return rgb


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _nearest_lenslet(
    height: int, width: int, matrix: Float64, reciprocal: Float64, origin: Float64
) -> npt.NDArray[np.int32]:  # pragma: no cover
    """Return a number for each pixel, the same for all pixels nearest to one lattice point."""
    found = np.empty((height, width), np.int32)
    for y in range(height):
        for x in range(width):
            qx, qy = x - origin[0], y - origin[1]
            i = np.floor(reciprocal[0, 0] * qx + reciprocal[0, 1] * qy)
            j = np.floor(reciprocal[1, 0] * qx + reciprocal[1, 1] * qy)
            best = 1e30
            for di in range(2):
                for dj in range(2):
                    ox = qx - matrix[0, 0] * (i + di) - matrix[0, 1] * (j + dj)
                    oy = qy - matrix[1, 0] * (i + di) - matrix[1, 1] * (j + dj)
                    if ox * ox + oy * oy < best:
                        best = ox * ox + oy * oy
                        found[y, x] = int(i + di) * 4096 + int(j + dj)
    return found


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _mean(
    mosaic: Float32, guide: Float32, lenslets: npt.NDArray[np.int32], y: int, x: int, places: IntArray, own: float
) -> float:  # pragma: no cover
    """Return the weighted mean over places ``(n, 2)`` (dy, dx); ``own`` where all belong to other lenslets."""
    total, weights = 0.0, 0.0
    height, width = mosaic.shape
    for n in range(places.shape[0]):
        b, a = y + places[n, 0], x + places[n, 1]
        if b < 0 or a < 0 or b >= height or a >= width or lenslets[b, a] != lenslets[y, x]:
            continue
        total += guide[b, a] * mosaic[b, a]
        weights += guide[b, a]
    return total / weights if weights > 0 else own


_CROSS = np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])
_FAR = 2 * _CROSS
_DIAGONAL = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
_ROW, _COLUMN = _CROSS[2:].copy(), _CROSS[:2].copy()
_BY_ROW = np.concatenate([_DIAGONAL, 2 * _ROW])
_BY_COLUMN = np.concatenate([_DIAGONAL, 2 * _COLUMN])


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _fill(
    mosaic: Float32, guide: Float32, lenslets: npt.NDArray[np.int32], sites: IntArray, rgb: Rgb
) -> None:  # pragma: no cover
    for y in range(mosaic.shape[0]):
        for x in range(mosaic.shape[1]):
            own = sites[y & 1, x & 1]
            value = float(mosaic[y, x])
            rgb[y, x, own] = value
            if own == 1:
                for along in range(2):
                    near, around, across = (_ROW, _BY_ROW, _COLUMN) if along == 0 else (_COLUMN, _BY_COLUMN, _ROW)
                    colour = sites[y & 1, 1 - (x & 1)] if along == 0 else sites[1 - (y & 1), x & 1]
                    change = value - 1.2 * _mean(mosaic, guide, lenslets, y, x, around, value)
                    change += 0.2 * _mean(mosaic, guide, lenslets, y, x, 2 * across, value)
                    rgb[y, x, colour] = _mean(mosaic, guide, lenslets, y, x, near, value) + 0.625 * change
            else:
                change = value - _mean(mosaic, guide, lenslets, y, x, _FAR, value)
                rgb[y, x, 1] = _mean(mosaic, guide, lenslets, y, x, _CROSS, value) + 0.5 * change
                rgb[y, x, 2 - own] = _mean(mosaic, guide, lenslets, y, x, _DIAGONAL, value) + 0.75 * change
