"""How well a fitted lattice is known: what it would have been without each part of the frame."""

from __future__ import annotations

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.lenslet.lattice import Lattice

_BLOCKS_PER_SIDE = 6
_PLACES_PER_SIDE = 5


def lattice_uncertainty(
    lattice: Lattice, index: Float64, points: Float64, weight: Float64, shape: tuple[int, int]
) -> float:
    """Return the standard error of a lattice's points, px, by leaving out one block of the frame after the other.

    Errors that neighbouring micro-images share, such as the scene's or those of a slight bend of the lattice, count
    in full, which the scatter of single centres divided by the root of their number would not show. What the whole
    frame shares does not: a white image's grid has about 0.001 px of that, a photograph's own about 0.007 px.

    Parameters
    ----------
    lattice
        The fitted lattice.
    index
        ``(N, 2)`` whole lattice coordinates of the points it was fitted to.
    points
        ``(N, 2)`` measured positions, px.
    weight
        ``(N,)`` weight that each of them has in the fit.
    shape
        (height, width) of the sensor.

    Returns
    -------
    Root of the mean variance of the distance over 5 x 5 places of the whole sensor, also outside of the points.

    References
    ----------
    B. Efron, C. Stein, "The jackknife estimate of variance", Annals of Statistics 9 (1981).
    """
    height, width = shape
    middle = index.mean(0)
    design = np.column_stack([np.ones(len(index)), index - middle])
    block = _blocks(points)
    count = _BLOCKS_PER_SIDE**2
    left = np.zeros((count, 3, 3))
    right = np.zeros((count, 3, 2))
    for a in range(3):
        for b in range(3):
            left[:, a, b] = np.bincount(block, weight * design[:, a] * design[:, b], count)
        for b in range(2):
            right[:, a, b] = np.bincount(block, weight * design[:, a] * points[:, b], count)
    filled = np.flatnonzero(np.bincount(block, minlength=count))
    places = np.stack(
        np.meshgrid(np.linspace(0, width - 1, _PLACES_PER_SIDE), np.linspace(0, height - 1, _PLACES_PER_SIDE)), axis=-1
    ).reshape(-1, 2)
    where = (places - lattice.origin) @ lattice.reciprocal.T - middle
    rows = np.column_stack([np.ones(len(where)), where])
    without = [rows @ np.linalg.lstsq(left.sum(0) - left[k], right.sum(0) - right[k], rcond=None)[0] for k in filled]
    spread = np.stack(without) - np.mean(without, axis=0)
    variance = (len(filled) - 1) / len(filled) * (spread**2).sum(axis=(0, 2))
    return float(np.sqrt(variance.mean()))


def _blocks(points: Float64) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    """Return for each point the number of its block; the blocks share out the points' own extent."""
    low, high = points.min(0), points.max(0)
    cell = ((points - low) / np.maximum(high - low, 1e-9) * _BLOCKS_PER_SIDE).astype(np.int64)
    cell = np.minimum(cell, _BLOCKS_PER_SIDE - 1)
    return np.asarray(cell[:, 1] * _BLOCKS_PER_SIDE + cell[:, 0], np.int64)
