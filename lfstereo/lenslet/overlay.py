"""Draw a fitted grid over the raw frame, to see at a glance whether it fits."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import UInt8
from lfstereo.container.capture import Capture
from lfstereo.lenslet.grid import LensletGrid

_CENTRE_COLOUR = (255, 40, 40)


def draw_grid(capture: Capture, grid: LensletGrid, size_px: int = 60, zoom: int = 5) -> UInt8:
    """Draw the lenslet centres over crops of the raw frame from its corners and its centre.

    Parameters
    ----------
    capture
        White image or photograph.
    grid
        Its lenslet grid.
    size_px
        Width and height of each of the five crops, sensor px.
    zoom
        Enlargement.

    Returns
    -------
    ``(h, w, 3)`` uint8 picture, the five crops side by side: top left, top right, centre, bottom left, right.
    """
    height, width = capture.mosaic.shape
    size = min(size_px, height, width)
    right, bottom = width - size, height - size
    corners = [(0, 0), (right, 0), (right // 2, bottom // 2), (0, bottom), (right, bottom)]
    centres = grid.centres().reshape(-1, 2)
    crops = []
    for left, top in corners:
        part = capture.mosaic[top : top + size, left : left + size].astype(np.float32)
        low, high = np.percentile(part, [1, 99])
        grey = np.clip((part - low) / max(float(high - low), 1.0) * 255, 0, 255).astype(np.uint8)
        enlarged = cv2.resize(grey, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_NEAREST)
        picture = np.repeat(enlarged[..., None], 3, axis=2)
        near = centres[((centres >= (left, top)) & (centres < (left + size, top + size))).all(1)]
        for x, y in near:
            spot = (round((x - left + 0.5) * zoom), round((y - top + 0.5) * zoom))
            cv2.drawMarker(picture, spot, _CENTRE_COLOUR, cv2.MARKER_CROSS, zoom + 2, 1)
        crops.append(np.pad(picture, ((0, 0), (0, 4), (0, 0))))
    return np.concatenate(crops, axis=1)
