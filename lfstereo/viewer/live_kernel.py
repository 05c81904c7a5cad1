"""Compiled inner loop of live refocusing, at a slope that may change over the picture.

Inside a tile of a few px the slope is taken as constant. The views of one row of the grid are then summed with two
taps each, and the sum is moved up or down once for the whole row.
"""

from __future__ import annotations

import numba
import numpy as np

from lfstereo.arrays import Float32, UInt8
from lfstereo.focus.shift_kernels import compiled

TILE_ROWS, FEWEST_COLUMNS = 8, 64
LARGEST_CHANGE = 0.1
"""Of the slope over the width of a tile; a plane that is not tilted sideways has tiles as wide as the picture."""


@compiled()
def _add_row(total: Float32, row: UInt8, first: int, part: float, gain: float) -> None:
    """Add the squares of ``row``, from ``first`` on, interpolated at the fraction ``part`` of a px."""
    near, far = np.float32(gain * (1.0 - part)), np.float32(gain * part)
    here, beside = row[first : first + total.shape[0]], row[first + 3 : first + 3 + total.shape[0]]
    for x in range(total.shape[0]):
        a, b = np.float32(here[x]), np.float32(beside[x])
        total[x] += near * a * a + far * b * b


@compiled(parallel=True)
def refocus_codes(
    codes: UInt8,
    places: Float32,
    gains: Float32,
    rows_of_views: UInt8,
    border: int,
    plane: tuple[float, float, float],
    picture: Float32,
) -> None:
    """Fill ``picture (V, U, 3)`` with the weighted mean of squared codes.

    Parameters
    ----------
    codes
        ``(N, V + 2 border, (U + 2 border) * 3)`` views, those of one grid row one after another.
    places
        ``(N, 2)`` (s, t) of each view from the centre.
    gains
        ``(N,)`` weights that sum to 1.
    rows_of_views
        ``(N,)`` 1 where a new row of the grid begins.
    border
        Px added on every side of the views.
    plane
        Slope at px (0, 0), and what it gains per px to the right and downwards.
    picture
        To be filled.
    """
    rows, columns = picture.shape[:2]
    tile_columns = columns
    if abs(plane[1]) * columns > LARGEST_CHANGE:
        tile_columns = max(FEWEST_COLUMNS, int(LARGEST_CHANGE / abs(plane[1])))
    for band in numba.prange((rows + TILE_ROWS - 1) // TILE_ROWS):
        top = band * TILE_ROWS
        tall = min(TILE_ROWS, rows - top)
        sums = np.empty((TILE_ROWS + 1, tile_columns * 3), np.float32)
        for left in range(0, columns, tile_columns):
            wide = min(tile_columns, columns - left)
            slope = plane[0] + plane[1] * (left + 0.5 * (wide - 1)) + plane[2] * (top + 0.5 * (tall - 1))
            tile = picture[top : top + tall, left : left + wide]
            tile[:] = 0
            for n in range(codes.shape[0]):
                down = top + border - slope * places[n, 1]
                above = int(np.floor(down))
                if rows_of_views[n]:
                    sums[:] = 0
                if gains[n] > 0:
                    across = left + border - slope * places[n, 0]
                    column = int(np.floor(across))
                    for r in range(tall + 1):
                        _add_row(sums[r, : wide * 3], codes[n, above + r], column * 3, across - column, gains[n])
                if n + 1 == codes.shape[0] or rows_of_views[n + 1]:
                    lower = np.float32(down - above)
                    for r in range(tall):
                        for u in range(wide):
                            for c in range(3):
                                value = (np.float32(1.0) - lower) * sums[r, 3 * u + c] + lower * sums[r + 1, 3 * u + c]
                                tile[r, u, c] += value
