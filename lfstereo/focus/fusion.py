"""One picture that is sharp everywhere, from slices that are each sharp at one depth."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32, Rgb
from lfstereo.errors import ShapeError

_LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Weights of linear RGB in luminance, ITU-R BT.709."""
_SMALLEST_PX = 8
_SHARPNESS_POWER = 4.0
_TINY = 1e-20


def fuse_slices(slices: Float32) -> Rgb:
    """Return what is sharpest in any slice, scale by scale, as one picture.

    Each slice is parted into details of twice the size from level to level. At each level and place the slices count
    by the fourth power of the contrast of their details there, so the one in focus decides; the rest, coarser than
    all levels, is their mean. The picture is not clipped.

    Parameters
    ----------
    slices
        ``(K, V, U, 3)`` linear RGB.

    Raises
    ------
    ShapeError
        If there is no slice, or they are no colour pictures.

    References
    ----------
    Burt and Kolczynski, "Enhanced image capture through fusion" (1993); Burt and Adelson, "The Laplacian pyramid as a
    compact image code" (1983).

    Examples
    --------
    >>> sharp = np.random.default_rng(0).random((32, 32, 3), dtype=np.float32)
    >>> bool(np.allclose(fuse_slices(np.stack([sharp, sharp])), sharp, atol=1e-5))
    True
    """
    if slices.ndim != 4 or slices.shape[0] < 1 or slices.shape[3] != 3:
        raise ShapeError(f"slices: found an array of shape {slices.shape}, expected (K, V, U, 3) with at least one")
    levels = max(0, int(np.log2(max(min(slices.shape[1:3]) / _SMALLEST_PX, 1))))
    pyramids = [_details(slice_, levels) for slice_ in slices]
    picture: Float32 = np.mean(np.stack([pyramid[-1] for pyramid in pyramids]), axis=0)
    for level in reversed(range(levels)):
        details = np.stack([pyramid[level] for pyramid in pyramids])
        contrast = np.stack([_contrast(detail) for detail in details])
        share = (contrast / np.maximum(contrast.max(axis=0), _TINY)) ** _SHARPNESS_POWER + np.float32(_TINY)
        share /= share.sum(axis=0)
        picture = _larger(picture, details.shape[1:3]) + np.einsum("kvu,kvuc->vuc", share, details)
    fused: Rgb = np.maximum(picture, 0).astype(np.float32)
    return fused


def _details(picture: Float32, levels: int) -> list[Float32]:
    """Return the Laplacian pyramid, finest first, with the coarsest picture at the end."""
    parts = []
    current = np.ascontiguousarray(picture)
    for _ in range(levels):
        smaller = np.asarray(cv2.pyrDown(current), np.float32)
        parts.append(current - _larger(smaller, current.shape[:2]))
        current = smaller
    return [*parts, current]


def _larger(picture: Float32, size: tuple[int, ...]) -> Float32:
    larger: Float32 = np.asarray(cv2.pyrUp(picture, dstsize=(size[1], size[0])), np.float32)
    return larger


def _contrast(detail: Float32) -> Float32:
    """Return the energy of the details around each px, ``(V, U)``."""
    energy: Float32 = cv2.GaussianBlur((detail @ _LUMA) ** 2, (0, 0), 1.5)
    return np.maximum(energy, 0)
