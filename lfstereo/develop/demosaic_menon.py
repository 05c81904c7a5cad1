"""Demosaic with a choice of direction: Menon, Andriani and Calvagno 2007."""

from __future__ import annotations

from typing import TypeAlias

import cv2
import numba
import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Float32, Rgb

IntArray: TypeAlias = npt.NDArray[np.int64]
_GREEN = np.array([-0.25, 0.5, 0.5, 0.5, -0.25], np.float32)


def menon2007(mosaic: Float32, bayer: str) -> Rgb:
    """Interpolate green along rows and along columns and keep, per site, the direction of the smoother colours.

    Red and blue follow from their differences to green, along the chosen direction where there are two.

    Parameters
    ----------
    mosaic
        ``(H, W)`` float32, white balanced.
    bayer
        Colours of the top-left 2 x 2 sites row by row, such as ``"grbg"``.

    Returns
    -------
    ``(H, W, 3)`` linear RGB.

    References
    ----------
    Menon, Andriani, Calvagno, "Demosaicing with directional filtering and a posteriori decision" (IEEE TIP 2007),
    sections II and III; without the refining step of section IV.

    Examples
    --------
    >>> menon2007(np.full((12, 12), 0.25, np.float32), "grbg")[6, 6].tolist()
    [0.25, 0.25, 0.25]
    """
    sites = np.array(["rgb".index(colour) for colour in bayer]).reshape(2, 2)
    one = np.ones(1, np.float32)
    green_h = cv2.sepFilter2D(mosaic, cv2.CV_32F, _GREEN, one, borderType=cv2.BORDER_REFLECT_101)
    green_v = cv2.sepFilter2D(mosaic, cv2.CV_32F, one, _GREEN, borderType=cv2.BORDER_REFLECT_101)
    for y in (0, 1):
        for x in (0, 1):
            if sites[y, x] == 1:
                green_h[y::2, x::2] = green_v[y::2, x::2] = mosaic[y::2, x::2]
    rgb: Rgb = np.empty((*mosaic.shape, 3), np.float32)
    is_vertical = _roughness(mosaic - green_h, down=False) > _roughness(mosaic - green_v, down=True)
    rgb[..., 1] = np.where(is_vertical, green_v, green_h)
    _fill(mosaic, is_vertical, sites, rgb)
    return rgb


def _roughness(chroma: Float32, down: bool) -> Float32:
    """Return the sum of the changes of colour over two px to the right, or down, in the 5 x 5 px about each pixel.

    Those of the pixel's own Bayer sites count three times (section III, figure 6).
    """
    kernel = np.array([0, 0, -1, 0, 1], np.float32)
    one = np.ones(1, np.float32)
    along_x, along_y = (one, kernel) if down else (kernel, one)
    changes = np.abs(cv2.sepFilter2D(chroma, cv2.CV_32F, along_x, along_y, borderType=cv2.BORDER_REFLECT_101))
    window = np.zeros((5, 5), np.float32)
    window[::2, :3:2], window[1::2, 1] = (1, 1), 1
    window[2, :3:2] = 3
    window = window.T if down else window
    return np.asarray(cv2.filter2D(changes, cv2.CV_32F, np.ascontiguousarray(window)), np.float32)


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _fill(mosaic: Float32, vertical: npt.NDArray[np.bool_], sites: IntArray, rgb: Rgb) -> None:  # pragma: no cover
    """Fill in red and blue: at green from the two neighbours of the colour, then at each other's sites."""
    height, width = mosaic.shape
    for y in range(height):
        for x in range(width):
            own = sites[y & 1, x & 1]
            if own != 1:
                rgb[y, x, own] = mosaic[y, x]
                continue
            left, right = (x - 1 if x > 0 else x + 1), (x + 1 if x + 1 < width else x - 1)
            above, below = (y - 1 if y > 0 else y + 1), (y + 1 if y + 1 < height else y - 1)
            beside = mosaic[y, left] - rgb[y, left, 1] + mosaic[y, right] - rgb[y, right, 1]
            rgb[y, x, sites[y & 1, 1 - (x & 1)]] = rgb[y, x, 1] + 0.5 * beside
            beside = mosaic[above, x] - rgb[above, x, 1] + mosaic[below, x] - rgb[below, x, 1]
            rgb[y, x, sites[1 - (y & 1), x & 1]] = rgb[y, x, 1] + 0.5 * beside
    for y in range(height):
        for x in range(width):
            own = sites[y & 1, x & 1]
            if own == 1:
                continue
            other = 2 - own
            if vertical[y, x]:
                b, d = (y - 1 if y > 0 else y + 1), (y + 1 if y + 1 < height else y - 1)
                change = rgb[b, x, other] - rgb[b, x, own] + rgb[d, x, other] - rgb[d, x, own]
            else:
                a, c = (x - 1 if x > 0 else x + 1), (x + 1 if x + 1 < width else x - 1)
                change = rgb[y, a, other] - rgb[y, a, own] + rgb[y, c, other] - rgb[y, c, own]
            rgb[y, x, other] = rgb[y, x, own] + 0.5 * change
