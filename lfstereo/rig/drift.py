"""Say from ordinary photographs whether a rig has moved since its calibration, and by how much."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from lfstereo.arrays import Float64
from lfstereo.errors import RigError
from lfstereo.rig.features import LEAST_MATCHES, FeatureMatches, rectified_places
from lfstereo.rig.geometry import RectifiedGeometry, rectified_geometry
from lfstereo.rig.rig import StereoRig

_EXPECTED_SD = np.array([0.017, 0.017, 0.017, 0.002])
"""What a drift is expected to be without any measurement: 1 degree about each axis, 2 mm of height."""
_CLIP_SIGMAS = 2.0
_WRONG_SIGMAS = 5.0
_MEDIAN_TO_SD = 1.4826
MOVED_PX = 0.2
"""A rig has moved if its drift changes the rows of matching px by this much rms: twice what a calibration leaves."""
_SURE_SIGMAS = 4.0


@dataclass(frozen=True, slots=True)
class Drift:
    """How far the right camera has turned and sunk since the calibration."""

    rig: StereoRig
    """The rig as it is now."""
    rotation_rad: Float64
    """``(3,)`` turn of the right camera about its own x, y and z axis."""
    rotation_sd_rad: Float64
    """``(3,)``"""
    height_m: float
    """How much lower the right camera's pupil lies, along the rectified y axis."""
    height_sd_m: float
    parallax_before_px: float
    """Rms difference of matching rows in the rectified centre views with the rig as it was, mismatches left out."""
    parallax_px: float
    """Likewise with the rig as it is now: what is left is the noise of the features."""
    moved_px: float
    """Rms change of these rows by the drift alone."""
    matches: int
    moved: bool
    """Whether the change counts (over 0.2 px) and is certain (over four standard deviations)."""


def estimate_drift(rig: StereoRig, matches: FeatureMatches) -> Drift:
    """Find the small turn and change of height of the right camera that bring matching features onto equal rows.

    Pitch shifts all rows alike, roll in proportion to x, a turn about the vertical in proportion to x y, and height
    in proportion to 1/Z; all four come from one robust fit, in which a drift of 1 degree or 2 mm is no surprise. The
    lenses and the length of the baseline are kept.

    Parameters
    ----------
    rig
        The rig as it was calibrated.
    matches
        From one pair of captures or several.

    Raises
    ------
    RigError
        If fewer than 30 matches agree with any drift.

    References
    ----------
    Dang, Hoffmann and Stiller, "Continuous stereo self-calibration by camera parameter tracking" (2009): epipolar
    constraints of features for a rig's orientation; Huber, "Robust estimation of a location parameter" (1964).
    """
    start = np.zeros(4)
    before = row_parallax_px(rig, matches)
    kept = np.abs(before - np.median(before)) < _WRONG_SIGMAS * max(_spread(before), 0.5)
    drift = start
    for _ in range(3):
        used = FeatureMatches(matches.left[kept], matches.right[kept])
        if len(used.left) < LEAST_MATCHES:
            raise RigError(
                f"drift: {len(used.left)} features agree with each other, expected {LEAST_MATCHES} or more; give more "
                "captures, of scenes with more texture"
            )
        drift, covariance = _fit(rig, used, drift)
        left_over = row_parallax_px(moved_rig(rig, drift), matches)
        kept = np.abs(left_over) < _WRONG_SIGMAS * max(_spread(left_over[kept]), 0.02)
    now = moved_rig(rig, drift)
    change = before[kept] - left_over[kept]
    moved_px = _rms(change)
    surprise = float(drift @ np.linalg.solve(covariance, drift))
    sd = np.sqrt(np.diag(covariance))
    return Drift(
        rig=now,
        rotation_rad=drift[:3],
        rotation_sd_rad=sd[:3],
        height_m=float(drift[3]),
        height_sd_m=float(sd[3]),
        parallax_before_px=_rms(before[kept]),
        parallax_px=_rms(left_over[kept]),
        moved_px=moved_px,
        matches=int(np.count_nonzero(kept)),
        moved=moved_px > MOVED_PX and surprise > _SURE_SIGMAS**2,
    )


def moved_rig(rig: StereoRig, drift: Float64) -> StereoRig:
    """Return a rig whose right camera has turned about its pupil by ``drift[:3]`` rad and sunk by ``drift[3]`` m."""
    geometry = rectified_geometry(rig)
    down = geometry.left.rectified_from_camera[1]
    centre = rig.right_centre_m + drift[3] * down
    centre *= rig.baseline_m / np.linalg.norm(centre)
    rotation = Rotation.from_rotvec(drift[:3]).as_matrix() @ rig.right_from_left
    turn, move = Rotation.from_matrix(rotation).as_rotvec().tolist(), (-rotation @ centre).tolist()
    return replace(rig, rotation_rad=(turn[0], turn[1], turn[2]), translation_m=(move[0], move[1], move[2]))


def row_parallax_px(rig: StereoRig, matches: FeatureMatches) -> Float64:
    """Return how much lower each point lies in the right rectified centre view than in the left one, ``(N,)`` px."""
    geometry: RectifiedGeometry = rectified_geometry(rig)
    left = rectified_places(matches.left, geometry, geometry.left.rectified_from_camera)
    right = rectified_places(matches.right, geometry, geometry.right.rectified_from_camera)
    lower: Float64 = right[:, 1] - left[:, 1]
    return lower


def _fit(rig: StereoRig, matches: FeatureMatches, start: Float64) -> tuple[Float64, Float64]:
    """Return the drift and its covariance."""
    sigma = max(_spread(row_parallax_px(moved_rig(rig, start), matches)), 0.01)

    def residual(values: Float64) -> Float64:
        rows = row_parallax_px(moved_rig(rig, values * _EXPECTED_SD), matches) / sigma
        # Huber's loss by the square root of its value, so that what is expected stays quadratic.
        size = np.abs(rows)
        outside = np.sqrt(np.maximum(2 * _CLIP_SIGMAS * size - _CLIP_SIGMAS**2, 0))
        rows = np.where(size < _CLIP_SIGMAS, rows, np.sign(rows) * outside)
        return np.concatenate([rows, values])

    found = least_squares(residual, start / _EXPECTED_SD, method="lm")
    normal = found.jac.T @ found.jac
    covariance: Float64 = np.linalg.inv(normal) * np.outer(_EXPECTED_SD, _EXPECTED_SD)
    return found.x * _EXPECTED_SD, covariance


def _spread(values: Float64) -> float:
    return _MEDIAN_TO_SD * float(np.median(np.abs(values - np.median(values))))


def _rms(values: Float64) -> float:
    return float(np.sqrt(np.mean(values**2)))
