"""Nayar 1992: the modified Laplacian as a measure of focus, and the peak between slices by a Gaussian."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32, Rgb

LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Weights of linear RGB in luminance, ITU-R BT.709."""
_LEAST_LUMA = 1e-3
TINY = 1e-12


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

    References
    ----------
    Nayar, "Shape from focus system" (CVPR 1992), the modified Laplacian and its sum over a window; Nayar and Nakagawa,
    "Shape from focus" (1994), equations 10 to 12.

    Examples
    --------
    A dot e times brighter than the rest bends by 2 along each axis.

    >>> dot = np.ones((5, 5, 3), np.float32)
    >>> dot[2, 2] = np.e
    >>> round(float(modified_laplacian(dot)[2, 2]), 4)
    4.0
    """
    luma = np.log(np.maximum(picture @ LUMA, _LEAST_LUMA))
    if blur_px > 0:
        luma = cv2.GaussianBlur(luma, (0, 0), blur_px)
    kernel = np.array([[-1.0, 2.0, -1.0]], np.float32)
    bent = np.abs(cv2.filter2D(luma, -1, kernel)) + np.abs(cv2.filter2D(luma, -1, kernel.T))
    averaged: Float32 = cv2.blur(bent, (window_px, window_px))
    return averaged


def gaussian_peak(sharpness: Float32) -> Float32:
    """Return the slice, between slices fractional, at which a Gaussian through the three largest values peaks.

    Parameters
    ----------
    sharpness
        ``(K, V, U)``, slices one apart. Where the first or the last is the largest, and with two slices, there is
        nothing to fit, and that slice is the answer.

    References
    ----------
    Nayar and Nakagawa, "Shape from focus" (1994), equation 17.

    Examples
    --------
    >>> curve = np.exp(-((np.arange(4) - 1.25) ** 2)).astype(np.float32)
    >>> round(float(gaussian_peak(curve[:, None, None])[0, 0]), 4)
    1.25
    """
    last = len(sharpness) - 1
    best = sharpness.argmax(axis=0)
    if last < 2:
        whole: Float32 = best.astype(np.float32)
        return whole
    middle = np.clip(best, 1, last - 1)
    before, at, after = (
        np.log(np.maximum(np.take_along_axis(sharpness, (middle + k)[None], axis=0)[0], TINY)) for k in (-1, 0, 1)
    )
    bend = 2 * at - before - after
    offset = np.where(bend > 1e-6, 0.5 * (after - before) / np.maximum(bend, 1e-6), 0.0)
    inner = (best > 0) & (best < last)
    peak: Float32 = np.where(inner, middle + np.clip(offset, -0.5, 0.5), best).astype(np.float32)
    return peak
