"""Two parallel virtual cameras in front of a rig: what a rectified pair of light fields looks like."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Float64
from lfstereo.conventions import DISPARITY_RANGE_PX
from lfstereo.errors import RigError
from lfstereo.rig.rig import StereoRig

Side = Literal["left", "right"]
_MAX_TURN_RAD = math.radians(30.0)


@dataclass(frozen=True, slots=True)
class RectifiedCamera:
    """One of the two parallel virtual cameras."""

    rectified_from_camera: Float64
    """``(3, 3)`` rotation."""
    principal_px: tuple[float, float]
    """(cx, cy) in rectified px."""


@dataclass(frozen=True, slots=True)
class RectifiedGeometry:
    """Two parallel virtual cameras whose rows correspond, derived from a rig alone.

    ``x_left = f X/Z + cx_left`` and ``x_right = f (X - B)/Z + cx_right`` in px of the rectified views, so
    ``d = x_left - x_right = f B/Z - doffs`` with ``doffs = cx_right - cx_left``.
    """

    left: RectifiedCamera
    right: RectifiedCamera
    focal_px: float
    baseline_m: float
    size: tuple[int, int]
    """(V, U) of every rectified view."""
    zero_slope_m: float
    """Depth of zero slope in both rectified light fields."""
    reference_m: float
    """Depth at which views off the pupil centre are mapped exactly."""
    disparity_max_px: float
    """Disparity of the near end of the working range; the far end has 0."""

    @property
    def doffs_px(self) -> float:
        """Difference of the principal points, right minus left."""
        return self.right.principal_px[0] - self.left.principal_px[0]

    def camera(self, side: Side) -> RectifiedCamera:
        """Return the virtual camera of one side."""
        return self.left if side == "left" else self.right

    def slope_from_disparity(self, view_baseline_m: float) -> tuple[float, float]:
        """Return ``(a, b)`` of ``slope = a d + b``, px per view, for views ``view_baseline_m`` apart.

        From ``slope = f m (1/Z - 1/Z0)`` and ``1/Z = (d + doffs) / (f B)`` with view baseline m.
        """
        a = view_baseline_m / self.baseline_m
        return a, a * self.doffs_px - self.focal_px * view_baseline_m / self.zero_slope_m


def rectified_geometry(rig: StereoRig) -> RectifiedGeometry:
    """Place two parallel virtual cameras in front of a rig's pupils.

    The common x axis runs along the baseline, the z axis is the mean of the two viewing directions made
    perpendicular to it; the principal points differ by ``doffs = f B / far`` so that disparity 0 lies at the far
    end of the working range, and centre the common field of view. Where the working range would exceed
    100 px, the rectified px grow.

    Raises
    ------
    RigError
        If the baseline runs along the viewing direction, or a camera would turn by more than 30 degrees.

    References
    ----------
    Fusiello, Trucco and Verri, "A compact algorithm for rectification of stereo pairs" (2000);
    Scharstein et al., "High-resolution stereo datasets with subpixel-accurate ground truth" (2014), doffs.
    """
    left_from_right = rig.right_from_left.T
    axis_x = rig.right_centre_m / rig.baseline_m
    forward = np.array([0.0, 0.0, 1.0]) + left_from_right[:, 2]
    axis_z = forward - axis_x * (axis_x @ forward)
    axis_z /= np.linalg.norm(axis_z)
    rectified_from_left = np.stack([axis_x, np.cross(axis_z, axis_x), axis_z])
    rectified_from_right = rectified_from_left @ left_from_right
    for side, turn in (("left", rectified_from_left), ("right", rectified_from_right)):
        angle = float(Rotation.from_matrix(turn).magnitude())
        if angle > _MAX_TURN_RAD:
            raise RigError(
                f"rig: rectification would turn the {side} camera by {math.degrees(angle):.0f} degrees, expected "
                f"at most {math.degrees(_MAX_TURN_RAD):.0f}; check the rig's rotation, translation and which is left"
            )
    focal_sensor = float(np.mean([rig.left.focal_px, rig.right.focal_px]))
    spread = focal_sensor / rig.pixel_px * rig.baseline_m * (1 / rig.near_m - 1 / rig.far_m)
    pixel_px = rig.pixel_px * max(1.0, spread / DISPARITY_RANGE_PX)
    focal = focal_sensor / pixel_px
    size = (round(rig.left.sensor_px[1] / pixel_px), round(rig.left.sensor_px[0] / pixel_px))
    reference = 2 / (1 / rig.near_m + 1 / rig.far_m)
    middle = _common_centre(rig, rectified_from_left, rectified_from_right, reference)
    cx = (size[1] - 1) / 2 - focal * middle[0] / reference
    cy = (size[0] - 1) / 2 - focal * middle[1] / reference
    doffs = focal * rig.baseline_m / rig.far_m
    return RectifiedGeometry(
        left=RectifiedCamera(rectified_from_left, (cx, cy)),
        right=RectifiedCamera(rectified_from_right, (cx + doffs, cy)),
        focal_px=focal,
        baseline_m=rig.baseline_m,
        size=size,
        zero_slope_m=2 / (1 / rig.left.focus_distance_m + 1 / rig.right.focus_distance_m),
        reference_m=reference,
        disparity_max_px=min(spread, DISPARITY_RANGE_PX),
    )


def _common_centre(rig: StereoRig, from_left: Float64, from_right: Float64, depth_m: float) -> Float64:
    """Return the middle (x, y) of the two fields of view at a depth, in rectified left axes, m."""
    points = []
    for camera, turn, offset in ((rig.left, from_left, 0.0), (rig.right, from_right, rig.baseline_m)):
        centre = [(n - 1) / 2 for n in camera.sensor_px]
        ray = turn @ [*((centre[i] - camera.principal_px[i]) / camera.focal_px[i] for i in (0, 1)), 1.0]
        points.append(ray[:2] / ray[2] * depth_m + [offset, 0.0])
    middle: Float64 = np.mean(points, axis=0)
    return middle
