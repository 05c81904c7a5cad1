"""Read a view between its samples, exactly where each px of a rectified view lies in it."""

from __future__ import annotations

import numba
import numpy as np

from lfstereo.arrays import Float32, Float64, UInt8


@numba.njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator]
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
        ``(V, U, 3)`` and ``(V, U)``.
    picture_from_rectified, bend, view_from_picture
        The map of :class:`lfstereo.rig.view_maps.ViewMap`; the bend is that of ``distortion.distort``.
    out, out_weight
        As large as the rectified view.

    References
    ----------
    Keys, "Cubic convolution interpolation for digital image processing" (1981), equation 15.
    """
    rows, columns = view.shape[:2]
    m, n = picture_from_rectified, view_from_picture
    k1, k2, k3, b1, b2 = bend
    across, down = np.empty(4, np.float32), np.empty(4, np.float32)
    at_x, at_y = np.empty(4, np.uintp), np.empty(4, np.uintp)
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            depth = m[2, 0] * column + m[2, 1] * row + m[2, 2]
            off_x = (m[0, 0] * column + m[0, 1] * row + m[0, 2]) / depth - b1
            off_y = (m[1, 0] * column + m[1, 1] * row + m[1, 2]) / depth - b2
            r2 = off_x * off_x + off_y * off_y
            gain = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            picture_x, picture_y = b1 + gain * off_x, b2 + gain * off_y
            x = n[0, 0] * picture_x + n[0, 1] * picture_y + n[0, 2]
            y = n[1, 0] * picture_x + n[1, 1] * picture_y + n[1, 2]
            if not (-0.5 <= x <= columns - 0.5 and -0.5 <= y <= rows - 0.5):
                out[row, column] = 0
                out_weight[row, column] = 0
                continue
            left, top = int(np.floor(x)), int(np.floor(y))
            out_weight[row, column] = _linear(weight, left, top, x - left, y - top)
            _cubic(np.float32(x - left), across)
            _cubic(np.float32(y - top), down)
            for k in range(4):
                at_x[k] = np.uintp(min(max(left - 1 + k, 0), columns - 1))
                at_y[k] = np.uintp(min(max(top - 1 + k, 0), rows - 1))
            red, green, blue = np.float32(0), np.float32(0), np.float32(0)
            for j in range(4):
                for i in range(4):
                    share = down[j] * across[i]
                    red += share * view[at_y[j], at_x[i], 0]
                    green += share * view[at_y[j], at_x[i], 1]
                    blue += share * view[at_y[j], at_x[i], 2]
            out[row, column, 0] = max(red, np.float32(0))
            out[row, column, 1] = max(green, np.float32(0))
            out[row, column, 2] = max(blue, np.float32(0))


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _cubic(t: np.float32, shares: Float32) -> None:  # pragma: no cover
    """Fill the shares of the samples at -1, 0, 1 and 2 of a place ``t`` between 0 and 1."""
    half, t2 = np.float32(0.5), t * t
    t3 = t2 * t
    shares[0] = half * (-t3 + t2 + t2 - t)
    shares[1] = half * (3 * t3 - 5 * t2) + 1
    shares[2] = half * (-3 * t3 + 4 * t2 + t)
    shares[3] = half * (t3 - t2)


@numba.njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _linear(weight: UInt8, left: int, top: int, right: float, below: float) -> np.uint8:  # pragma: no cover
    """Return the weight between four samples, 0 beyond the border."""
    rows, columns = weight.shape
    total = 0.0
    for j in range(2):
        for i in range(2):
            x, y = left + i, top + j
            if 0 <= x < columns and 0 <= y < rows:
                total += (right if i else 1 - right) * (below if j else 1 - below) * weight[y, x]
    return np.uint8(total + 0.5)
