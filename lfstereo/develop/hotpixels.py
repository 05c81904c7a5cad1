"""Find and repair single pixels that their neighbours of the same colour contradict."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32


def repair_hot_pixels(mosaic: Float32, excess: float, noise: float) -> int:
    """Replace hot and dead pixels by the median of their same-colour neighbours, in place.

    A pixel is replaced if it exceeds the largest of its eight neighbours of the same Bayer site by the factor
    ``1 + excess`` and by ``noise``, or stays below the smallest of them in the same way. Colours are never
    mixed, and the brightest or darkest pixel of an ordinary edge is left alone.

    Parameters
    ----------
    mosaic
        ``(H, W)`` float32 devignetted mosaic, 1 = white level.
    excess
        Relative distance from the neighbours' range.
    noise
        Absolute distance from the neighbours' range, of the white level.

    Returns
    -------
    Number of pixels replaced.

    Examples
    --------
    >>> frame = np.full((12, 12), 0.25, np.float32)
    >>> frame[4, 4] = 1.0
    >>> repair_hot_pixels(frame, excess=0.5, noise=0.05), float(frame[4, 4])
    (1, 0.25)
    """
    ring = np.ones((3, 3), np.uint8)
    ring[1, 1] = 0
    replaced = 0
    for y in (0, 1):
        for x in (0, 1):
            plane = np.ascontiguousarray(mosaic[y::2, x::2])
            highest = cv2.dilate(plane, ring, borderType=cv2.BORDER_REFLECT_101)
            lowest = cv2.erode(plane, ring, borderType=cv2.BORDER_REFLECT_101)
            hot = plane > np.maximum(highest * (1 + excess), highest + noise)
            dead = plane < np.minimum(lowest / (1 + excess), lowest - noise)
            odd_y, odd_x = np.nonzero(hot | dead)
            if odd_y.size:
                around = cv2.medianBlur(plane, 3)
                mosaic[2 * odd_y + y, 2 * odd_x + x] = around[odd_y, odd_x]
                replaced += odd_y.size
    return replaced
