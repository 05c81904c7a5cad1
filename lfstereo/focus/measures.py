"""Classical depth from focus: what one focal stack tells without a network."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from lfstereo.arrays import Float32, Rgb
from lfstereo.errors import ConfigError, ShapeError
from lfstereo.focus.stack import FocalStack
from lfstereo.options import option

_LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Weights of linear RGB in luminance, ITU-R BT.709."""
_LEAST_LUMA = 1e-3
_TINY = 1e-12


@dataclass(frozen=True, slots=True)
class FocusOptions:
    """How focus is measured and how far neighbours are asked."""

    blur_px: float = option(1.0, "Gaussian blur before the measure, against noise; 0: none", "px")
    window_px: int = option(3, "side of the window in which sharpness is summed, odd", "px")
    radius_px: int = option(8, "radius of the guided filter on the measure; 0: none", "px")
    edge_share: float = option(0.03, "change of brightness, of white, across which neighbours are not asked")


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
    """Find the slice in focus for every pixel of one stack.

    The sum-modified Laplacian of the logarithm of luminance is summed over a window, taken as a share of the
    pixel's largest, averaged over neighbours of like colour by a guided filter, and the three values around its
    largest are fitted by a Gaussian. The guide is the all-in-focus picture that the measure gives by itself.

    Parameters
    ----------
    stack
        Slices of one camera.
    options
        Window and neighbourhood.

    Raises
    ------
    ShapeError
        If there are fewer than three slices.
    ConfigError
        If an option is not possible.

    References
    ----------
    Nayar and Nakagawa, "Shape from focus" (1994), equations 10 to 12 and 17; He, Sun, Tang, "Guided image
    filtering" (2010), equations 5 to 8; Hosni, Rhemann, Bleyer, Rother, Gelautz, "Fast cost-volume filtering for
    visual correspondence and beyond" (2013).
    """
    _check(stack, options)
    sharpness = np.stack([modified_laplacian(slice_, options.window_px, options.blur_px) for slice_ in stack.slices])
    confidence = (1.0 - sharpness.mean(axis=0) / np.maximum(sharpness.max(axis=0), _TINY)).astype(np.float32)
    index = _gaussian_peak(sharpness)
    if options.radius_px > 0:
        sharpness /= np.maximum(sharpness.max(axis=0), _TINY)
        index = _gaussian_peak(_guided(sharpness, blend_slices(stack, index), options))
    disparity = np.interp(index.ravel(), np.arange(len(stack.slices)), stack.disparities_px).reshape(index.shape)
    return FocusMap(index, disparity.astype(np.float32), confidence, blend_slices(stack, index))


def modified_laplacian(picture: Rgb, window_px: int = 1, blur_px: float = 0.0) -> Float32:
    """Return the sum-modified Laplacian ``|2 L(x) - L(x-1) - L(x+1)| + |...y...|`` of log luminance, ``(V, U)``.

    The logarithm makes the measure blind to exposure: a dark and a bright copy of a texture are equally sharp.

    Parameters
    ----------
    picture
        ``(V, U, 3)`` linear RGB.
    window_px
        Side of the window over which it is averaged.
    blur_px
        Sigma of a Gaussian blur of the logarithm beforehand.

    Examples
    --------
    A dot e times brighter than the rest bends by 2 along each axis.

    >>> dot = np.ones((5, 5, 3), np.float32)
    >>> dot[2, 2] = np.e
    >>> round(float(modified_laplacian(dot)[2, 2]), 4)
    4.0
    """
    luma = np.log(np.maximum(picture @ _LUMA, _LEAST_LUMA))
    if blur_px > 0:
        luma = cv2.GaussianBlur(luma, (0, 0), blur_px)
    kernel = np.array([[-1.0, 2.0, -1.0]], np.float32)
    bent = np.abs(cv2.filter2D(luma, -1, kernel)) + np.abs(cv2.filter2D(luma, -1, kernel.T))
    averaged: Float32 = cv2.blur(bent, (window_px, window_px))
    return averaged


def blend_slices(stack: FocalStack, slice_index: Float32) -> Rgb:
    """Return ``(V, U, 3)`` the picture that shows each pixel from the two slices around its fractional index."""
    lower = np.clip(np.floor(slice_index), 0, len(stack.slices) - 2).astype(np.intp)
    share = np.clip(slice_index - lower, 0.0, 1.0).astype(np.float32)[..., None]
    v, u = np.indices(slice_index.shape)
    blended: Rgb = (1 - share) * stack.slices[lower, v, u] + share * stack.slices[lower + 1, v, u]
    return blended


def _gaussian_peak(sharpness: Float32) -> Float32:
    """Nayar and Nakagawa (1994), equation 17, on a grid of slices one apart."""
    last = len(sharpness) - 1
    best = sharpness.argmax(axis=0)
    middle = np.clip(best, 1, last - 1)
    before, at, after = (
        np.log(np.maximum(np.take_along_axis(sharpness, (middle + k)[None], axis=0)[0], _TINY)) for k in (-1, 0, 1)
    )
    bend = 2 * at - before - after
    offset = np.where(bend > 1e-6, 0.5 * (after - before) / np.maximum(bend, 1e-6), 0.0)
    inner = (best > 0) & (best < last)
    peak: Float32 = np.where(inner, middle + np.clip(offset, -0.5, 0.5), best).astype(np.float32)
    return peak


def _guided(sharpness: Float32, guide: Rgb, options: FocusOptions) -> Float32:
    smoother = cv2.ximgproc.createGuidedFilter(np.sqrt(np.clip(guide, 0.0, 1.0)), options.radius_px, options.edge_share)
    averaged: Float32 = np.stack([smoother.filter(slice_) for slice_ in sharpness])
    return averaged


def _check(stack: FocalStack, options: FocusOptions) -> None:
    if len(stack.slices) < 3:
        raise ShapeError(
            f"{stack.source}: found {len(stack.slices)} slices, expected 3 or more to find the sharpest of"
        )
    if options.window_px < 1 or options.window_px % 2 == 0:
        raise ConfigError(f"window_px = {options.window_px}: expected an odd number of px, 1 or more")
    for name, low in (("blur_px", options.blur_px), ("radius_px", options.radius_px)):
        if not 0 <= low < np.inf:
            raise ConfigError(f"{name} = {low}: expected 0 px or more")
    if not 0 < options.edge_share < np.inf:
        raise ConfigError(f"edge_share = {options.edge_share}: expected a share above 0")
