"""Bring the pictures of a focus sweep to coincide: focus breathing (scale) and shake (shift), or any homography."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float32, Float64
from lfstereo.errors import AlignmentError, ConfigError
from lfstereo.focus.evangelidis2008 import align_homography, align_scale, correlation_of
from lfstereo.focus.nayar1992 import LUMA
from lfstereo.focus.sweep import FocusSweep
from lfstereo.options import option
from lfstereo.progress import Progress, silent

LEAST_CORRELATION = 0.7
"""Of two neighbours that coincide; different scenes reach about half of it."""
GOOD_CORRELATION = 0.95
"""Below it, features are asked for another start."""
LARGEST_SCALE = 1.3
LARGEST_SHIFT_SHARE = 0.3
"""Of the picture's width, between neighbours."""
_WORKING_WIDTH_PX = 1000
_COARSEST_PX = 60
_STILL_PX = 0.05
"""A picture that moves less anywhere is left as it is: resampling would cost more than it mends."""
_LEAST_GAIN = 0.1
"""Of what neighbours lack in correlation, that a transform must mend; a change of blur alone leaves about so much."""
_LEAST_MATCHES = 12
_RATIO = 0.75
_RANSAC_PX = 2.0

Model = Literal["none", "scale", "homography"]


@dataclass(frozen=True, slots=True)
class AlignOptions:
    """How the pictures of a sweep are brought to coincide."""

    align: Model = option("scale", "what may have changed between pictures: scale and shift, or a homography")
    even_exposure: bool = option(True, "bring all pictures to the mean brightness of the middle one")


@dataclass(frozen=True, slots=True)
class AlignedSweep:
    """A sweep whose pictures coincide with its middle one."""

    sweep: FocusSweep
    slice_from_reference: Float64
    """``(K, 3, 3)`` from px of the middle slice to px of each slice as it was read."""
    seen: Bool
    """``(V, U)``: inside every picture."""
    gains: Float64
    """``(K,)`` what each picture was multiplied by."""
    correlation: Float64
    """``(K - 1,)`` of neighbours after alignment, 1 = equal; ones where nothing was aligned."""

    @property
    def moved_px(self) -> Float64:
        """``(K,)`` largest distance in px that a corner of each slice was moved by."""
        _, rows, columns, _ = self.sweep.slices.shape
        return np.array([_reach_px(transform, (rows, columns)) for transform in self.slice_from_reference])


def align_sweep(sweep: FocusSweep, options: AlignOptions = AlignOptions(), progress: Progress = silent) -> AlignedSweep:
    """Resample every picture of a sweep to the middle one.

    Neighbours, whose blur is most alike, are aligned to each other by the enhanced correlation coefficient from coarse
    to fine; the middle picture's transforms are their products. Where neighbours do not come to coincide from where
    they are, SIFT features give another start.

    Parameters
    ----------
    sweep
        Two pictures or more.
    options
        What may have changed between pictures.
    progress
        Told the pictures aligned.

    Raises
    ------
    AlignmentError
        If two neighbours cannot be brought to coincide, or no part of the scene is in all pictures.
    ConfigError
        If the model is unknown.
    """
    if options.align not in ("none", "scale", "homography"):
        raise ConfigError(f"align = {options.align!r}, expected none, scale or homography")
    count, columns = len(sweep.slices), sweep.slices.shape[2]
    steps, correlation = np.tile(np.eye(3), (count - 1, 1, 1)), np.ones(count - 1)
    if options.align != "none":
        shrink = min(1.0, _WORKING_WIDTH_PX / columns)
        pictures = [_working_picture(slice_, shrink) for slice_ in sweep.slices]
        for k in range(count - 1):
            where = f"{sweep.source}: {sweep.names[k]} and {sweep.names[k + 1]}"
            found, correlation[k] = _aligned(pictures[k], pictures[k + 1], options.align, where)
            steps[k] = _rescaled(found, shrink)
            progress(k + 1, count)
    transforms = _chained(steps)
    slices, seen = _resampled(sweep.slices, transforms)
    if not seen.any():
        raise AlignmentError(f"{sweep.source}: no part of the scene is in all pictures; leave the outer ones out")
    gains = _even(slices, seen) if options.even_exposure else np.ones(count)
    progress(count, count)
    return AlignedSweep(replace(sweep, slices=slices), transforms, seen, gains, correlation)


def _aligned(template: Float32, moved: Float32, model: Model, where: str) -> tuple[Float64, float]:
    """Return the ``(3, 3)`` map from the template's px to the moved picture's, and their correlation."""
    found, correlation = _coarse_to_fine(template, moved, model, np.eye(3))
    if correlation < GOOD_CORRELATION:
        start = _from_features(template, moved)
        if start is not None:
            other, reached = _coarse_to_fine(template, moved, model, start)
            if reached > correlation:
                found, correlation = other, reached
    still = correlation_of(template, moved)
    if 1 - correlation > (1 - _LEAST_GAIN) * (1 - still):
        found, correlation = np.eye(3), still
    scale = float(np.sqrt(abs(np.linalg.det(found[:2, :2]))))
    centre = np.array([(template.shape[1] - 1) / 2, (template.shape[0] - 1) / 2, 1.0])
    place = found @ centre
    shift = float(np.hypot(*(place[:2] / place[2] - centre[:2]))) / template.shape[1]
    if correlation < LEAST_CORRELATION or not 1 / LARGEST_SCALE < scale < LARGEST_SCALE or shift > LARGEST_SHIFT_SHARE:
        raise AlignmentError(
            f"{where}: cannot be brought to coincide (correlation {correlation:.2f} at scale {scale:.3f} and a shift "
            f"of {shift:.0%} of the width), expected {LEAST_CORRELATION:.2f} or more at scale 1/{LARGEST_SCALE:g} to "
            f"{LARGEST_SCALE:g} and up to {LARGEST_SHIFT_SHARE:.0%}; leave one out, or use a tripod"
        )
    return found, correlation


def _coarse_to_fine(template: Float32, moved: Float32, model: Model, start: Float64) -> tuple[Float64, float]:
    find = align_homography if model == "homography" else align_scale
    levels = max(1, int(np.log2(min(template.shape) / _COARSEST_PX)) + 1)
    found, correlation = start, -1.0
    for level in reversed(range(levels)):
        shrink = 0.5**level
        size = (round(template.shape[1] * shrink), round(template.shape[0] * shrink))
        pair = [cv2.resize(p, size, interpolation=cv2.INTER_AREA) if level else p for p in (template, moved)]
        coarse = _rescaled(found, 1 / shrink)
        better, correlation = find(pair[0], pair[1], coarse)
        found = _rescaled(better, shrink)
    return found, correlation


def _from_features(template: Float32, moved: Float32) -> Float64 | None:
    """Return a start from SIFT features that agree on a similarity, or ``None`` without enough of them."""
    sift = cv2.SIFT.create(4000)
    coded = [cv2.normalize(p, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8) for p in (template, moved)]
    (points, words), (others, other_words) = (sift.detectAndCompute(picture, None) for picture in coded)
    if words is None or other_words is None or min(len(points), len(others)) < _LEAST_MATCHES:
        return None
    pairs = cv2.BFMatcher().knnMatch(words, other_words, k=2)
    good = [a for a, b in (pair for pair in pairs if len(pair) == 2) if a.distance < _RATIO * b.distance]
    if len(good) < _LEAST_MATCHES:
        return None
    here = np.array([points[m.queryIdx].pt for m in good], np.float32)
    there = np.array([others[m.trainIdx].pt for m in good], np.float32)
    found, agreed = cv2.estimateAffinePartial2D(here, there, method=cv2.RANSAC, ransacReprojThreshold=_RANSAC_PX)
    if found is None or int(agreed.sum()) < _LEAST_MATCHES:
        return None
    return np.vstack([found, [0.0, 0.0, 1.0]])


def _working_picture(slice_: Float32, shrink: float) -> Float32:
    """Return ``(V, U)`` the square root of luminance, in which light and dark texture count alike."""
    root = np.sqrt(np.maximum(slice_ @ LUMA, 0.0))
    if shrink < 1:
        size = (round(root.shape[1] * shrink), round(root.shape[0] * shrink))
        root = cv2.resize(root, size, interpolation=cv2.INTER_AREA)
    return np.asarray(root, np.float32)


def _rescaled(transform: Float64, shrink: float) -> Float64:
    """Return the same transform in px of a picture that is ``1 / shrink`` as large; px centres lie at integers."""
    small_from_large = np.array([[shrink, 0, (shrink - 1) / 2], [0, shrink, (shrink - 1) / 2], [0, 0, 1]])
    moved: Float64 = np.linalg.inv(small_from_large) @ transform @ small_from_large
    moved /= moved[2, 2]
    return moved


def _chained(steps: Float64) -> Float64:
    """Return ``(K, 3, 3)`` slice from middle slice, of the ``(K - 1, 3, 3)`` next slice from slice."""
    count = len(steps) + 1
    middle = count // 2
    transforms = np.tile(np.eye(3), (count, 1, 1))
    for k in range(middle + 1, count):
        transforms[k] = steps[k - 1] @ transforms[k - 1]
    for k in range(middle - 1, -1, -1):
        transforms[k] = np.linalg.inv(steps[k]) @ transforms[k + 1]
    transforms /= transforms[:, 2:, 2:]
    return transforms


def _reach_px(transform: Float64, size: tuple[int, int]) -> float:
    rows, columns = size
    corners = np.array([[0, 0, 1], [columns - 1, 0, 1], [0, rows - 1, 1], [columns - 1, rows - 1, 1]], np.float64).T
    places = transform @ corners
    return float(np.hypot(*(places[:2] / places[2] - corners[:2])).max())


def _resampled(slices: Float32, transforms: Float64) -> tuple[Float32, Bool]:
    _, rows, columns, _ = slices.shape
    moved, seen = np.empty_like(slices), np.ones((rows, columns), np.bool_)
    whole = np.full((rows, columns), 255, np.uint8)
    inverse = cv2.WARP_INVERSE_MAP
    for k, transform in enumerate(transforms):
        if _reach_px(transform, (rows, columns)) < _STILL_PX:
            moved[k] = slices[k]
            continue
        size = (columns, rows)
        cv2.warpPerspective(slices[k], transform, size, moved[k], cv2.INTER_LANCZOS4 | inverse, cv2.BORDER_REPLICATE)
        seen &= cv2.warpPerspective(whole, transform, size, flags=cv2.INTER_LINEAR | inverse) == 255
    return np.maximum(moved, 0.0, out=moved), seen


def _even(slices: Float32, seen: Bool) -> Float64:
    """Multiply every slice so that its mean brightness where all see is that of the middle one, in place."""
    brightness = np.array([float((slice_ @ LUMA)[seen].mean()) for slice_ in slices])
    gains = np.where(brightness > 0, brightness[len(slices) // 2] / np.maximum(brightness, 1e-9), 1.0)
    slices *= gains.astype(np.float32)[:, None, None, None]
    return gains
