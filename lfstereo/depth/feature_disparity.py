"""How far apart two views of a scene see the same features: whether they are rectified, and where to search."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float64, Rgb
from lfstereo.errors import QualityError, RigError
from lfstereo.lightfield.encoding import srgb8

LEAST_FEATURES = 20
LARGEST_ROW_PX = 1.5
"""Median distance of matched features from their common row, in rectified views."""
_RATIO = 0.7
_TAIL_PERCENT = 2.0
_MARGIN_SHARE = 0.15
_MARGIN_PX = 4.0


def feature_disparities(left: Rgb, right: Rgb) -> tuple[Float64, Float64]:
    """Match SIFT features of two views.

    Returns
    -------
    ``x_left - x_right`` and ``y_left - y_right``, ``(N,)`` px each.
    """
    sift = cv2.SIFT.create(4000)
    found = [sift.detectAndCompute(cv2.cvtColor(srgb8(view), cv2.COLOR_RGB2GRAY), None) for view in (left, right)]
    (points, words), (others, other_words) = found
    if words is None or other_words is None or min(len(points), len(others)) < 2:
        return np.empty(0), np.empty(0)
    pairs = [pair for pair in cv2.BFMatcher().knnMatch(words, other_words, k=2) if len(pair) == 2]
    back = {m.queryIdx: m.trainIdx for m in cv2.BFMatcher().match(other_words, words)}
    good = [a for a, b in pairs if a.distance < _RATIO * b.distance and back[a.trainIdx] == a.queryIdx]
    apart = np.array([np.subtract(points[m.queryIdx].pt, others[m.trainIdx].pt) for m in good]).reshape(-1, 2)
    return apart[:, 0], apart[:, 1]


def search_range(left: Rgb, right: Rgb, where: str) -> tuple[float, float]:
    """Return the smallest and the largest disparity (px) to search two rectified views for.

    Raises
    ------
    QualityError
        If too few features are in both views.
    RigError
        If features do not lie on common rows, or farther right in the right view.
    """
    across, down = feature_disparities(left, right)
    if len(across) < LEAST_FEATURES:
        raise QualityError(
            f"{where}: found {len(across)} features in both views, expected {LEAST_FEATURES} or more; "
            "give two sweeps of one scene"
        )
    off = float(np.median(np.abs(down)))
    if off > LARGEST_ROW_PX:
        raise RigError(
            f"{where}: the same features lie {off:.1f} px apart in height, expected {LARGEST_ROW_PX:g} at most in "
            "rectified views; give the cameras' geometry with --rig"
        )
    level = across[np.abs(down) <= 2 * LARGEST_ROW_PX]
    low, high = np.percentile(level, [_TAIL_PERCENT, 100 - _TAIL_PERCENT])
    if low < -_MARGIN_PX:
        raise RigError(
            f"{where}: features lie up to {-low:.1f} px farther right in the right view, expected farther left; swap "
            "the two sweeps, or give the cameras' geometry with --rig"
        )
    margin = max(_MARGIN_PX, _MARGIN_SHARE * float(high - low))
    return max(0.0, float(low) - margin), float(high) + margin
