"""Moeller 2015: depth from focus as one variational problem: the sharpest slices under total variation."""

from __future__ import annotations

import numba
import numpy as np

from lfstereo.arrays import Float32
from lfstereo.focus.nayar1992 import TINY
from lfstereo.focus.shift_kernels import compiled

DEGREE = 8
"""Of the polynomial that stands for a pixel's curve of sharpness, as in the paper."""
_DUAL_STEP = 0.5
"""In slices squared: how fast the two sides of the saddle point move; any value converges."""


def variational_peak(sharpness: Float32, start: Float32, strength: float, iterations: int) -> Float32:
    """Return the slice in focus, between slices fractional, that minimises ``-sum c_p(d_p) + strength * TV(d)``.

    ``c_p`` is the polynomial of degree 8 through the sharpness of pixel p over the slices, in units of the picture's
    mean peak; ``TV`` the sum over the pixels of the length of the gradient of d, in slices per px. The first term has
    many valleys; the local minimum below the start is found by linearising it at every step.

    Parameters
    ----------
    sharpness
        ``(K, V, U)``, three slices or more.
    start
        ``(V, U)`` slices in focus as far as they are known.
    strength
        How much an edge of one slice in depth costs per px of its length.
    iterations
        Steps of the descent.

    References
    ----------
    Moeller, Benning, Schönlieb, Cremers, "Variational depth from focus reconstruction" (2015), equations 4 to 9;
    Condat, "A primal-dual splitting method for convex optimization" (2013), algorithm 3.1, the steps, with the step
    sizes per pixel of Pock and Chambolle, "Diagonal preconditioning for first order primal-dual algorithms" (2011).

    Examples
    --------
    Seven pixels are sharpest in slice 2; one, less sharp, in slice 3, and is persuaded.

    >>> k = np.arange(5, dtype=np.float32)[:, None, None]
    >>> peak = np.full((1, 2, 4), 2.0); peak[0, 1, 2] = 3.0
    >>> found = variational_peak(np.exp(-((k - peak) ** 2) / 4).astype(np.float32), np.float32(peak[0]), 1.0, 300)
    >>> float(np.abs(found - found.mean()).max()) < 0.01
    True
    """
    count = len(sharpness)
    degree = min(DEGREE, count - 1)
    x = np.linspace(-1.0, 1.0, count)
    fit = np.linalg.pinv(np.vander(x, degree + 1, increasing=True))
    scale = max(float(sharpness.max(axis=0).mean()), TINY)
    per_x = (count - 1) / 2  # slices per unit of x
    powers = np.arange(1, degree + 1)
    slope = np.tensordot((powers[:, None] * fit[1:] / (scale * per_x)).astype(np.float32), sharpness, axes=1)
    bend = np.tensordot(
        (np.vander(x, degree, increasing=True)[:, :-1] * powers[None, :-1] / per_x).astype(np.float32),
        slope[1:],
        axes=1,
    )
    reach = np.abs(bend).max(axis=0)
    index = np.array(start, np.float32)
    _descend(index, np.ascontiguousarray(np.moveaxis(slope, 0, -1)), reach, per_x, np.float32(strength), iterations)
    return index


@compiled(parallel=True)
def _descend(
    index: Float32, slope: Float32, reach: Float32, per_x: float, strength: np.float32, iterations: int
) -> None:
    """Move ``index`` (slices) down; ``slope`` ``(V, U, n)`` holds the derivative's coefficients over x in -1..1."""
    rows, columns, terms = slope.shape
    dual_v = np.zeros((rows, columns), np.float32)
    dual_u = np.zeros((rows, columns), np.float32)
    leading = index.copy()
    dual_step = np.float32(_DUAL_STEP)
    last = np.float32(2 * per_x)
    for _ in range(iterations):
        for v in numba.prange(rows):
            for u in range(columns):
                down = leading[v + 1, u] - leading[v, u] if v + 1 < rows else np.float32(0)
                right = leading[v, u + 1] - leading[v, u] if u + 1 < columns else np.float32(0)
                a = dual_v[v, u] + dual_step * down
                b = dual_u[v, u] + dual_step * right
                shrink = max(np.float32(1), np.sqrt(a * a + b * b) / strength)
                dual_v[v, u] = a / shrink
                dual_u[v, u] = b / shrink
        for v in numba.prange(rows):
            for u in range(columns):
                x = index[v, u] / np.float32(per_x) - np.float32(1)
                climb = np.float32(0)
                for n in range(terms - 1, -1, -1):
                    climb = climb * x + slope[v, u, n]
                away = -dual_v[v, u] - dual_u[v, u]
                if v > 0:
                    away += dual_v[v - 1, u]
                if u > 0:
                    away += dual_u[v, u - 1]
                step = np.float32(1) / (np.float32(0.5) * reach[v, u] + np.float32(8) * dual_step)
                moved = min(max(index[v, u] + step * (climb - away), np.float32(0)), last)
                leading[v, u] = 2 * moved - index[v, u]
                index[v, u] = moved
