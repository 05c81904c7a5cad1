"""Disparity to metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Bool, Float32, check_shape
from lfstereo.errors import InputError, ShapeError


@dataclass(frozen=True, slots=True)
class DepthMap:
    """Depth of the rectified left centre view."""

    depth_m: Float32
    """``(V, U)`` metres along the viewing direction (z); 0 where not valid."""
    valid: Bool
    """``(V, U)``: false where the disparity is unknown, or names no point in front of the cameras."""

    def __post_init__(self) -> None:
        check_shape("depth map", self.depth_m, (None, None))
        if self.valid.shape != self.depth_m.shape:
            raise ShapeError(f"depth map: valid has shape {self.valid.shape}, expected {self.depth_m.shape} as depth_m")


def triangulate(
    disparity: Float32, valid: Bool | None, focal_px: float, baseline_m: float, doffs_px: float
) -> DepthMap:
    """Return the depth ``z = f B / (d + doffs)`` of every pixel.

    Parameters
    ----------
    disparity
        ``(V, U)`` px of the rectified left centre view, positive = nearer.
    valid
        ``(V, U)``, or ``None`` where every disparity is known.
    focal_px
        Focal length of the rectified views, px.
    baseline_m
        Distance of the two pupils, m.
    doffs_px
        Difference of the principal points, right minus left, px.

    Raises
    ------
    ShapeError
        If ``disparity`` is no image, or ``valid`` has another shape.
    InputError
        If the focal length or the baseline is not positive, or a number is not finite.

    References
    ----------
    Scharstein et al., "High-resolution stereo datasets with subpixel-accurate ground truth" (2014), calib.txt.

    Examples
    --------
    >>> triangulate(np.array([[10.0, -90.0]], np.float32), None, 1000.0, 0.1, 90.0).depth_m.tolist()
    [[1.0, 0.0]]
    """
    check_shape("disparity", disparity, (None, None))
    _check_geometry(focal_px, baseline_m, doffs_px)
    known = np.ones(disparity.shape, np.bool_) if valid is None else valid
    if known.shape != disparity.shape:
        raise ShapeError(f"valid: found shape {known.shape}, expected {disparity.shape} as the disparity")
    shift = disparity.astype(np.float64) + doffs_px
    known = known & np.isfinite(shift) & (shift > 0)
    depth = np.where(known, focal_px * baseline_m / np.where(known, shift, 1.0), 0.0)
    return DepthMap(depth.astype(np.float32), known)


def disparity_of(depth_m: Float32, focal_px: float, baseline_m: float, doffs_px: float) -> Float32:
    """Return the disparity ``d = f B / z - doffs`` in px of positive depths in metres.

    Raises
    ------
    InputError
        If a depth, the focal length or the baseline is not positive, or a number is not finite.

    Examples
    --------
    >>> disparity_of(np.array([1.0], np.float32), 1000.0, 0.1, 90.0).tolist()
    [10.0]
    """
    _check_geometry(focal_px, baseline_m, doffs_px)
    if not np.all(np.isfinite(depth_m) & (np.asarray(depth_m) > 0)):
        raise InputError("depth: found values that are not positive metres; pass only the valid depths")
    return (focal_px * baseline_m / depth_m.astype(np.float64) - doffs_px).astype(np.float32)


def _check_geometry(focal_px: float, baseline_m: float, doffs_px: float) -> None:
    finite = bool(np.isfinite([focal_px, baseline_m, doffs_px]).all())
    if not finite or focal_px <= 0 or baseline_m <= 0:
        raise InputError(
            f"rectified geometry: found focal length {focal_px} px, baseline {baseline_m} m, doffs {doffs_px} px; "
            "expected finite numbers, the first two above 0"
        )
