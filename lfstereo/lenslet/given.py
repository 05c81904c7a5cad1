"""Fit a grid to micro-image centres that another program lists, in any order, with gaps and wrong ones."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from lfstereo.arrays import Bool, Float64
from lfstereo.errors import GridFitError
from lfstereo.lenslet.fit import robust_affine
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.lattice import Lattice, to_grid
from lfstereo.lenslet.residual import GridResidual
from lfstereo.lenslet.smooth_field import fit_smooth_field
from lfstereo.lenslet.uncertainty import lattice_uncertainty

_EXACT_PX = 1e-6
_LEAST_EXACT_SHARE = 0.05
"""Measured centres are never this often equally far from their neighbours to a millionth of a px."""
_LEAST_CENTRES = 50
_NEIGHBOURS = 6
_ANGLE_RAD = np.radians(12.0)
_START_PITCHES = 12
_GROWTH = 1.25
_OUTLIER_SPREADS = 4.0


def computed_centres(points: Float64) -> Bool:
    """Mark centres that were computed from a lattice instead of measured: they lie on it to a millionth of a px.

    Lists of centres may mix both, where a program fell back to its model because it found nothing.

    Parameters
    ----------
    points
        ``(N, 2)`` (x, y) px.

    Returns
    -------
    ``(N,)``; all False where the centres show no exact lattice.
    """
    none = np.zeros(len(points), np.bool_)
    row, diagonal = (_exact_step(points, angle) for angle in (0.0, np.pi / 3))
    if row is None or diagonal is None:
        return none
    matrix = np.stack([row, diagonal], axis=1)
    # A point all of whose partners are exact lies on the lattice; any such point gives its origin.
    phase = points @ np.linalg.inv(matrix).T
    fraction = phase - np.floor(phase)
    bins = np.floor(fraction * 1000).astype(np.int64) % 1000
    fullest = np.bincount(bins[:, 0] * 1000 + bins[:, 1], minlength=1_000_000).argmax()
    start = points[(bins[:, 0] * 1000 + bins[:, 1]) == fullest][0]
    for _ in range(3):
        index = np.round((points - start) @ np.linalg.inv(matrix).T)
        near = np.hypot(*(points - start - index @ matrix.T).T) < 1e3 * _EXACT_PX
        design = np.column_stack([np.ones(int(near.sum())), index[near]])
        solved = np.linalg.lstsq(design, points[near], rcond=None)[0]
        start, matrix = solved[0], solved[1:].T
    index = np.round((points - start) @ np.linalg.inv(matrix).T)
    return np.asarray(np.hypot(*(points - start - index @ matrix.T).T) < _EXACT_PX, np.bool_)


def fit_given_centres(
    points: Float64, shape: tuple[int, int], field_degree: int = 0
) -> tuple[LensletGrid, GridResidual]:
    """Fit a lattice, and a smooth departure from it where asked, to listed centres.

    The fit begins in the middle of the list and grows outwards, so that no row is miscounted.

    Parameters
    ----------
    points
        ``(N, 2)`` (x, y) px, 0-based.
    shape
        (height, width) of the sensor.
    field_degree
        Degree of the smooth departure; 0 = none.

    Returns
    -------
    The grid, and what it leaves of each centre (the smooth departure taken out); ``found`` marks those that agree.

    Raises
    ------
    GridFitError
        If there are too few centres, or they lie on no hexagonal lattice.
    """
    if len(points) < _LEAST_CENTRES:
        raise GridFitError(f"centres: found {len(points)}, expected at least {_LEAST_CENTRES}; give more of them")
    lattice = _grown(points)
    index = np.round((points - lattice.origin) @ lattice.reciprocal.T)
    left = points - lattice.origin - index @ lattice.matrix.T
    weight = np.ones(len(points))
    field = None
    middle = np.array([shape[1] - 1, shape[0] - 1]) / 2
    if field_degree:
        field, _ = fit_smooth_field(points, left, weight, field_degree, shape)
        left = left - field.at(points)
    distance = np.hypot(*left.T)
    found = distance < _OUTLIER_SPREADS * float(np.median(distance)) / 1.1774 + _EXACT_PX
    spread = float(np.sqrt(2) * np.median(distance[found]) / 1.1774)
    uncertainty = lattice_uncertainty(lattice, index[found], points[found], weight[found], shape)
    grid = to_grid(lattice, shape, lattice.pitch, spread, float(found.mean()), "given", uncertainty, field)
    place = np.asarray(np.hypot(*(points - middle).T) / np.hypot(*middle), np.float64)
    return grid, GridResidual(points - left, left, np.asarray(found, np.bool_), place)


def neighbour_correlation(residual: GridResidual, grid: LensletGrid) -> tuple[float, float]:
    """Return how much the residuals in x and y of a lenslet and its right neighbour have in common, -1 to 1.

    Near 0 what is left is the noise of single centres; near 1 the lattice bends where the fit does not.
    """
    row = np.asarray(grid.step_u_px)
    centres, moved = residual.centres[residual.found], residual.displacement[residual.found]
    distance, partner = cKDTree(centres).query(centres + row, distance_upper_bound=0.2 * float(np.hypot(*row)))
    pairs = np.flatnonzero(np.isfinite(distance))
    first, second = moved[pairs], moved[partner[pairs]]
    return tuple(float(np.corrcoef(first[:, k], second[:, k])[0, 1]) for k in (0, 1))  # type: ignore[return-value]


def _steps(points: Float64, angle: float) -> Float64:
    """Return ``(M, 2)`` vectors to near neighbours that point at most 12 degrees off an angle."""
    _, near = cKDTree(points).query(points, k=min(_NEIGHBOURS, len(points) - 1) + 1)
    near = near.reshape(len(points), -1)
    vectors = (points[near[:, 1:]] - points[:, None]).reshape(-1, 2)
    apart = np.arctan2(vectors[:, 1], vectors[:, 0]) - angle
    return np.asarray(vectors[np.abs(apart) < _ANGLE_RAD], np.float64)


def _exact_step(points: Float64, angle: float) -> Float64 | None:
    """Return the step that a good part of all neighbours share to a millionth of a px, or None."""
    steps = _steps(points, angle)
    if not len(steps):
        return None
    rounded, which, counts = np.unique(
        np.round(steps / _EXACT_PX / 10).astype(np.int64), axis=0, return_inverse=True, return_counts=True
    )
    best = int(counts.argmax())
    if counts[best] < max(_LEAST_CENTRES, _LEAST_EXACT_SHARE * len(steps)) or not rounded.size:
        return None
    return np.asarray(np.median(steps[which.reshape(-1) == best], axis=0), np.float64)


def _grown(points: Float64) -> Lattice:
    """Fit a lattice to the middle of the points, then to more and more around it."""
    row, diagonal = (_steps(points, angle) for angle in (0.0, np.pi / 3))
    if min(len(row), len(diagonal)) < _LEAST_CENTRES // 2:
        raise GridFitError(
            "centres: found no rows of equal steps, expected a hexagonal lattice along x; check the list"
        )
    start = points[np.argmin(np.hypot(*(points - np.median(points, axis=0)).T))]
    away = np.hypot(*(points - start).T)
    lattice = Lattice(start, np.median(row, axis=0), np.median(diagonal, axis=0))
    radius = _START_PITCHES * lattice.pitch
    while True:
        near = away < radius
        index = np.round((points[near] - lattice.origin) @ lattice.reciprocal.T)
        if len(index) >= _LEAST_CENTRES // 2:
            lattice, spread = robust_affine(index, points[near], np.ones(len(index)))
            if spread > 0.25 * lattice.pitch:
                raise GridFitError(
                    f"centres: found them {spread:.2f} px off a hexagonal lattice, expected less than a quarter of the "
                    f"pitch of {lattice.pitch:.2f} px; check the list"
                )
        if near.all():
            return lattice
        radius *= _GROWTH
