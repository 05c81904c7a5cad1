"""Match natural features between the two cameras' centre views."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float64
from lfstereo.errors import TargetNotFoundError
from lfstereo.lightfield.field import LightField
from lfstereo.rig.corners import grey_view
from lfstereo.rig.distortion import undistort
from lfstereo.rig.geometry import RectifiedGeometry
from lfstereo.rig.rig import PlenopticCamera, StereoRig
from lfstereo.rig.view_maps import sensor_from_view

_MOST = 4000
_CONTRAST = 0.02
_RATIO = 0.8
"""A match whose second best is nearly as good is ambiguous."""
_GATE_PX = 25.0
"""Of the rectified view: how far from its row, and beyond the working range, a match may lie; 1.2 degrees."""
LEAST_MATCHES = 30


@dataclass(frozen=True, slots=True)
class FeatureMatches:
    """Directions in which both cameras see the same points of a scene."""

    left: Float64
    """``(N, 2)`` tangents x, y in left camera axes, without distortion."""
    right: Float64
    """``(N, 2)`` likewise in right camera axes."""


def match_features(left: LightField, right: LightField, rig: StereoRig, geometry: RectifiedGeometry) -> FeatureMatches:
    """Match features that lie within a degree of where a rig says that they may be.

    Raises
    ------
    TargetNotFoundError
        If fewer than 30 features match.

    References
    ----------
    Lowe, "Distinctive image features from scale-invariant keypoints" (2004): features and the test of their ratio.
    """
    ends = []
    finder = cv2.SIFT.create(nfeatures=_MOST, contrastThreshold=_CONTRAST)
    for light_field, camera in ((left, rig.left), (right, rig.right)):
        points, descriptors = finder.detectAndCompute(grey_view(light_field, *light_field.centre), None)
        if descriptors is None:
            descriptors = np.zeros((0, 128), np.float32)
        places = np.array([point.pt for point in points], np.float64).reshape(-1, 2)
        ends.append((_directions(places, light_field, camera), np.sqrt(descriptors)))
    (at_left, of_left), (at_right, of_right) = ends
    pairs = _mutual(of_left, of_right)
    at_left, at_right = at_left[pairs[:, 0]], at_right[pairs[:, 1]]
    likely = _likely(at_left, at_right, geometry)
    if np.count_nonzero(likely) < LEAST_MATCHES:
        raise TargetNotFoundError(
            f"{left.source} and {right.source}: found {np.count_nonzero(likely)} matching features, expected "
            f"{LEAST_MATCHES} or more; photograph a scene with more texture, or this is not the rig's pair"
        )
    return FeatureMatches(at_left[likely], at_right[likely])


def join_matches(parts: list[FeatureMatches]) -> FeatureMatches:
    """Return the matches of several pairs of captures as one."""
    return FeatureMatches(np.concatenate([p.left for p in parts]), np.concatenate([p.right for p in parts]))


def rectified_places(directions: Float64, geometry: RectifiedGeometry, side_from_camera: Float64) -> Float64:
    """Return where directions ``(N, 2)`` lie in a rectified view, px from its principal point."""
    turned = np.column_stack([directions, np.ones(len(directions))]) @ side_from_camera.T
    places: Float64 = geometry.focal_px * turned[:, :2] / turned[:, 2:]
    return places


def _directions(places: Float64, light_field: LightField, camera: PlenopticCamera) -> Float64:
    on_sensor = np.column_stack([places, np.ones(len(places))]) @ sensor_from_view(light_field).T
    bent = (on_sensor[:, :2] - camera.principal_px) / camera.focal_px
    return np.stack(undistort(bent[:, 0], bent[:, 1], np.asarray(camera.distortion)), axis=1)


def _mutual(left: Float64, right: Float64) -> np.ndarray[tuple[int, int], np.dtype[np.intp]]:
    """Return ``(N, 2)`` rows of features that are each other's best match, and better than the second best."""
    if min(len(left), len(right)) < 2:
        return np.zeros((0, 2), np.intp)
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    forth = [a for a, b in matcher.knnMatch(left, right, k=2) if a.distance < _RATIO * b.distance]
    back = {a.queryIdx: a.trainIdx for a in matcher.match(right, left)}
    pairs = [(a.queryIdx, a.trainIdx) for a in forth if back.get(a.trainIdx) == a.queryIdx]
    return np.array(pairs, np.intp).reshape(-1, 2)


def _likely(left: Float64, right: Float64, geometry: RectifiedGeometry) -> Bool:
    """Return which matches lie near a common row, at a disparity near the working range."""
    a = rectified_places(left, geometry, geometry.left.rectified_from_camera)
    b = rectified_places(right, geometry, geometry.right.rectified_from_camera)
    disparity = a[:, 0] - b[:, 0] - geometry.doffs_px
    inside = (disparity > -_GATE_PX) & (disparity < geometry.disparity_max_px + _GATE_PX)
    likely: Bool = inside & (np.abs(a[:, 1] - b[:, 1]) < _GATE_PX)
    return likely
