"""A smooth displacement over the sensor: what a lattice of straight rows leaves of the measured centres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Bool, Float64
from lfstereo.errors import ConfigError

LARGEST_DEGREE = 10
_ROUNDS = 6
_OUTLIER_SPREADS = 3.5


@dataclass(frozen=True, slots=True)
class SmoothField:
    """Displacement in x and y as polynomials of the place on the sensor."""

    degree: int
    coefficients: tuple[tuple[float, float], ...]
    """Of the products of Legendre polynomials ``P_a(x) P_b(y)``, ``a + b <= degree``, px in x and y; the sensor's
    width and height are scaled to -1 to 1."""
    shape: tuple[int, int]
    """(height, width) of the sensor."""

    def at(self, places: Float64) -> Float64:
        """Return ``(..., 2)`` displacements (x, y) px at places (x, y) px."""
        terms = _terms(places.reshape(-1, 2), self.degree, self.shape)
        return np.asarray((terms @ np.asarray(self.coefficients)).reshape(places.shape), np.float64)


def fit_smooth_field(
    places: Float64, displacement: Float64, weight: Float64, degree: int, shape: tuple[int, int]
) -> tuple[SmoothField, Bool]:
    """Fit a smooth field to measured displacements; outliers are left out.

    Parameters
    ----------
    places
        ``(N, 2)`` (x, y) px.
    displacement
        ``(N, 2)`` (x, y) px measured there.
    weight
        ``(N,)`` confidence of each, any scale.
    degree
        Of the polynomials, 0 to 10.
    shape
        (height, width) of the sensor.

    Returns
    -------
    The field, and ``(N,)``: True for the measurements that it was fitted to.

    Raises
    ------
    ConfigError
        If the degree is another.
    """
    if not 0 <= degree <= LARGEST_DEGREE:
        raise ConfigError(f"field_degree: found {degree}, expected 0 to {LARGEST_DEGREE}")
    terms = _terms(places, degree, shape)
    kept = np.ones(len(places), np.bool_)
    solved: Float64 = np.zeros((terms.shape[1], 2))
    for _ in range(_ROUNDS):
        used = terms * np.where(kept, weight, 0)[:, None]
        solved = np.asarray(np.linalg.lstsq(used.T @ terms, used.T @ displacement, rcond=None)[0], np.float64)
        distance = np.hypot(*(displacement - terms @ solved).T)
        kept = distance <= max(_OUTLIER_SPREADS * float(np.median(distance)) / 1.1774, 1e-9)
    return SmoothField(degree, tuple((float(x), float(y)) for x, y in solved), shape), kept


def _terms(places: Float64, degree: int, shape: tuple[int, int]) -> Float64:
    height, width = shape
    along_x = np.polynomial.legendre.legvander(2 * places[:, 0] / max(width - 1, 1) - 1, degree)
    along_y = np.polynomial.legendre.legvander(2 * places[:, 1] / max(height - 1, 1) - 1, degree)
    pairs = [(a, b) for a in range(degree + 1) for b in range(degree + 1 - a)]
    return np.stack([along_x[:, a] * along_y[:, b] for a, b in pairs], axis=1)
