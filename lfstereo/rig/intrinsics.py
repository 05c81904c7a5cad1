"""Rays of a plenoptic camera: the 5 x 5 matrix, projection of points and its derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.rig.distortion import distort, undistort

RAY = 17
"""A camera's rays: h11 h22 h13 h24 h31 h42 h33 h44 s0 t0 u0 v0, then k1 k2 k3 b1 b2."""
H11, H22, H13, H24, H31, H42, H33, H44, S0, T0, U0, V0 = range(12)

Expand = Callable[[Float64], tuple[Float64, Float64]]
"""From a camera's own parameters ``(n,)`` to its rays ``(17,)`` and their derivatives ``(17, n)``."""


@dataclass(frozen=True, slots=True)
class Projection:
    """Where points are seen, with derivatives."""

    place: Float64
    """``(M, 2)`` px."""
    by_ray: Float64
    """``(M, 2, 17)`` by the camera's rays."""
    by_point: Float64
    """``(M, 2, 3)`` by the point in camera axes, px per m."""


def matrix_from_rays(rays: Float64) -> Float64:
    """Return the ``(5, 5)`` matrix of ``(s, t, u, v, 1) = H (i, j, k, l, 1)``: places in m, directions as tangents.

    References
    ----------
    Dansereau, Pizarro and Williams, "Decoding, calibration and rectification for lenselet-based plenoptic
    cameras" (CVPR 2013), equation 9.
    """
    matrix = np.eye(5)
    matrix[[0, 1, 0, 1], [0, 1, 2, 3]] = rays[:4]
    matrix[[2, 3, 2, 3], [0, 1, 2, 3]] = rays[4:8]
    matrix[:4, 4] = rays[8:12]
    return matrix


def plenoptic_rays(parameters: Float64) -> tuple[Float64, Float64]:
    """Expand the lens camera: fx, fy, cx, cy (px), 1/Zf (1/m), pupil metres per px, k1 k2 k3 b1 b2.

    The rays start on the pupil, ``(s, t) = m (i, j)``, in direction ``u = (k - cx)/fx - m i / Zf``, before distortion.
    """
    fx, fy, cx, cy, vergence, pupil = parameters[:6]
    rays = np.zeros(RAY)
    rays[[H11, H22]] = pupil
    rays[[H31, H42]] = -pupil * vergence
    rays[[H33, H44, U0, V0]] = 1 / fx, 1 / fy, -cx / fx, -cy / fy
    rays[12:] = parameters[6:]
    by = np.zeros((RAY, 11))
    by[[H33, U0], 0] = -1 / fx**2, cx / fx**2
    by[[H44, V0], 1] = -1 / fy**2, cy / fy**2
    by[U0, 2], by[V0, 3] = -1 / fx, -1 / fy
    by[[H31, H42], 4] = -pupil
    by[[H11, H22], 5] = 1
    by[[H31, H42], 5] = -vergence
    by[12:, 6:] = np.eye(5)
    return rays, by


def matrix_rays(parameters: Float64) -> tuple[Float64, Float64]:
    """Expand the eight entries of a matrix whose central sample is the axis, then k1 k2 k3 b1 b2.

    The order is h11 h22 h13 h24 h31 h42 h33 h44; view and pixel numbers count from the central sample.
    """
    rays, by = np.zeros(RAY), np.zeros((RAY, 13))
    rays[:8], rays[12:] = parameters[:8], parameters[8:]
    by[:8, :8] = np.eye(8)
    by[12:, 8:] = np.eye(5)
    return rays, by


def project(rays: Float64, offset: Float64, points: Float64, start: Float64, stigmatic: bool = False) -> Projection:
    """Project points into views.

    Distortion bends every ray by its direction, as the Light Field Toolbox has it, or moves the picture that a
    stigmatic lens makes: there the rays of one micro-image still meet in one point of the plane of zero slope. Both
    agree in the centre view; 5 mm off it and in the corner of a frame bent by 1 %, they differ by 2 sensor px.

    Parameters
    ----------
    rays
        ``(17,)`` of the camera.
    offset
        ``(M, 2)`` position of the view each point is seen in, in the unit of ``i, j``.
    points
        ``(M, 3)`` in camera axes, m, in front of the camera.
    start
        ``(M, 2)`` px near the result; it matters only where h13 or h24 is not 0.
    stigmatic
        Distort the picture, not the directions.

    References
    ----------
    Dansereau, Pizarro and Williams, "Decoding, calibration and rectification for lenselet-based plenoptic
    cameras" (CVPR 2013), section 4.3: distortion of directions; Born and Wolf, "Principles of optics", section 5.3:
    the distortion of a sharp image does not depend on the place in the pupil.
    """
    i, j = offset[:, 0], offset[:, 1]
    depth = points[:, 2]
    h = rays
    k, l = start[:, 0].copy(), start[:, 1].copy()  # noqa: E741
    steps = 3 if h[H13] or h[H24] else 1
    lean_x, lean_y = h[H31] * i, h[H42] * j
    in_picture = 1.0 if stigmatic else 0.0
    for step in range(steps + 1):
        x = (points[:, 0] - (h[H11] * i + h[H13] * k + h[S0])) / depth
        y = (points[:, 1] - (h[H22] * j + h[H24] * l + h[T0])) / depth
        bent = distort(x - in_picture * lean_x, y - in_picture * lean_y, h[12:])
        xx, yy = h[H33] + bent.x_by_x * h[H13] / depth, h[H44] + bent.y_by_y * h[H24] / depth
        xy, yx = bent.x_by_y * h[H24] / depth, bent.x_by_y * h[H13] / depth
        volume = xx * yy - xy * yx
        if step < steps:
            miss_x = bent.x - ((1 - in_picture) * lean_x + h[H33] * k + h[U0])
            miss_y = bent.y - ((1 - in_picture) * lean_y + h[H44] * l + h[V0])
            k += (yy * miss_x - xy * miss_y) / volume
            l += (xx * miss_y - yx * miss_x) / volume  # noqa: E741
    # With F = H-direction - distorted direction = 0: place_by_q = - F_by_place^-1 F_by_q.
    f_by_ray = np.zeros((2, RAY, len(k)))
    ax, ay, by_ = bent.x_by_x / depth, bent.x_by_y / depth, bent.y_by_y / depth
    for column, factor in ((H11, i), (H13, k), (S0, 1.0)):
        f_by_ray[:, column] = ax * factor, ay * factor
    for column, factor in ((H22, j), (H24, l), (T0, 1.0)):
        f_by_ray[:, column] = ay * factor, by_ * factor
    f_by_ray[0, H33], f_by_ray[0, U0] = k, 1.0
    f_by_ray[1, H44], f_by_ray[1, V0] = l, 1.0
    if stigmatic:
        f_by_ray[:, H31] = bent.x_by_x * i, bent.x_by_y * i
        f_by_ray[:, H42] = bent.x_by_y * j, bent.y_by_y * j
    else:
        f_by_ray[0, H31], f_by_ray[1, H42] = i, j
    for power in (1, 2, 3):
        f_by_ray[:, 11 + power] = -(bent.r2**power) * bent.off_x, -(bent.r2**power) * bent.off_y
    f_by_ray[:, 15] = bent.x_by_x - 1, bent.x_by_y
    f_by_ray[:, 16] = bent.x_by_y, bent.y_by_y - 1
    f_by_point = np.stack([[-ax, -ay], [-ay, -by_], [ax * x + ay * y, ay * x + by_ * y]], axis=1)
    inverse = -np.stack([[yy, -xy], [-yx, xx]]) / volume
    return Projection(
        place=np.stack([k, l], axis=1),
        by_ray=np.einsum("abm,bcm->mac", inverse, f_by_ray),
        by_point=np.einsum("abm,bcm->mac", inverse, f_by_point),
    )


def ray_distance_m(rays: Float64, offset: Float64, place: Float64, points: Float64) -> Float64:
    """Return the distance of points from the rays of the pixels they were seen at, ``(M,)`` m."""
    h = rays
    s = h[H11] * offset[:, 0] + h[H13] * place[:, 0] + h[S0]
    t = h[H22] * offset[:, 1] + h[H24] * place[:, 1] + h[T0]
    u = h[H31] * offset[:, 0] + h[H33] * place[:, 0] + h[U0]
    v = h[H42] * offset[:, 1] + h[H44] * place[:, 1] + h[V0]
    u, v = undistort(u, v, h[12:])
    direction = np.stack([u, v, np.ones_like(u)], axis=1)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    away = points - np.stack([s, t, np.zeros_like(s)], axis=1)
    across: Float64 = np.linalg.norm(np.cross(away, direction), axis=1)
    return across
