"""Find and repair single pixels that their neighbours contradict."""

from __future__ import annotations

from typing import TypeAlias

import numba
import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Bool, Float32, UInt16

Places: TypeAlias = npt.NDArray[np.intp]
_ISOLATED = 0.3
"""A detail of the scene reaches the pixels beside it: with this share of the contradiction there, it is one."""


def repair_hot_pixels(
    mosaic: Float32, shading: Float32, excess: float, noise: float, known: UInt16 | None = None
) -> int:
    """Replace hot and dead pixels by the median of their good neighbours of the same colour, in place.

    A pixel is replaced if it exceeds the largest of its eight neighbours of the same Bayer site by the factor
    ``1 + excess`` and, in the light that the sensor received, by ``noise``, while the four pixels beside it (of other
    colours) agree with the mean of their own; if it stays below the smallest of them in the same way; or if it is known
    to be bad. Colours are never mixed.

    Parameters
    ----------
    mosaic
        ``(H, W)`` float32 devignetted mosaic, 1 = white level.
    shading
        ``(H, W)`` float32 relative illumination that it was divided by: in dark places noise contradicts nothing.
    excess
        Relative distance from the neighbours' range.
    noise
        Absolute distance from the neighbours' range before the division, of the white level.
    known
        ``(N, 2)`` (x, y) places that are known to be bad; places beyond the mosaic are passed over.

    Returns
    -------
    Number of pixels replaced.

    Examples
    --------
    >>> frame = np.full((12, 12), 0.25, np.float32)
    >>> frame[4, 4] = 1.0
    >>> repair_hot_pixels(frame, np.ones_like(frame), excess=0.5, noise=0.05), float(frame[4, 4])
    (1, 0.25)
    """
    bad = _contradicted(mosaic, shading, np.float32(1 + excess), np.float32(noise))
    if known is not None:
        x, y = known[:, 0], known[:, 1]
        inside = (x < mosaic.shape[1]) & (y < mosaic.shape[0])
        bad[y[inside], x[inside]] = True
    rows, columns = np.nonzero(bad)
    mosaic[rows, columns] = _repaired(mosaic, bad, rows, columns)
    return int(rows.size)


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _contradicted(mosaic: Float32, shading: Float32, factor: float, noise: float) -> Bool:  # pragma: no cover
    """Mark pixels outside the range of their neighbours, alone with it."""
    height, width = mosaic.shape
    bad = np.zeros((height, width), np.bool_)
    for y in range(height):
        for x in range(width):
            value, beside = mosaic[y, x], mosaic[y, x - 2 if x > 1 else min(x + 2, width - 1)]
            if beside * factor >= value and value * factor >= beside:
                continue
            above, below = _beyond(mosaic, y, x)
            step = noise / max(shading[y, x], np.float32(1e-3))
            hot = value > (value - above) * factor and above > step
            dead = value * factor < value + below and below > step
            if not (hot or dead):
                continue
            alone = True
            for dy, dx in ((0, -1), (0, 1), (-1, 0), (1, 0)):
                if 0 <= y + dy < height and 0 <= x + dx < width:
                    apart = mosaic[y + dy, x + dx] - _mean_beside(mosaic, y + dy, x + dx)
                    alone = alone and (apart < _ISOLATED * above if hot else -apart < _ISOLATED * below)
            bad[y, x] = alone
    return bad


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _beyond(mosaic: Float32, y: int, x: int) -> tuple[float, float]:  # pragma: no cover
    """Return by how much a pixel exceeds the largest of its eight neighbours, and falls short of the smallest.

    Beyond the border the mosaic is mirrored.
    """
    height, width = mosaic.shape
    low, high = np.float32(np.inf), np.float32(-np.inf)
    for dy in range(-2, 3, 2):
        for dx in range(-2, 3, 2):
            if dx != 0 or dy != 0:
                b = y + dy if 0 <= y + dy < height else y - dy
                a = x + dx if 0 <= x + dx < width else x - dx
                low, high = min(low, mosaic[b, a]), max(high, mosaic[b, a])
    return mosaic[y, x] - high, low - mosaic[y, x]


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _mean_beside(mosaic: Float32, y: int, x: int) -> float:  # pragma: no cover
    """Return the mean of the eight neighbours of the same site."""
    height, width = mosaic.shape
    total = 0.0
    for dy in range(-2, 3, 2):
        for dx in range(-2, 3, 2):
            if dx != 0 or dy != 0:
                b = y + dy if 0 <= y + dy < height else y - dy
                a = x + dx if 0 <= x + dx < width else x - dx
                total += mosaic[b, a]
    return total / 8


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _repaired(mosaic: Float32, bad: Bool, rows: Places, columns: Places) -> Float32:  # pragma: no cover
    """Return the median of the good neighbours of each place; without any, what is there."""
    height, width = mosaic.shape
    values = np.empty(rows.size, np.float32)
    for n in range(rows.size):
        good, count = np.empty(8, np.float32), 0
        for dy in range(-2, 3, 2):
            for dx in range(-2, 3, 2):
                b, a = rows[n] + dy, columns[n] + dx
                if (dy or dx) and 0 <= b < height and 0 <= a < width and not bad[b, a]:
                    good[count] = mosaic[b, a]
                    count += 1
        values[n] = np.median(good[:count]) if count else mosaic[rows[n], columns[n]]
    return values
