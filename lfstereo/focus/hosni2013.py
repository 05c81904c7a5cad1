"""Hosni 2013: smooth a volume of scores slice by slice with the guided filter, along the edges of a picture."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32, Rgb


def guided_volume(volume: Float32, guide: Rgb, radius_px: int, edge_share: float) -> Float32:
    """Average every slice of a volume over neighbours of like colour.

    Parameters
    ----------
    volume
        ``(K, V, U)``, a score per slice.
    guide
        ``(V, U, 3)`` linear RGB whose edges are kept.
    radius_px
        Half the side of the windows.
    edge_share
        Change of brightness, of white, across which neighbours are not asked.

    References
    ----------
    Hosni, Rhemann, Bleyer, Rother, Gelautz, "Fast cost-volume filtering for visual correspondence and beyond" (2013);
    He, Sun, Tang, "Guided image filtering" (2010), equations 5 to 8.

    Examples
    --------
    What is even stays.

    >>> flat = np.full((1, 9, 9), 2.0, np.float32)
    >>> round(float(guided_volume(flat, np.ones((9, 9, 3), np.float32), 2, 0.1)[0, 4, 4]), 4)
    2.0
    """
    smoother = cv2.ximgproc.createGuidedFilter(np.sqrt(np.clip(guide, 0.0, 1.0)), radius_px, edge_share)
    return np.stack([smoother.filter(slice_) for slice_ in volume]).astype(np.float32, copy=False)
