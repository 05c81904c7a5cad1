"""Min 2014: smooth a volume of scores slice by slice with the fast global smoother, along the edges of a picture."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32, Rgb
from lfstereo.lightfield.encoding import srgb8


def globally_smoothed_volume(volume: Float32, guide: Rgb, reach_px: float, edge_share: float) -> Float32:
    """Smooth every slice of a volume by weighted least squares.

    A pixel reaches its neighbours with a weight that falls as ``exp(-distance / reach)`` where the guide is even, and
    by ``exp(-change / edge)`` more across every step of its colour: the smoother of strength ``lambda`` solves
    ``(1 + lambda * Laplacian) x = volume``, whose answer to an impulse decays by a factor e in ``sqrt(lambda)`` px.

    Parameters
    ----------
    volume
        ``(K, V, U)``, a score per slice.
    guide
        ``(V, U, 3)`` linear RGB whose edges are kept.
    reach_px
        Distance over which neighbours are asked.
    edge_share
        Change of brightness, of white, at which the tie between neighbours falls to 1/e.

    References
    ----------
    Min, Choi, Lu, Ham, Sohn, Do, "Fast global image smoothing based on weighted least squares" (2014),
    equations 1 to 10.

    Examples
    --------
    What is even stays.

    >>> flat = np.full((1, 9, 9), 2.0, np.float32)
    >>> round(float(globally_smoothed_volume(flat, np.ones((9, 9, 3), np.float32), 3.0, 0.1)[0, 4, 4]), 4)
    2.0
    """
    smoother = cv2.ximgproc.createFastGlobalSmootherFilter(srgb8(guide), reach_px**2, 255 * edge_share)
    return np.stack([smoother.filter(slice_) for slice_ in volume]).astype(np.float32, copy=False)
