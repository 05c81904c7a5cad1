"""Keep clipped highlights neutral: a clipped colour is at least as bright as its neighbours."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32, Mosaic
from lfstereo.container.metadata import FrameMetadata
from lfstereo.lenslet.flatten import site_levels

_RAMP = (0.95, 0.99)
"""Raw level, of the white level, at which trust in a value begins to fade and ends."""


def lift_clipped(mosaic: Float32, raw: Mosaic, metadata: FrameMetadata) -> None:
    """Raise clipped sites of a white-balanced mosaic to the brightest site beside them, in place.

    Where green clips first, white balance would leave red and blue above it: pink highlights. A clipped value
    is a lower bound, so lifting it to the brightest of the 3 x 3 sites around it is consistent with what was
    measured and makes an area with all colours clipped neutral. The lift fades in over the last few per cent
    below clipping, so that no edge appears.

    Parameters
    ----------
    mosaic
        ``(H, W)`` float32, devignetted and white balanced.
    raw
        ``(H, W)`` uint16, the digital numbers it was made from.
    metadata
        Levels and Bayer order.
    """
    black, white = site_levels(metadata.black, metadata.bayer), site_levels(metadata.white, metadata.bayer)
    fade = np.zeros(raw.shape, np.float32)
    for y in (0, 1):
        for x in (0, 1):
            start = black[y][x] + _RAMP[0] * (white[y][x] - black[y][x])
            span = (_RAMP[1] - _RAMP[0]) * (white[y][x] - black[y][x])
            plane = raw[y::2, x::2]
            if int(plane.max()) > start:
                fade[y::2, x::2] = np.clip((plane.astype(np.float32) - np.float32(start)) / np.float32(span), 0, 1)
    if not fade.any():
        return
    brightest = cv2.dilate(mosaic, np.ones((3, 3), np.uint8))
    brightest -= mosaic
    brightest *= fade
    mosaic += brightest
