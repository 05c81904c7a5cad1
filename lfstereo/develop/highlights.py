"""Keep clipped highlights neutral: a clipped colour is at least as bright as it was read, and white is the guess."""

from __future__ import annotations

from typing import TypeAlias

import numba
import numpy as np
import numpy.typing as npt

from lfstereo.arrays import Float32, Float64, Mosaic
from lfstereo.container.metadata import FrameMetadata, Quad
from lfstereo.lenslet.flatten import site_levels

IntArray: TypeAlias = npt.NDArray[np.int64]
_RAMP = (0.95, 0.99)
"""Raw level, of the white level, at which trust in a value begins to fade and ends."""
_NEUTRAL = (0.4, 0.85)
"""Darkest colour beside a clipped site, of the level at which the first colour clips: below the first number the light
is taken for coloured, from the second on for white."""


def lift_clipped(mosaic: Float32, raw: Mosaic, metadata: FrameMetadata, gains: Quad) -> None:
    """Raise clipped sites of a white-balanced mosaic towards the brightest colour beside them, in place.

    Where green clips first, white balance would leave red and blue above it: pink highlights. A clipped value is a
    lower bound; it is lifted to the brightest of the three colours in the 3 x 3 sites around it (means of each), by
    as much as the darkest of the three nears the level at which the first colour clips. So an area with all colours
    clipped becomes white, a grey ramp stays grey as one colour after the other clips, and a lamp of a strong colour
    keeps it. The lift fades in over the last few per cent below clipping, so that no edge appears.

    Clipped values that were divided by the fall-off of the micro-image rise steeply towards its rim and say nothing
    there; each is taken at the level of the best lit of the clipped sites beside it.

    Parameters
    ----------
    mosaic
        ``(H, W)`` float32, devignetted and white balanced.
    raw
        ``(H, W)`` uint16, the digital numbers it was made from.
    metadata
        Levels and Bayer order.
    gains
        Gains of r, gr, gb, b that the white balance applied.
    """
    black = np.array(site_levels(metadata.black, metadata.bayer))
    span = np.array(site_levels(metadata.white, metadata.bayer)) - black
    colours = np.array(["rgb".index(colour) for colour in metadata.bayer]).reshape(2, 2)
    clips_at = np.array(site_levels(gains, metadata.bayer)) / min(gains)
    _lift(mosaic, raw, black + _RAMP[0] * span, (_RAMP[1] - _RAMP[0]) * span, clips_at, colours)


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _lift(
    mosaic: Float32, raw: Mosaic, start: Float64, ramp: Float64, clips_at: Float64, colours: IntArray
) -> None:  # pragma: no cover
    """Compute each row from untouched neighbours: a row is written back when the next one has been computed."""
    height, width = raw.shape
    rows = np.empty((2, width), np.float32)
    changed = np.zeros(2, np.bool_)
    for y in range(height + 1):
        if y < height:
            changed[y & 1] = False
            for x in range(width):
                if raw[y, x] <= start[y & 1, x & 1]:
                    continue
                if not changed[y & 1]:
                    changed[y & 1] = True
                    rows[y & 1] = mosaic[y]
                fade = min(1.0, (raw[y, x] - start[y & 1, x & 1]) / ramp[y & 1, x & 1])
                lifted = _lifted(mosaic, raw, y, x, start, ramp, clips_at, colours)
                rows[y & 1, x] += fade * (lifted - mosaic[y, x])
        if y > 0 and changed[(y - 1) & 1]:
            mosaic[y - 1] = rows[(y - 1) & 1]


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _lifted(
    mosaic: Float32, raw: Mosaic, y: int, x: int, start: Float64, ramp: Float64, clips_at: Float64, colours: IntArray
) -> float:  # pragma: no cover
    """Return what a clipped site shows, were the light as white as the colours beside it allow.

    ``first`` is the level at which the first colour clips here, ``first * clips_at`` that of every colour.
    """
    top, bottom = max(y - 1, 0), min(y + 2, mosaic.shape[0])
    left, right = max(x - 1, 0), min(x + 2, mosaic.shape[1])
    first = mosaic[y, x] / clips_at[y & 1, x & 1]
    for b in range(top, bottom):
        for a in range(left, right):
            if raw[b, a] >= start[b & 1, a & 1] + ramp[b & 1, a & 1]:
                first = min(first, mosaic[b, a] / clips_at[b & 1, a & 1])
    if first <= 0:  # a stuck pixel, filled in from dark ones beside it
        return float(mosaic[y, x])
    total, count = np.zeros(3), np.zeros(3)
    for b in range(top, bottom):
        for a in range(left, right):
            fade = min(max((raw[b, a] - start[b & 1, a & 1]) / ramp[b & 1, a & 1], 0.0), 1.0)
            colour = colours[b & 1, a & 1]
            total[colour] += (1 - fade) * mosaic[b, a] + fade * first * clips_at[b & 1, a & 1]
            count[colour] += 1
    own = first * clips_at[y & 1, x & 1]
    brightest, darkest = own, own
    for colour in range(3):
        if colour != colours[y & 1, x & 1] and count[colour] > 0:
            mean = total[colour] / count[colour]
            brightest, darkest = max(brightest, mean), min(darkest, mean)
    share = min(max((darkest / first - _NEUTRAL[0]) / (_NEUTRAL[1] - _NEUTRAL[0]), 0.0), 1.0)
    return float(own + share * share * (3 - 2 * share) * (brightest - own))
