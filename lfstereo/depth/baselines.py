"""What a user without a network would run: semi-global matching of the two centre views, with OpenCV."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from lfstereo.arrays import Bool, Disparity, Float32, Rgb, UInt8
from lfstereo.depth.disparity import DisparityMap
from lfstereo.errors import ConfigError, ShapeError
from lfstereo.lightfield.encoding import srgb8
from lfstereo.options import option

_STEPS_PER_PX = 16.0
"""OpenCV gives disparity in sixteenths of a px."""


@dataclass(frozen=True, slots=True)
class BaselineOptions:
    """Settings of semi-global matching and of the filter behind it."""

    block_px: int = option(3, "side of the matched block, odd", "px")
    wls_lambda: float = option(8000.0, "smoothness of the weighted least squares filter")
    wls_sigma: float = option(1.5, "colour difference at which smoothing stops")


def sgbm(
    left: Rgb, right: Rgb, d_max: float, d_min: float = 0.0, options: BaselineOptions = BaselineOptions()
) -> DisparityMap:
    """Match two rectified views by semi-global matching; pixels that fail its checks are not valid.

    Parameters
    ----------
    left, right
        ``(V, U, 3)`` linear RGB of the rectified centre views.
    d_max, d_min
        Disparities (px) to search between.
    options
        Settings of the matcher.

    Raises
    ------
    ShapeError
        If the two are not RGB pictures of one size.
    ConfigError
        If ``d_max`` is not above ``d_min``, this is below 0, or a setting is not possible.

    References
    ----------
    Hirschmüller, "Stereo processing by semiglobal matching and mutual information" (2008), as OpenCV's StereoSGBM.
    """
    coded_left, coded_right = _padded(left, right, d_max, d_min)
    matcher = _matcher(d_max, d_min, options)
    matcher.setUniquenessRatio(10)
    matcher.setDisp12MaxDiff(1)
    matcher.setSpeckleWindowSize(100)
    matcher.setSpeckleRange(2)
    matched = _cropped(matcher.compute(coded_left, coded_right), left) / np.float32(_STEPS_PER_PX)
    valid = matched >= int(np.floor(d_min))
    valid[:, -(options.block_px // 2 + 1) :] = (
        False  # where blocks leave the picture OpenCV favours the lowest disparity
    )
    return _as_map(matched, valid, left)


def sgbm_wls(
    left: Rgb, right: Rgb, d_max: float, d_min: float = 0.0, options: BaselineOptions = BaselineOptions()
) -> DisparityMap:
    """Match two rectified views by semi-global matching and smooth the result along the left view's edges.

    Parameters
    ----------
    left, right
        ``(V, U, 3)`` linear RGB of the rectified centre views.
    d_max, d_min
        Disparities (px) to search between.
    options
        Settings of the matcher and the filter.

    Raises
    ------
    ShapeError
        If the two are not RGB pictures of one size.
    ConfigError
        If ``d_max`` is not above ``d_min``, this is below 0, or a setting is not possible.

    References
    ----------
    Min, Choi, Lu, Ham, Sohn, Do, "Fast global image smoothing based on weighted least squares" (2014), as
    OpenCV's DisparityWLSFilter.
    """
    coded_left, coded_right = _padded(left, right, d_max, d_min)
    matcher = _matcher(d_max, d_min, options)
    smoother = cv2.ximgproc.createDisparityWLSFilter(matcher)
    smoother.setLambda(options.wls_lambda)
    smoother.setSigmaColor(options.wls_sigma)
    from_left = matcher.compute(coded_left, coded_right)
    from_right = cv2.ximgproc.createRightMatcher(matcher).compute(coded_right, coded_left)
    smoothed = smoother.filter(from_left, coded_left, disparity_map_right=from_right)
    matched = _cropped(smoothed, left) / np.float32(_STEPS_PER_PX)
    return _as_map(matched, matched >= int(np.floor(d_min)), left)


def fill_from_background(found: DisparityMap) -> DisparityMap:
    """Give every pixel that is not valid the smaller of the nearest valid disparities to its left and right.

    Pixels without a match are mostly those that a nearer object hides from the right camera, so they belong to
    what lies behind. Rows without any valid pixel take the nearest row above, or else below, that has some.

    Raises
    ------
    ShapeError
        If no pixel is valid.

    Examples
    --------
    >>> valid = np.array([[True, False, False, True]])
    >>> row = DisparityMap(np.float32([[9, 0, 0, 4]]), valid, np.zeros((1, 4, 3), np.float32))
    >>> fill_from_background(row).disparity.tolist()
    [[9.0, 4.0, 4.0, 4.0]]
    """
    valid = found.valid
    if not valid.any():
        raise ShapeError("disparity: no pixel is valid, expected some to fill the others from")
    from_left = _carried(found.disparity, valid)
    from_right = _carried(found.disparity[:, ::-1], valid[:, ::-1])[:, ::-1]
    filled = np.where(valid, found.disparity, np.fmin(from_left, from_right))
    rows = np.flatnonzero(valid.any(axis=1))
    source = rows[np.maximum(np.searchsorted(rows, np.arange(len(valid)), side="right") - 1, 0)]
    everywhere = np.ones_like(valid)
    return DisparityMap(filled[source].astype(np.float32), everywhere, found.all_in_focus)


def _carried(disparity: Disparity, valid: Bool) -> Float32:
    """Last valid disparity at or before each pixel of its row, infinity where there is none."""
    index = np.maximum.accumulate(np.where(valid, np.arange(valid.shape[1]), -1), axis=1)
    carried = np.take_along_axis(disparity, np.maximum(index, 0), axis=1)
    return np.where(index >= 0, carried, np.inf).astype(np.float32)


def _matcher(d_max: float, d_min: float, options: BaselineOptions) -> cv2.StereoSGBM:
    block = options.block_px
    if block < 1 or block % 2 == 0:
        raise ConfigError(f"block_px = {block}: expected an odd number of px, 1 or more")
    lowest, count = _search(d_max, d_min)
    return cv2.StereoSGBM.create(
        minDisparity=lowest,
        numDisparities=count,
        blockSize=block,
        P1=8 * 3 * block**2,
        P2=32 * 3 * block**2,
        preFilterCap=63,
        mode=cv2.StereoSGBM_MODE_HH,
    )


def _search(d_max: float, d_min: float) -> tuple[int, int]:
    if not (np.isfinite([d_max, d_min]).all() and d_max > d_min >= 0):
        raise ConfigError(f"disparities to search: found {d_min} to {d_max} px, expected a rising range from 0 px on")
    lowest = int(np.floor(d_min))
    return lowest, int(np.ceil((d_max + 1 - lowest) / 16)) * 16


def _padded(left: Rgb, right: Rgb, d_max: float, d_min: float) -> tuple[UInt8, UInt8]:
    """Widen both views on the left: OpenCV gives no disparity where the search leaves the picture."""
    if left.shape != right.shape or left.ndim != 3 or left.shape[2] != 3:
        raise ShapeError(f"rectified views: found shapes {left.shape} and {right.shape}, expected (V, U, 3) for both")
    lowest, count = _search(d_max, d_min)
    margin = (0, 0, lowest + count, 0)
    wide = [cv2.copyMakeBorder(srgb8(view), *margin, cv2.BORDER_REPLICATE) for view in (left, right)]
    return wide[0], wide[1]


def _cropped(matched: Float32, left: Rgb) -> Float32:
    return matched[:, matched.shape[1] - left.shape[1] :].astype(np.float32)


def _as_map(matched: Float32, valid: Bool, left: Rgb) -> DisparityMap:
    return DisparityMap(np.where(valid, matched, 0).astype(np.float32), valid, left)
