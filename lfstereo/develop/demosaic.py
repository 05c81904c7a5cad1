"""From one colour per pixel to three: the published methods, by name."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from lfstereo.arrays import Float32, Rgb
from lfstereo.develop.demosaic_menon import menon2007
from lfstereo.develop.options import DemosaicMethod

_GREEN = np.array([[0, 0, -1, 0, 0], [0, 0, 2, 0, 0], [-1, 2, 4, 2, -1], [0, 0, 2, 0, 0], [0, 0, -1, 0, 0]]) / 8
_ALONG_ROW = (
    np.array([[0, 0, 0.5, 0, 0], [0, -1, 0, -1, 0], [-1, 4, 5, 4, -1], [0, -1, 0, -1, 0], [0, 0, 0.5, 0, 0]]) / 8
)
_DIAGONAL = (
    np.array([[0, 0, -1.5, 0, 0], [0, 2, 0, 2, 0], [-1.5, 0, 6, 0, -1.5], [0, 2, 0, 2, 0], [0, 0, -1.5, 0, 0]]) / 8
)


def malvar2004(mosaic: Float32, bayer: str) -> Rgb:
    """Interpolate linearly with a correction by the gradient of the colour that is known.

    Parameters
    ----------
    mosaic
        ``(H, W)`` float32, white balanced.
    bayer
        Colours of the top-left 2 x 2 sites row by row, such as ``"grbg"``.

    Returns
    -------
    ``(H, W, 3)`` linear RGB; may leave the range of the mosaic a little at edges.

    References
    ----------
    Malvar, He, Cutler, "High-quality linear interpolation for demosaicing of Bayer-patterned color images"
    (ICASSP 2004), figure 2.

    Examples
    --------
    >>> malvar2004(np.full((8, 8), 0.25, np.float32), "grbg")[4, 4].tolist()
    [0.25, 0.25, 0.25]
    """
    return _by_filters(mosaic, bayer, _GREEN, _ALONG_ROW, _ALONG_ROW.T, _DIAGONAL)


def bilinear(mosaic: Float32, bayer: str) -> Rgb:
    """Average the nearest neighbours of each missing colour.

    Parameters
    ----------
    mosaic
        ``(H, W)`` float32.
    bayer
        Colours of the top-left 2 x 2 sites row by row.

    Examples
    --------
    >>> bilinear(np.full((8, 8), 0.25, np.float32), "grbg")[4, 4].tolist()
    [0.25, 0.25, 0.25]
    """
    cross, row = np.zeros((5, 5)), np.zeros((5, 5))
    cross[1, 2] = cross[3, 2] = cross[2, 1] = cross[2, 3] = 0.25
    row[2, 1] = row[2, 3] = 0.5
    corners = np.zeros((5, 5))
    corners[1:4:2, 1:4:2] = 0.25
    return _by_filters(mosaic, bayer, cross, row, row.T, corners)


def opencv_edge_aware(mosaic: Float32, bayer: str) -> Rgb:
    """Interpolate along edges with OpenCV, on 16 bits; values below 0 become 0.

    Parameters
    ----------
    mosaic
        ``(H, W)`` float32, white balanced.
    bayer
        Colours of the top-left 2 x 2 sites row by row.

    References
    ----------
    OpenCV, ``cv2.demosaicing`` with ``COLOR_Bayer*_EA``. Its names tell the sites from the second row and column on.

    Examples
    --------
    >>> opencv_edge_aware(np.full((8, 8), 0.25, np.float32), "grbg")[4, 4].tolist()
    [0.25, 0.25, 0.25]
    """
    peak = max(float(mosaic.max()), 1e-6)
    codes = np.rint(np.maximum(mosaic, 0) * np.float32(65535 / peak)).astype(np.uint16)
    code = getattr(cv2, f"COLOR_Bayer{_OPENCV[bayer]}2RGB_EA")
    return np.asarray(cv2.demosaicing(codes, code).astype(np.float32) * np.float32(peak / 65535), np.float32)


_OPENCV = {"rggb": "BG", "grbg": "GB", "bggr": "RG", "gbrg": "GR"}

DEMOSAIC: dict[DemosaicMethod, Callable[[Float32, str], Rgb]] = {
    # Views are read from the micro-images' own samples; a picture of the whole mosaic is Malvar's.
    "micro-images": malvar2004,
    "malvar2004": malvar2004,
    "menon2007": menon2007,
    "bilinear": bilinear,
    "opencv-edge-aware": opencv_edge_aware,
}


def _by_filters(
    mosaic: Float32,
    bayer: str,
    green: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
    along_row: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
    along_column: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
    diagonal: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
) -> Rgb:
    """Fill in each missing colour with the filter for its place among the sites.

    ``along_row`` estimates a colour whose known sites lie left and right, ``along_column`` above and below,
    ``diagonal`` on the diagonals.
    """
    rgb = np.empty((*mosaic.shape, 3), np.float32)
    channel = {"r": 0, "g": 1, "b": 2}
    sites = {(y, x): channel[bayer[2 * y + x]] for y in (0, 1) for x in (0, 1)}
    for (y, x), own in sites.items():
        rgb[y::2, x::2, own] = mosaic[y::2, x::2]
    kernels = {"green": green, "row": along_row, "column": along_column, "diagonal": diagonal}
    for name, kernel in kernels.items():
        filtered = cv2.filter2D(mosaic, cv2.CV_32F, kernel.astype(np.float32), borderType=cv2.BORDER_REFLECT_101)
        for (y, x), own in sites.items():
            missing = _filled_by(name, own, sites[(y, 1 - x)])
            if missing is not None:
                rgb[y::2, x::2, missing] = filtered[y::2, x::2]
    return rgb


def _filled_by(kernel: str, own: int, row_neighbour: int) -> int | None:
    """Return the channel that a kernel fills in at a site of colour ``own``, if any."""
    if own == 1:
        return {"row": row_neighbour, "column": 2 - row_neighbour}.get(kernel)
    return {"green": 1, "diagonal": 2 - own}.get(kernel)
