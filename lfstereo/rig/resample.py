"""Read a view between its samples, exactly where each px of a rectified view lies in it."""

from __future__ import annotations

import numba
import numpy as np

from lfstereo.arrays import Float32, Float64, UInt8

Four = tuple[np.uintp, np.uintp, np.uintp, np.uintp]
"""Offsets of four samples in a flat view."""
Shares = tuple[np.float32, np.float32, np.float32, np.float32]
_FMA = {"contract", "nsz"}
"""Products and sums in one instruction; nothing else is rearranged."""


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=_FMA)  # type: ignore[untyped-decorator]
def resample_view(
    view: Float32,
    weight: UInt8,
    picture_from_rectified: Float64,
    bend: Float64,
    view_from_picture: Float64,
    out: Float32,
    out_weight: UInt8,
) -> None:  # pragma: no cover
    """Fill a rectified view and its weight.

    Light by cubic convolution, which reproduces straight and square courses of brightness, so that nothing is shifted;
    not below 0; black where the view does not reach. Weight linearly, 0 beyond the border.

    Parameters
    ----------
    view, weight
        ``(V, U, 3)`` and ``(V, U)``, contiguous.
    picture_from_rectified, bend, view_from_picture
        The map of :class:`lfstereo.rig.view_maps.ViewMap`; the bend is that of ``distortion.distort``.
    out, out_weight
        As large as the rectified view.

    References
    ----------
    Keys, "Cubic convolution interpolation for digital image processing" (1981), equation 15.
    """
    rows, columns = view.shape[:2]
    flat = view.reshape(rows * columns * 3)
    m, n = picture_from_rectified, view_from_picture
    k1, k2, k3, b1, b2 = bend
    x, y = np.empty(out.shape[1]), np.empty(out.shape[1])
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            depth = 1 / (m[2, 0] * column + m[2, 1] * row + m[2, 2])
            off_x = (m[0, 0] * column + m[0, 1] * row + m[0, 2]) * depth - b1
            off_y = (m[1, 0] * column + m[1, 1] * row + m[1, 2]) * depth - b2
            r2 = off_x * off_x + off_y * off_y
            gain = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            picture_x, picture_y = b1 + gain * off_x, b2 + gain * off_y
            x[column] = n[0, 0] * picture_x + n[0, 1] * picture_y + n[0, 2]
            y[column] = n[1, 0] * picture_x + n[1, 1] * picture_y + n[1, 2]
        for column in range(out.shape[1]):
            if not (-0.5 <= x[column] <= columns - 0.5 and -0.5 <= y[column] <= rows - 0.5):
                out[row, column] = 0
                out_weight[row, column] = 0
                continue
            left, top = int(np.floor(x[column])), int(np.floor(y[column]))
            right, below = np.float32(x[column] - left), np.float32(y[column] - top)
            out_weight[row, column] = _linear(weight, left, top, right, below)
            across, down = _cubic(right), _cubic(below)
            at_x, at_y = _four(left, columns, 3), _four(top, rows, 3 * columns)
            for channel in range(3):
                k = np.uintp(channel)
                near = across[0] * _down(flat, at_x[0] + k, at_y, down)
                near += across[1] * _down(flat, at_x[1] + k, at_y, down)
                far = across[2] * _down(flat, at_x[2] + k, at_y, down)
                far += across[3] * _down(flat, at_x[3] + k, at_y, down)
                out[row, column, k] = max(near + far, np.float32(0))


@numba.njit(nogil=True, fastmath=_FMA)  # type: ignore[untyped-decorator]
def _down(flat: Float32, place: np.uintp, lines: Four, shares: Shares) -> np.float32:  # pragma: no cover
    """Return the light of one column of four samples."""
    upper = shares[0] * flat[place + lines[0]] + shares[1] * flat[place + lines[1]]
    lower = shares[2] * flat[place + lines[2]] + shares[3] * flat[place + lines[3]]
    return np.float32(upper + lower)


@numba.njit(nogil=True, fastmath=_FMA)  # type: ignore[untyped-decorator]
def _cubic(t: np.float32) -> Shares:  # pragma: no cover
    """Return the shares of the samples at -1, 0, 1 and 2 of a place ``t`` between 0 and 1."""
    half, t2 = np.float32(0.5), t * t
    t3 = t2 * t
    first, last = half * (t2 + t2 - t3 - t), half * (t3 - t2)
    second = half * (np.float32(3) * t3 - np.float32(5) * t2) + np.float32(1)
    third = half * (np.float32(4) * t2 + t - np.float32(3) * t3)
    return first, second, third, last


@numba.njit(nogil=True)  # type: ignore[untyped-decorator]
def _four(start: int, count: int, step: int) -> Four:  # pragma: no cover
    """Return where the samples from ``start - 1`` to ``start + 2`` lie, those beyond the border at the border."""
    last = count - 1
    before, at = np.uintp(max(start - 1, 0) * step), np.uintp(max(start, 0) * step)
    return before, at, np.uintp(min(start + 1, last) * step), np.uintp(min(start + 2, last) * step)


@numba.njit(nogil=True, fastmath=_FMA)  # type: ignore[untyped-decorator]
def _linear(weight: UInt8, left: int, top: int, right: np.float32, below: np.float32) -> np.uint8:  # pragma: no cover
    """Return the weight between four samples, 0 beyond the border."""
    rows, columns = weight.shape
    total, one = np.float32(0), np.float32(1)
    for j in range(2):
        for i in range(2):
            x, y = left + i, top + j
            if 0 <= x < columns and 0 <= y < rows:
                total += (right if i else one - right) * (below if j else one - below) * np.float32(weight[y, x])
    return np.uint8(total + np.float32(0.5))
