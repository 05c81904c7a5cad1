"""Radial distortion of ray directions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float64


@dataclass(frozen=True, slots=True)
class Distorted:
    """Distorted directions with their derivatives; each array ``(M,)``."""

    x: Float64
    y: Float64
    x_by_x: Float64
    x_by_y: Float64
    """Also the derivative of y by x: the field is a gradient."""
    y_by_y: Float64
    r2: Float64
    """Squared distance from the centre of distortion, before it."""
    off_x: Float64
    off_y: Float64
    """Direction from the centre of distortion, before it."""


def distort(x: Float64, y: Float64, coefficients: Float64) -> Distorted:
    """Bend directions as the lens does: ``d = b + (1 + k1 r^2 + k2 r^4 + k3 r^6)(u - b)``.

    Parameters
    ----------
    x, y
        ``(M,)`` tangents of ideal ray directions.
    coefficients
        k1, k2, k3, b1, b2.

    References
    ----------
    Dansereau, Pizarro and Williams, "Decoding, calibration and rectification for lenselet-based plenoptic
    cameras" (CVPR 2013), equation 13.

    Examples
    --------
    >>> import numpy as np
    >>> bent = distort(np.array([0.5]), np.array([0.0]), np.array([0.2, 0, 0, 0, 0]))
    >>> float(bent.x[0])  # 0.5 (1 + 0.2 * 0.25)
    0.525
    """
    k1, k2, k3, b1, b2 = coefficients
    off_x, off_y = x - b1, y - b2
    r2 = off_x * off_x + off_y * off_y
    gain = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
    return Distorted(
        x=b1 + gain * off_x,
        y=b2 + gain * off_y,
        x_by_x=gain + slope * off_x * off_x,
        x_by_y=slope * off_x * off_y,
        y_by_y=gain + slope * off_y * off_y,
        r2=r2,
        off_x=off_x,
        off_y=off_y,
    )


def undistort(x: Float64, y: Float64, coefficients: Float64, steps: int = 8) -> tuple[Float64, Float64]:
    """Return the ideal directions of distorted ones, by Newton's method."""
    ideal_x, ideal_y = x.copy(), y.copy()
    if not np.any(coefficients[:3]):
        return ideal_x, ideal_y
    for _ in range(steps):
        bent = distort(ideal_x, ideal_y, coefficients)
        miss_x, miss_y = x - bent.x, y - bent.y
        volume = bent.x_by_x * bent.y_by_y - bent.x_by_y**2
        ideal_x += (bent.y_by_y * miss_x - bent.x_by_y * miss_y) / volume
        ideal_y += (bent.x_by_x * miss_y - bent.x_by_y * miss_x) / volume
    return ideal_x, ideal_y
