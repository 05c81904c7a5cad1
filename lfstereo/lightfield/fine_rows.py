"""Weights for view pixels between the rows of lenslets: views finer than the lattice."""

from __future__ import annotations

import functools
from typing import Literal

import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.lightfield.hexagons import PITCH, kriging_weights

Interpolation = Literal["kriging", "barycentric"]

PHASES = 64
"""Steps from one lenslet of a row halfway to the next; the weights are linear in between."""
ROWS, COLUMNS = 4, 4
"""Lenslets used: the two nearest to either side in the row above the point, the next below, and one more each way."""


@functools.cache
def fine_weights(interpolation: Interpolation, upsampling: int) -> Float32:
    """Return the weights of sixteen lenslets around points between two rows.

    Parameters
    ----------
    interpolation
        ``kriging`` as :func:`lfstereo.lightfield.hexagons.hexagon_weights`, or ``barycentric`` in the triangle of
        lenslets around the point.
    upsampling
        View pixels per distance of rows.

    Returns
    -------
    ``(upsampling, 2, PHASES + 1, 16)`` float32 weights of sum 1, for points ``j / upsampling`` of a row's distance
    below a row, in the left or right half between two of its lenslets, and ``phase / PHASES`` of half a pitch from the
    beginning of that half. In order: the row above that row, the row, and the two below; in each from the second
    lenslet left of the point to the second to its right.

    References
    ----------
    Cho, Lee, Kim, Tai, "Modeling the calibration pipeline of the Lytro camera for high quality light-field image
    reconstruction" (ICCV 2013), section 4: barycentric interpolation of the hexagonal lattice.

    Examples
    --------
    >>> np.flatnonzero(fine_weights("barycentric", 2)[1, 1, 0]).tolist()  # the middle of an upright triangle
    [5, 6, 9]
    """
    table: Float32 = np.zeros((upsampling, 2, PHASES + 1, ROWS * COLUMNS), np.float32)
    for j, half in np.ndindex(upsampling, 2):
        right = 0.5 * (half + np.arange(PHASES + 1) / PHASES)
        if interpolation == "barycentric":
            table[j, half] = _barycentric(right, j / upsampling, half)
        else:
            targets = np.stack([right * PITCH, np.full_like(right, j / upsampling)], axis=1)
            table[j, half] = kriging_weights(_places(half) * (PITCH, 1.0), targets)
    return table


def _places(half: int) -> Float64:
    """Return where the sixteen lenslets lie, (pitches, rows), for points in the left or right half between two."""
    found = []
    for row in range(-1, ROWS - 1):
        beside = row % 2 == 1
        first = (half - 1 if beside else 0) - 1
        found += [(first + k + 0.5 * beside, float(row)) for k in range(COLUMNS)]
    return np.array(found)


def _barycentric(right: Float64, down: float, half: int) -> Float64:
    """Return the weights of the triangle's corners for points at a height between two rows."""
    weights = np.zeros((len(right), ROWS * COLUMNS))
    above, below = COLUMNS, 2 * COLUMNS
    for n, x in enumerate(right):
        # Lenslets of the row lie at 0 and 1 and are taps 1 and 2; those of the next row at -1/2, 1/2 and 3/2.
        middle = below + 2 - half
        corner = x - down / 2, 1 - down / 2 - x
        if min(corner) >= -1e-12:
            weights[n, above + 2], weights[n, above + 1], weights[n, middle] = *corner, down
        elif corner[0] < 0:
            weights[n, above + 1] = 1 - down
            weights[n, middle - 1], weights[n, middle] = -corner[0], down + corner[0]
        else:
            weights[n, above + 2] = 1 - down
            weights[n, middle], weights[n, middle + 1] = down + corner[1], -corner[1]
    return weights
