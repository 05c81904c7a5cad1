"""Where each view of a decoded light field sees the px of its rectified camera."""

from __future__ import annotations

import math

import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.lightfield.field import LightField, ViewSampling
from lfstereo.rig.distortion import distort, undistort
from lfstereo.rig.geometry import RectifiedGeometry, Side
from lfstereo.rig.rig import PlenopticCamera, StereoRig

VIEW_PIXELS = ViewSampling(origin_px=(0.0, 0.0), step_px=(1.0, 1.0), rotation_rad=0.0, view_step_px=1.0)
"""Of views that never were a lenslet image: px of the sensor are px of the views."""


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


def view_homography(
    light_field: LightField, camera: PlenopticCamera, geometry: RectifiedGeometry, side: Side, t: float, s: float
) -> Float64:
    """Return the ``(3, 3)`` map from rectified px to px of decoded view ``(t, s)``, of a lens without distortion.

    ``t`` and ``s`` may lie between two views.
    """
    pupil = _pupil_point(light_field, camera, t, s)
    homography: Float64 = (
        np.linalg.inv(sensor_from_view(light_field))
        @ _sensor_from_direction(camera, pupil)
        @ _direction_from_rectified(geometry, side, pupil)
    )
    homography /= homography[2, 2]
    return homography


def view_map(
    light_field: LightField, camera: PlenopticCamera, geometry: RectifiedGeometry, side: Side, t: float, s: float
) -> tuple[Float32, Float32]:
    """Return where in decoded view ``(t, s)`` each rectified px lies: x and y, ``(V, U)`` px; with distortion."""
    pupil = _pupil_point(light_field, camera, t, s)
    rows, columns = geometry.size
    row, column = np.mgrid[:rows, :columns].astype(np.float64)
    m = _direction_from_rectified(geometry, side, pupil)
    depth = m[2, 0] * column + m[2, 1] * row + m[2, 2]
    ideal = [(m[k, 0] * column + m[k, 1] * row + m[k, 2]) / depth for k in (0, 1)]
    bent = distort(ideal[0], ideal[1], np.asarray(camera.distortion))
    m = np.linalg.inv(sensor_from_view(light_field)) @ _sensor_from_direction(camera, pupil)
    x, y = (m[k, 0] * bent.x + m[k, 1] * bent.y + m[k, 2] for k in (0, 1))
    return x.astype(np.float32), y.astype(np.float32)


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
    bent = np.hstack([places, ones]) @ np.linalg.inv(_sensor_from_direction(camera, pupil)).T
    ideal = np.stack(undistort(bent[:, 0], bent[:, 1], np.asarray(camera.distortion)), axis=1)
    seen = np.hstack([ideal, ones]) @ np.linalg.inv(_direction_from_rectified(geometry, side, pupil)).T
    rectified: Float64 = seen[:, :2] / seen[:, 2:]
    return rectified


def _pupil_point(light_field: LightField, camera: PlenopticCamera, t: float, s: float) -> Float64:
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
