"""Classical depth from focus: what the slices of one camera tell without a network."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float32, Rgb
from lfstereo.errors import ConfigError, ShapeError
from lfstereo.focus.hosni2013 import guided_volume
from lfstereo.focus.min2014 import globally_smoothed_volume
from lfstereo.focus.moeller2015 import variational_peak
from lfstereo.focus.nayar1992 import TINY, gaussian_peak, modified_laplacian
from lfstereo.focus.stack import FocalStack
from lfstereo.options import option

CONFIDENCE_PX = 9
"""Side of the window over which the sharpness is averaged to judge how far its peak stands out."""
_CODE_SHARPNESS = 2e-3
"""What rounding to 8 bits leaves of sharpness: a step of sRGB, 1 to 2 percent of the light, blurred by 1 px."""
_NOISE_PX = 96
_NOISE_SHARE = 0.999

Method = Literal["nayar1992", "hosni2013", "min2014", "moeller2015"]
METHODS: tuple[Method, ...] = ("nayar1992", "hosni2013", "min2014", "moeller2015")


@dataclass(frozen=True, slots=True)
class FocusOptions:
    """How focus is measured and how far neighbours are asked."""

    method: Method = option(
        "min2014",
        "nayar1992: each window alone; hosni2013, min2014: sharpness smoothed along edges by a guided filter or by "
        "fast global smoothing; moeller2015: total variation of the slice",
    )
    blur_px: float = option(1.0, "Gaussian blur before the measure, against noise; 0: none", "px")
    window_px: int = option(9, "side of the window in which sharpness is summed, odd", "px")
    radius_px: int = option(16, "how far all but nayar1992 ask neighbours; 0: not at all", "px")
    edge_share: float = option(0.03, "change of brightness, of white, across which neighbours are not asked")
    tv_strength: float = option(0.1, "moeller2015: cost of an edge of one slice, per px of its length")
    iterations: int = option(200, "moeller2015: steps of the descent")


@dataclass(frozen=True, slots=True)
class FocusIndex:
    """Which slice shows each pixel sharp."""

    slice_index: Float32
    """``(V, U)`` slice in focus, 0 = first, between slices fractional."""
    confidence: Float32
    """``(V, U)`` 0 to 1: how far the sharpest slice stands out from the mean of the others."""
    valid: Bool
    """``(V, U)``: the confidence is more than noise alone reaches in all but 1 of 1000 pixels."""
    all_in_focus: Rgb
    """``(V, U, 3)`` linear RGB, each pixel from the slices around the one in focus."""


@dataclass(frozen=True, slots=True)
class FocusMap:
    """What one stack tells about depth."""

    slice_index: Float32
    """``(V, U)`` slice in focus, 0 = nearest, between slices fractional."""
    disparity: Float32
    """``(V, U)`` px, the disparity at which that slice is focused."""
    confidence: Float32
    """``(V, U)`` 0 to 1: how far the sharpest slice stands out from the mean of the others."""
    all_in_focus: Rgb
    """``(V, U, 3)`` linear RGB, each pixel from the slices around the one in focus."""


def depth_from_focus(stack: FocalStack, options: FocusOptions = FocusOptions()) -> FocusMap:
    """Find the slice in focus for every pixel of one stack, and the disparity it is focused at.

    Parameters
    ----------
    stack
        Slices of one camera, three or more.
    options
        Method, window and neighbourhood.

    Raises
    ------
    ShapeError
        If there are fewer than three slices.
    ConfigError
        If an option is not possible.
    """
    if len(stack.slices) < 3:
        raise ShapeError(
            f"{stack.source}: found {len(stack.slices)} slices, expected 3 or more to find the sharpest of"
        )
    found = find_focus(stack.slices, options)
    index = found.slice_index
    disparity = np.interp(index.ravel(), np.arange(len(stack.slices)), stack.disparities_px).reshape(index.shape)
    return FocusMap(index, disparity.astype(np.float32), found.confidence, found.all_in_focus)


def find_focus(slices: Float32, options: FocusOptions = FocusOptions()) -> FocusIndex:
    """Find the slice in focus for every pixel.

    The sum-modified Laplacian of the logarithm of luminance is averaged over a window. ``nayar1992`` fits a Gaussian to
    the three values around its largest. ``hosni2013`` and ``min2014`` first take it as a share of the pixel's largest
    and average it over neighbours of like colour; the picture whose edges they keep is the all-in-focus one that the
    measure gives by itself. ``moeller2015`` begins with
    what ``min2014`` finds and asks for the sharpest slices that change little from pixel to pixel.

    Parameters
    ----------
    slices
        ``(K, V, U, 3)`` linear RGB in the order of their focus. Two are told apart, but nothing between them.
    options
        Method, window and neighbourhood.

    Raises
    ------
    ShapeError
        If there are fewer than two slices.
    ConfigError
        If an option is not possible.

    References
    ----------
    Nayar, "Shape from focus system" (CVPR 1992), and those of the modules named like the methods.
    """
    _check(slices, options)
    sharpness = np.stack([modified_laplacian(slice_, options.window_px, options.blur_px) for slice_ in slices])
    confidence = _confidence(sharpness)
    valid = confidence > _noise_confidence(len(slices), options.window_px, options.blur_px)
    index = _peak(sharpness, slices, options)
    return FocusIndex(index, confidence, valid, blend_slices(slices, index))


def blend_slices(slices: Float32, slice_index: Float32) -> Rgb:
    """Return ``(V, U, 3)`` the picture that shows each pixel from the two slices around its fractional index."""
    lower = np.clip(np.floor(slice_index), 0, len(slices) - 2).astype(np.intp)
    share = np.clip(slice_index - lower, 0.0, 1.0).astype(np.float32)[..., None]
    v, u = np.indices(slice_index.shape)
    blended: Rgb = (1 - share) * slices[lower, v, u] + share * slices[lower + 1, v, u]
    return blended


def _peak(sharpness: Float32, slices: Float32, options: FocusOptions) -> Float32:
    index = gaussian_peak(sharpness)
    if options.method != "nayar1992" and options.radius_px > 0:
        shares = sharpness / np.maximum(sharpness.max(axis=0), TINY)
        guide = blend_slices(slices, index)
        smooth = guided_volume if options.method == "hosni2013" else globally_smoothed_volume
        index = gaussian_peak(smooth(shares, guide, options.radius_px, options.edge_share))
    if options.method == "moeller2015" and len(slices) > 2:
        index = variational_peak(sharpness, index, options.tv_strength, options.iterations)
    return index


def _confidence(sharpness: Float32) -> Float32:
    averaged = np.stack([cv2.blur(slice_, (CONFIDENCE_PX, CONFIDENCE_PX)) for slice_ in sharpness])
    largest = averaged.max(axis=0)
    confidence: Float32 = ((largest - averaged.mean(axis=0)) / (largest + _CODE_SHARPNESS)).astype(np.float32)
    return confidence


@cache
def _noise_confidence(count: int, window_px: int, blur_px: float) -> float:
    """Return the confidence that white noise reaches in 1 of 1000 pixels; its strength does not matter."""
    rng = np.random.default_rng(0)
    pictures = np.exp(0.1 * rng.standard_normal((count, _NOISE_PX, _NOISE_PX, 1)))
    slices = np.repeat(0.1 * pictures, 3, axis=3).astype(np.float32)
    sharpness = np.stack([modified_laplacian(slice_, window_px, blur_px) for slice_ in slices])
    return float(np.quantile(_confidence(sharpness), _NOISE_SHARE))


def _check(slices: Float32, options: FocusOptions) -> None:
    if slices.ndim != 4 or slices.shape[3] != 3 or len(slices) < 2:
        raise ShapeError(f"slices: found an array of shape {slices.shape}, expected (K, V, U, 3) with two or more")
    if options.method not in METHODS:
        raise ConfigError(f"method = {options.method!r}, expected one of {', '.join(METHODS)}")
    if options.window_px < 1 or options.window_px % 2 == 0:
        raise ConfigError(f"window_px = {options.window_px}: expected an odd number of px, 1 or more")
    if options.iterations < 1:
        raise ConfigError(f"iterations = {options.iterations}: expected 1 or more")
    for name, low in (("blur_px", options.blur_px), ("radius_px", options.radius_px)):
        if not 0 <= low < np.inf:
            raise ConfigError(f"{name} = {low}: expected 0 px or more")
    for name, share in (("edge_share", options.edge_share), ("tv_strength", options.tv_strength)):
        if not 0 < share < np.inf:
            raise ConfigError(f"{name} = {share}: expected a number above 0")
