"""Features of two views tell the range of disparities, and whether the views are rectified."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from lfstereo.depth.feature_disparity import feature_disparities, search_range
from lfstereo.errors import QualityError, RigError

FEATURE_PX = 0.2


def views(near_px: float, far_px: float, down_px: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A wall whose upper half is farther than its lower one."""
    rng = np.random.default_rng(0)
    wide = np.clip(0.5 + 3 * (cv2.GaussianBlur(rng.random((200, 400, 3)), (0, 0), 2.0) - 0.5), 0, 1)
    wide = wide.astype(np.float32)
    halves = []
    for disparity in (far_px, near_px):
        move = np.array([[1, 0, 60 + disparity], [0, 1, down_px]])
        halves.append(cv2.warpAffine(wide, move, (280, 200), flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP))
    return wide[:, 60:340].copy(), np.vstack([halves[0][:100], halves[1][100:]])


def test_range_holds_both_halves() -> None:
    left, right = views(22.0, 7.0)
    across, down = feature_disparities(left, right)
    assert np.min(np.abs(np.percentile(across, 90) - 22)) < FEATURE_PX
    assert np.min(np.abs(np.percentile(across, 10) - 7)) < FEATURE_PX
    assert np.median(np.abs(down)) < FEATURE_PX
    low, high = search_range(left, right, "pair")
    assert 0 <= low < 7 and 22 < high < 32


def test_refuses_views_that_are_not_rectified() -> None:
    with pytest.raises(RigError, match=r"pair: the same features lie 3.\d px apart in height"):
        search_range(*views(22.0, 7.0, 3.5), "pair")
    with pytest.raises(RigError, match=r"farther right in the right view, expected farther left; swap"):
        search_range(*views(22.0, 7.0)[::-1], "pair")


def test_refuses_views_of_different_scenes() -> None:
    left = views(22.0, 7.0)[0]
    with pytest.raises(QualityError, match=r"pair: found \d+ features in both views, expected 20 or more"):
        search_range(left, np.full_like(left, 0.5), "pair")
