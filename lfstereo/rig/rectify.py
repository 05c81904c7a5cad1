"""Rectify a pair of light fields: rows aligned, toe-in taken out, the working range at disparities 0..100 px."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Bool, Float32, Float64, UInt8
from lfstereo.conventions import DISPARITY_RANGE_PX
from lfstereo.errors import AssetError, RigError, ShapeError
from lfstereo.lightfield.field import LightField, ViewSampling
from lfstereo.progress import Progress, silent
from lfstereo.rig.distortion import distort
from lfstereo.rig.rig import PlenopticCamera, StereoRig

Side = Literal["left", "right"]
Picture = TypeVar("Picture", Float32, UInt8)
_MAX_TURN_RAD = math.radians(30.0)
_VIEW_PIXELS = ViewSampling(origin_px=(0.0, 0.0), step_px=(1.0, 1.0), rotation_rad=0.0, view_step_px=1.0)


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


def rectify(
    light_field: LightField,
    rig: StereoRig,
    geometry: RectifiedGeometry,
    side: Side,
    progress: Progress = silent,
    any_zoom: bool = False,
) -> LightField:
    """Resample one light field of the pair to its rectified camera.

    Every view is a pinhole at its pupil point, so it maps by one homography, and by the lens's distortion where the
    rig has any; the part of the pupil offset that
    the turn moves out of the plane is exact at ``geometry.reference_m`` and below 0.1 px elsewhere.

    Parameters
    ----------
    light_field
        The decoded light field.
    side
        Which camera of the rig it comes from.
    any_zoom
        Accept light fields taken at another zoom or focus than the rig was calibrated at.

    Returns
    -------
    LightField
        ``(T, S, V, U, 3)`` of ``geometry.size``; samples outside the captured field have weight 0.

    Raises
    ------
    AssetError
        If the rig was made for another camera, or for another state of its lens.
    ShapeError
        If the light field does not cover the sensor that the rig speaks of.
    """
    camera = rig.left if side == "left" else rig.right
    _check_match(light_field, camera, side)
    if not any_zoom:
        _check_lens(light_field, camera, side)
    t_count, s_count = light_field.views.shape[:2]
    rows, columns = geometry.size
    views = np.empty((t_count, s_count, rows, columns, 3), np.float32)
    weight = np.empty((t_count, s_count, rows, columns), np.uint8)
    full = np.full(light_field.views.shape[2:4], 255, np.uint8)
    for index in range(t_count * s_count):
        t, s = divmod(index, s_count)
        view = light_field.views[t, s]
        confidence = full if light_field.weight is None else light_field.weight[t, s]
        where = (light_field, camera, geometry, side, t, s)
        views[t, s] = _resampled(view, *where, cv2.INTER_CUBIC)
        weight[t, s] = _resampled(confidence, *where, cv2.INTER_LINEAR)
        progress(index + 1, t_count * s_count)
    np.maximum(views, 0.0, out=views)
    return replace(light_field, views=views, weight=weight, sampling=None)


def view_baseline_m(light_field: LightField, camera: PlenopticCamera) -> float:
    """Return the distance of neighbouring views on the pupil, m."""
    return camera.pupil_m_per_px * (light_field.sampling or _VIEW_PIXELS).view_step_px


def view_homography(
    light_field: LightField, camera: PlenopticCamera, geometry: RectifiedGeometry, side: Side, t: int, s: int
) -> Float64:
    """Return the ``(3, 3)`` map from rectified px to px of decoded view ``(t, s)``, of a lens without distortion."""
    pupil = _pupil_point(light_field, camera, t, s)
    homography: Float64 = (
        _view_from_sensor(light_field)
        @ _sensor_from_direction(camera, pupil)
        @ _direction_from_rectified(geometry, side, pupil)
    )
    homography /= homography[2, 2]
    return homography


def view_map(
    light_field: LightField, camera: PlenopticCamera, geometry: RectifiedGeometry, side: Side, t: int, s: int
) -> tuple[Float32, Float32]:
    """Return where in decoded view ``(t, s)`` each rectified px lies: x and y, ``(V, U)`` px; with distortion."""
    pupil = _pupil_point(light_field, camera, t, s)
    rows, columns = geometry.size
    row, column = np.mgrid[:rows, :columns].astype(np.float64)
    m = _direction_from_rectified(geometry, side, pupil)
    depth = m[2, 0] * column + m[2, 1] * row + m[2, 2]
    ideal = [(m[k, 0] * column + m[k, 1] * row + m[k, 2]) / depth for k in (0, 1)]
    bent = distort(ideal[0], ideal[1], np.asarray(camera.distortion))
    m = _view_from_sensor(light_field) @ _sensor_from_direction(camera, pupil)
    x, y = (m[k, 0] * bent.x + m[k, 1] * bent.y + m[k, 2] for k in (0, 1))
    return x.astype(np.float32), y.astype(np.float32)


def _pupil_point(light_field: LightField, camera: PlenopticCamera, t: int, s: int) -> Float64:
    """Return the pupil point of a view in camera axes, ``(3,)`` m."""
    t0, s0 = light_field.centre
    step = view_baseline_m(light_field, camera)
    return np.array([(s - s0) * step, (t - t0) * step, 0.0])


def _direction_from_rectified(geometry: RectifiedGeometry, side: Side, pupil: Float64) -> Float64:
    """Return the ``(3, 3)`` map from rectified px to the ideal direction ``(X - pupil)/Z`` from a pupil point."""
    target = geometry.camera(side)
    f, z0, zr = geometry.focal_px, geometry.zero_slope_m, geometry.reference_m
    inverse_f = 1 / f
    # Rectified px -> point on the reference plane, in rectified axes.
    plane_from_px = zr * np.array(
        [
            [inverse_f, 0, -target.principal_px[0] * inverse_f - pupil[0] / z0 + pupil[0] / zr],
            [0, inverse_f, -target.principal_px[1] * inverse_f - pupil[1] / z0 + pupil[1] / zr],
            [0, 0, 1],
        ]
    )
    camera_from_rectified = target.rectified_from_camera.T
    # X_camera - pupil, linear in the homogeneous plane point because its z is the constant zr.
    shift = np.zeros((3, 3))
    shift[:, 2] = -pupil / zr
    in_camera = camera_from_rectified @ plane_from_px
    direction: Float64 = in_camera + shift @ plane_from_px
    return direction


def _sensor_from_direction(camera: PlenopticCamera, pupil: Float64) -> Float64:
    """Return the ``(3, 3)`` map from bent direction to sensor px of the lattice, as seen from a pupil point."""
    fx, fy = camera.focal_px
    zf = camera.focus_distance_m
    return np.array(
        [
            [fx, 0, camera.principal_px[0] + fx * pupil[0] / zf],
            [0, fy, camera.principal_px[1] + fy * pupil[1] / zf],
            [0, 0, 1],
        ]
    )


def field_of_view(light_field: LightField, camera: PlenopticCamera, geometry: RectifiedGeometry, side: Side) -> Bool:
    """Return where the rectified centre view ``(V, U)`` was seen by the camera at all."""
    t0, s0 = light_field.centre
    whole = np.full(light_field.views.shape[2:4], 255, np.uint8)
    mask: Bool = _resampled(whole, light_field, camera, geometry, side, t0, s0, cv2.INTER_LINEAR) == 255
    return mask


def _resampled(
    picture: Picture,
    light_field: LightField,
    camera: PlenopticCamera,
    geometry: RectifiedGeometry,
    side: Side,
    t: int,
    s: int,
    interpolation: int,
) -> Picture:
    """Return a picture of decoded view ``(t, s)`` in rectified px; zero beyond the captured field, or its border."""
    border = cv2.BORDER_CONSTANT if interpolation == cv2.INTER_LINEAR else cv2.BORDER_REPLICATE
    result: Picture
    if any(camera.distortion[:3]):
        x, y = view_map(light_field, camera, geometry, side, t, s)
        result = cv2.remap(picture, x, y, interpolation, borderMode=border)
    else:
        source = view_homography(light_field, camera, geometry, side, t, s)
        flags = interpolation | cv2.WARP_INVERSE_MAP
        result = cv2.warpPerspective(picture, source, geometry.size[::-1], flags=flags, borderMode=border)
    return result


def _view_from_sensor(light_field: LightField) -> Float64:
    sampling = light_field.sampling or _VIEW_PIXELS
    c, s = math.cos(sampling.rotation_rad), math.sin(sampling.rotation_rad)
    sensor_from_view = np.array(
        [
            [c * sampling.step_px[0], -s * sampling.step_px[1], sampling.origin_px[0]],
            [s * sampling.step_px[0], c * sampling.step_px[1], sampling.origin_px[1]],
            [0, 0, 1],
        ]
    )
    inverse: Float64 = np.linalg.inv(sensor_from_view)
    return inverse


def _common_centre(rig: StereoRig, from_left: Float64, from_right: Float64, depth_m: float) -> Float64:
    """Return the middle (x, y) of the two fields of view at a depth, in rectified left axes, m."""
    points = []
    for camera, turn, offset in ((rig.left, from_left, 0.0), (rig.right, from_right, rig.baseline_m)):
        centre = [(n - 1) / 2 for n in camera.sensor_px]
        ray = turn @ [*((centre[i] - camera.principal_px[i]) / camera.focal_px[i] for i in (0, 1)), 1.0]
        points.append(ray[:2] / ray[2] * depth_m + [offset, 0.0])
    middle: Float64 = np.mean(points, axis=0)
    return middle


def _check_match(light_field: LightField, camera: PlenopticCamera, side: Side) -> None:
    if camera.serial and light_field.serial and camera.serial != light_field.serial:
        raise AssetError(
            f"{light_field.source}: taken by camera {light_field.serial}, but the rig's {side} camera is "
            f"{camera.serial}; swap the captures or give the rig of these cameras"
        )
    sampling = light_field.sampling or _VIEW_PIXELS
    covered = [n * step for n, step in zip(light_field.views.shape[3:1:-1], sampling.step_px, strict=True)]
    if any(abs(c - w) > 0.03 * w for c, w in zip(covered, camera.sensor_px, strict=True)):
        raise ShapeError(
            f"{light_field.source}: covers {covered[0]:.0f} x {covered[1]:.0f} px, but the rig's {side} camera has "
            f"{camera.sensor_px[0]} x {camera.sensor_px[1]}; give the rig of this camera"
        )


def _check_lens(light_field: LightField, camera: PlenopticCamera, side: Side) -> None:
    """Refuse another zoom or focus where both are known: focal length and plane of zero slope depend on them."""
    for name in ("zoom", "focus"):
        found, expected = getattr(light_field, f"{name}_step"), getattr(camera, f"{name}_step")
        if found is not None and expected is not None and found != expected:
            raise AssetError(
                f"{light_field.source}: taken at {name} step {found}, but the rig's {side} camera was calibrated at "
                f"{expected}; set the lens as it was, calibrate again, or accept it with --any-zoom"
            )
