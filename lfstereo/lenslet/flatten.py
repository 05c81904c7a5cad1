"""Even out a raw frame so that only the micro-image pattern is left."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32
from lfstereo.container.capture import Capture
from lfstereo.container.metadata import Quad


def site_levels(levels: Quad, bayer: str) -> tuple[tuple[float, float], tuple[float, float]]:
    """Arrange one number per Bayer colour as the 2 x 2 sites of the mosaic.

    Parameters
    ----------
    levels
        Numbers for r, gr, gb, b.
    bayer
        Colours of the top-left 2 x 2 sites row by row, such as ``"grbg"``.

    Returns
    -------
    ``sites[y][x]``, the number that belongs to the pixels of that parity.

    Examples
    --------
    >>> site_levels((1.0, 2.0, 3.0, 4.0), "grbg")
    ((2.0, 1.0), (4.0, 3.0))
    """
    r, gr, gb, b = levels
    rows = []
    for y in (0, 1):
        pair = bayer[2 * y : 2 * y + 2]
        green = gr if "r" in pair else gb
        rows.append(tuple({"r": r, "g": green, "b": b}[colour] for colour in pair))
    return (rows[0][0], rows[0][1]), (rows[1][0], rows[1][1])


def flatten(capture: Capture, pitch_px: float) -> Float32:
    """Divide every Bayer site by the local mean of its own colour.

    What remains is the micro-image pattern, about 1 on average, free of the colour and of the brightness of
    the scene, of the Bayer pattern and of the main lens's fall-off.

    Parameters
    ----------
    capture
        White image or photograph.
    pitch_px
        Rough lenslet pitch in sensor px; the mean is taken over about two lenslets.

    Returns
    -------
    ``(H, W)`` float32; 1 = local mean of the site's colour; dark regions tend to 0.
    """
    mosaic, meta = capture.mosaic, capture.metadata
    black = site_levels(meta.black, meta.bayer)
    white = site_levels(meta.white, meta.bayer)
    flat = np.empty(mosaic.shape, np.float32)
    size = 2 * round(pitch_px / 2) + 1
    for y in (0, 1):
        for x in (0, 1):
            plane = mosaic[y::2, x::2].astype(np.float32) - np.float32(black[y][x])
            mean = cv2.blur(plane, (size, size), borderType=cv2.BORDER_REFLECT)
            mean = cv2.blur(mean, (size, size), borderType=cv2.BORDER_REFLECT)
            floor = np.float32(0.004 * (white[y][x] - black[y][x]))
            flat[y::2, x::2] = plane / np.maximum(mean, floor)
    return flat


def mean_brightness(capture: Capture) -> float:
    """Return the mean of a frame, 0 = black level, 1 = white level."""
    meta = capture.metadata
    black, white = site_levels(meta.black, meta.bayer), site_levels(meta.white, meta.bayer)
    shares = [
        (float(capture.mosaic[y::2, x::2].mean()) - black[y][x]) / (white[y][x] - black[y][x])
        for y in (0, 1)
        for x in (0, 1)
    ]
    return float(np.mean(shares))
