"""The pinhole part of a plenoptic camera, with the lens model that OpenCV and Kalibr share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import least_squares

from lfstereo.arrays import Float64
from lfstereo.errors import RigError
from lfstereo.rig.distortion import distort, undistort
from lfstereo.rig.rig import Five, Pair, PlenopticCamera

LARGEST_MISFIT_PX = 1.0
"""Between the two lens models, anywhere in the frame; sensor px, of which a view's px has about 12."""
_EXACT_PX = 1e-6
_PLACES = 31
"""Of the frame's width and height where the models are compared."""
Model = Callable[[Float64, Float64], Float64]


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """A pinhole with radial and tangential distortion.

    References
    ----------
    Brown, "Decentering distortion of lenses" (1966); OpenCV, "Camera calibration and 3D reconstruction": the order of
    the coefficients. Their tangential terms are, to first order, what a displaced centre of distortion does.
    """

    focal_px: Pair
    principal_px: Pair
    coefficients: Five
    """k1, k2, p1, p2, k3: OpenCV's order."""
    size_px: tuple[int, int]
    """(width, height)."""
    misfit_px: float = 0.0
    """Largest distance between where this model and the original one see the same direction."""

    @property
    def matrix(self) -> Float64:
        """``(3, 3)`` camera matrix."""
        (fx, fy), (cx, cy) = self.focal_px, self.principal_px
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True)
class Lens:
    """Lens of a plenoptic camera that sees what a pinhole camera sees."""

    focal_px: Pair
    principal_px: Pair
    distortion: Five


def pinhole_of(camera: PlenopticCamera, terms: int = 3) -> PinholeCamera:
    """Return the centre view of a plenoptic camera as an ordinary camera.

    Parameters
    ----------
    camera
        The camera; its focus distance and its pupil are left out.
    terms
        Radial terms to use: 3 for OpenCV, 2 for Kalibr.

    Raises
    ------
    RigError
        If the lens bends rays as the other model cannot, by over 1 sensor px somewhere in the frame.
    """
    k1, k2, k3, b1, b2 = camera.distortion
    start = np.array([*camera.focal_px, *camera.principal_px, k1, k2, -k1 * b2, -k1 * b1, k3]) + 0.0  # No -0.
    free = np.ones(9, np.bool_)
    free[8] = terms > 2
    start[8] *= terms > 2
    x, y = _places(camera.sensor_px)
    (fx, fy), (cx, cy) = camera.focal_px, camera.principal_px
    ideal = undistort((x - cx) / fx, (y - cy) / fy, np.asarray(camera.distortion))
    found, misfit = _fitted(_radial_tangential, start, free, np.stack(ideal), np.stack([x, y]))
    _check_misfit(f"rig: camera '{camera.serial}'", misfit, "write the rig as JSON, which keeps the lens as it is")
    return PinholeCamera(
        focal_px=(found[0], found[1]),
        principal_px=(found[2], found[3]),
        coefficients=(found[4], found[5], found[6], found[7], found[8]),
        size_px=camera.sensor_px,
        misfit_px=misfit,
    )


def lens_of(camera: PinholeCamera, where: str) -> Lens:
    """Return the lens of a plenoptic camera that sees as an ordinary camera does.

    Raises
    ------
    RigError
        If no displaced centre of distortion bends rays as the tangential terms do, within 1 px.
    """
    k1, k2, p1, p2, k3 = camera.coefficients
    centre = np.clip([-p2 / k1, -p1 / k1], -0.5, 0.5) if k1 else np.zeros(2)
    start = np.array([*camera.focal_px, *camera.principal_px, k1, k2, k3, *centre])
    x, y = _places(camera.size_px)
    places = np.stack([x, y], axis=1)[:, None]
    stop = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-13)
    seen = places, camera.matrix, np.asarray(camera.coefficients), None, None, None
    of_opencv_4 = getattr(cv2, "undistortPointsIter", None)
    undistorted = of_opencv_4(*seen[:5], stop) if of_opencv_4 else cv2.undistortPoints(*seen, criteria=stop)
    ideal = np.asarray(undistorted, np.float64)[:, 0].T
    found, misfit = _fitted(_displaced_radial, start, np.ones(9, np.bool_), ideal, np.stack([x, y]))
    _check_misfit(where, misfit, "calibrate without tangential distortion, or photograph the target with lfstereo")
    return Lens((found[0], found[1]), (found[2], found[3]), (found[4], found[5], found[6], found[7], found[8]))


def _places(size_px: tuple[int, int]) -> tuple[Float64, Float64]:
    x, y = np.meshgrid(*[np.linspace(0, n - 1, _PLACES) for n in size_px])
    return x.ravel(), y.ravel()


def _radial_tangential(p: Float64, ideal: Float64) -> Float64:
    """Return ``(2, M)`` px of ideal directions ``(2, M)``; p = fx, fy, cx, cy, k1, k2, p1, p2, k3."""
    x, y = ideal
    r2 = x * x + y * y
    gain = 1 + r2 * (p[4] + r2 * (p[5] + r2 * p[8]))
    bent_x = gain * x + 2 * p[6] * x * y + p[7] * (r2 + 2 * x * x)
    bent_y = gain * y + p[6] * (r2 + 2 * y * y) + 2 * p[7] * x * y
    return np.stack([p[0] * bent_x + p[2], p[1] * bent_y + p[3]])


def _displaced_radial(p: Float64, ideal: Float64) -> Float64:
    """Return ``(2, M)`` px of ideal directions ``(2, M)``; p = fx, fy, cx, cy, k1, k2, k3, b1, b2."""
    bent = distort(ideal[0], ideal[1], p[4:])
    return np.stack([p[0] * bent.x + p[2], p[1] * bent.y + p[3]])


def _fitted(
    model: Model, start: Float64, free: np.ndarray[tuple[int], np.dtype[np.bool_]], ideal: Float64, places: Float64
) -> tuple[list[float], float]:
    """Return the parameters that see the directions at the given places, and the largest miss, px."""

    def miss(values: Float64) -> Float64:
        whole = start.copy()
        whole[free] = values
        return (model(whole, ideal) - places).ravel()

    found = start.copy()
    if np.abs(miss(start[free])).max() > _EXACT_PX:
        scale = np.maximum(np.abs(start[free]), 1e-3)
        found[free] = least_squares(miss, start[free], x_scale=scale, xtol=1e-14, ftol=1e-14, gtol=1e-14).x
    worst = float(np.hypot(*miss(found[free]).reshape(2, -1)).max())
    return [float(value) for value in found], worst


def _check_misfit(where: str, misfit_px: float, remedy: str) -> None:
    if not misfit_px <= LARGEST_MISFIT_PX:
        raise RigError(
            f"{where}: the lens models differ by {misfit_px:.2f} px, expected at most {LARGEST_MISFIT_PX:g}; {remedy}"
        )
