"""Where each view of a decoded light field sees the px of its rectified camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.lightfield.field import LightField, ViewSampling
from lfstereo.rig.distortion import undistort
from lfstereo.rig.geometry import RectifiedGeometry, Side
from lfstereo.rig.rig import PlenopticCamera, StereoRig

VIEW_PIXELS = ViewSampling(origin_px=(0.0, 0.0), step_px=(1.0, 1.0), rotation_rad=0.0, view_step_px=1.0)
"""Of views that never were a lenslet image: px of the sensor are px of the views."""


@dataclass(frozen=True, slots=True)
class ViewMap:
    """Where one view sees the px of its rectified camera, in three steps."""

    picture_from_rectified: Float64
    """``(3, 3)`` homography to the lens's ideal picture, tangents."""
    bend: Float64
    """``(5,)`` of :func:`lfstereo.rig.distortion.distort`: to the picture as the lens bends it."""
    view_from_picture: Float64
    """``(3, 3)`` affine map to px of the view."""


def view_baseline_m(light_field: LightField, camera: PlenopticCamera) -> float:
    """Return the distance of neighbouring views of a decoded light field on the pupil, m."""
    return camera.pupil_m_per_px * (light_field.sampling or VIEW_PIXELS).view_step_px


def common_view_baseline_m(light_field: LightField, rig: StereoRig) -> float:
    """Return the distance of neighbouring views after rectification, m: the smaller one of the two cameras."""
    return min(view_baseline_m(light_field, camera) for camera in (rig.left, rig.right))


def sensor_from_view(light_field: LightField) -> Float64:
    """Return the ``(3, 3)`` map from px of a view to px of the sensor."""
    sampling = light_field.sampling or VIEW_PIXELS
    c, s = math.cos(sampling.rotation_rad), math.sin(sampling.rotation_rad)
    return np.array(
        [
            [c * sampling.step_px[0], -s * sampling.step_px[1], sampling.origin_px[0]],
            [s * sampling.step_px[0], c * sampling.step_px[1], sampling.origin_px[1]],
            [0, 0, 1],
        ]
    )


def view_map(
    light_field: LightField, camera: PlenopticCamera, geometry: RectifiedGeometry, side: Side, t: float, s: float
) -> ViewMap:
    """Return where decoded view ``(t, s)`` sees the rectified px; ``t`` and ``s`` may lie between two views."""
    t0, s0 = light_field.centre
    step = view_baseline_m(light_field, camera)
    pupil = np.array([(s - s0) * step, (t - t0) * step, 0.0])
    return ViewMap(
        picture_from_rectified=_picture_from_rectified(geometry, side, camera, pupil),
        bend=np.asarray(camera.distortion),
        view_from_picture=np.linalg.inv(sensor_from_view(light_field)) @ _sensor_from_picture(camera),
    )


def rectify_places(
    places: Float64, offset_px: Float64, camera: PlenopticCamera, geometry: RectifiedGeometry, side: Side
) -> Float64:
    """Return where places ``(N, 2)`` on the sensor, seen from one view, lie in its rectified view, ``(N, 2)`` px.

    Parameters
    ----------
    offset_px
        ``(2,)`` position of the view inside the micro-images, sensor px from the centre.
    """
    pupil = np.array([*(camera.pupil_m_per_px * offset_px), 0.0])
    ones = np.ones((len(places), 1))
    bent = np.hstack([places, ones]) @ np.linalg.inv(_sensor_from_picture(camera)).T
    ideal = np.stack(undistort(bent[:, 0], bent[:, 1], np.asarray(camera.distortion)), axis=1)
    seen = np.hstack([ideal, ones]) @ np.linalg.inv(_picture_from_rectified(geometry, side, camera, pupil)).T
    rectified: Float64 = seen[:, :2] / seen[:, 2:]
    return rectified


def _picture_from_rectified(
    geometry: RectifiedGeometry, side: Side, camera: PlenopticCamera, pupil: Float64
) -> Float64:
    """Return the ``(3, 3)`` map from rectified px to the lens's ideal picture ``(X - pupil)/Z + pupil/Zf``.

    That is the direction in which the pupil's centre sees the point of the plane of zero slope on the same ray.
    """
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
    direction = (camera_from_rectified + shift) @ plane_from_px
    lean = np.eye(3)
    lean[:2, 2] = pupil[:2] / camera.focus_distance_m
    picture: Float64 = lean @ direction
    return picture


def _sensor_from_picture(camera: PlenopticCamera) -> Float64:
    """Return the ``(3, 3)`` map from the picture as the lens bends it to sensor px of the lattice."""
    (fx, fy), (cx, cy) = camera.focal_px, camera.principal_px
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
