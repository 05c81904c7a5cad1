"""Measure every micro-image's centre by fitting the mean micro-image to it."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.lenslet.profile import BINS_PER_PIXEL, MicroImage


@dataclass(frozen=True, slots=True)
class Centres:
    """Centres of micro-images as measured, against where a lattice expected them."""

    displacement: Float64
    """``(N, 2)`` (x, y) px from the expected to the measured centre."""
    amplitude: Float64
    """``(N,)`` brightness relative to the mean micro-image."""
    misfit: Float64
    """``(N,)`` RMS of what the fit leaves, relative to the amplitude."""


def measure_centres(
    flat: Float32, expected: Float64, micro_image: MicroImage, radius_px: float, shading_per_px: float
) -> Centres:
    """Fit brightness, displacement and a brightness slope to each micro-image.

    Around an expected centre the frame is modelled to first order as
    ``a V(x) - a (d . grad V)(x) + (g . x) V(x)`` with the mean micro-image ``V``, solved by linear least
    squares. The slope ``g`` takes up shading across the micro-image (the scene's, or the main lens's cos^4
    law), which would pull a plain centroid off the centre.

    Parameters
    ----------
    flat
        ``(H, W)`` evened-out frame.
    expected
        ``(N, 2)`` expected centres (x, y), px, at least ``radius_px + 1`` inside the frame.
    micro_image
        Mean micro-image of this frame.
    radius_px
        Pixels within this distance of the expected centre are used.
    shading_per_px
        Typical relative brightness change per px across a micro-image; keeps the fit from explaining the noise and
        the detail of a photograph by shading. A lens at f/2 and 20 mm has up to 0.03 in the corners of the sensor.
    """
    rows = _fit_all(flat, expected, micro_image.fit_terms(), float(radius_px), float(shading_per_px))
    return Centres(displacement=rows[:, :2], amplitude=rows[:, 2], misfit=rows[:, 3])


@numba.njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator]
def _fit_all(
    flat: Float32, expected: Float64, table: Float32, radius: float, shading: float
) -> Float64:  # pragma: no cover
    count = expected.shape[0]
    out = np.zeros((count, 4))
    half = table.shape[0] // 2
    normal = np.zeros((5, 5))
    right = np.zeros(5)
    term = np.zeros(5)
    for n in range(count):
        cx, cy = expected[n, 0], expected[n, 1]
        normal[:] = 0.0
        right[:] = 0.0
        energy, used = 0.0, 0
        for y in range(int(np.ceil(cy - radius)), int(np.floor(cy + radius)) + 1):
            for x in range(int(np.ceil(cx - radius)), int(np.floor(cx + radius)) + 1):
                ox, oy = x - cx, y - cy
                if ox * ox + oy * oy > radius * radius:
                    continue
                # Bilinear lookup of V and its gradient.
                fx, fy = ox * BINS_PER_PIXEL + half, oy * BINS_PER_PIXEL + half
                left, top = int(fx), int(fy)
                wx, wy = fx - left, fy - top
                w00, w01, w10, w11 = (1 - wx) * (1 - wy), wx * (1 - wy), (1 - wx) * wy, wx * wy
                for k in range(5):
                    term[k] = (
                        w00 * table[top, left, k]
                        + w01 * table[top, left + 1, k]
                        + w10 * table[top + 1, left, k]
                        + w11 * table[top + 1, left + 1, k]
                    )
                value = flat[y, x]
                for k in range(5):
                    right[k] += term[k] * value
                    for m in range(k + 1):
                        normal[k, m] += term[k] * term[m]
                energy += value * value
                used += 1
        for k in range(5):
            for m in range(k):
                normal[m, k] = normal[k, m]
            normal[k, k] *= 1.0 + 1e-9
        solved = np.linalg.solve(normal, right)
        left_over = energy
        for k in range(5):
            left_over -= solved[k] * right[k]
        # The noise now known weighs the data against the shading that lenses have: a maximum a posteriori fit.
        prior = max(left_over, 0.0) / used / (shading * max(solved[0], 0.1)) ** 2
        normal[3, 3] += prior
        normal[4, 4] += prior
        solved = np.linalg.solve(normal, right)
        if solved[0] > 1e-3:
            out[n, 0] = -solved[1] / solved[0]
            out[n, 1] = -solved[2] / solved[0]
            out[n, 2] = solved[0]
            out[n, 3] = np.sqrt(max(left_over, 0.0) / used) / solved[0]
        else:
            out[n, 3] = 1e3
    return out
