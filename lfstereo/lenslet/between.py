"""Interpolate lenslet grids between the zoom and focus steps of white images."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.lattice import Lattice, to_grid
from lfstereo.lenslet.library import WhiteImage


def neighbours(whites: Sequence[WhiteImage], zoom_step: int, focus_step: int) -> list[tuple[WhiteImage, float]]:
    """Return the white images around a zoom and focus step with their shares in linear interpolation.

    First between the two nearest zoom steps at which there are white images, one on each side; at each of them between
    the two nearest focus steps. Beyond the outermost step that one alone counts.

    Parameters
    ----------
    whites
        Of one camera; of several at one zoom and focus the first counts.
    zoom_step, focus_step
        Of the photograph.

    Returns
    -------
    At most four, none with share 0; the shares sum up to 1.
    """
    found = []
    for zoom, zoom_share in _bracket([white.zoom_step for white in whites], zoom_step):
        row = [white for white in whites if white.zoom_step == zoom]
        for focus, focus_share in _bracket([white.focus_step for white in row], focus_step):
            found.append((next(white for white in row if white.focus_step == focus), zoom_share * focus_share))
    return found


def interpolated_grid(
    parts: Sequence[tuple[LensletGrid, float]], nearest: LensletGrid, nominal_pitch_px: float
) -> LensletGrid:
    """Return the weighted mean of grids whose lenslets are the same ones.

    Parameters
    ----------
    parts
        Grids and their shares, which sum up to 1. From grid to grid a micro-image moves by less than half a pitch.
    nearest
        The grid that tells which micro-images are the same: those nearest to its own, in the middle of the sensor.
    nominal_pitch_px
        As in `lfstereo.lenslet.lattice.to_grid`.
    """
    base = Lattice.of(nearest)
    height, width = nearest.sensor_shape
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    anchor = base.origin + np.round((middle - base.origin) @ base.reciprocal.T) @ base.matrix.T
    origin, matrix = np.zeros(2), np.zeros((2, 2))
    for grid, share in parts:
        lattice = Lattice.of(grid)
        same = lattice.origin + np.round((anchor - lattice.origin) @ lattice.reciprocal.T) @ lattice.matrix.T
        origin += share * same
        matrix += share * lattice.matrix
    uncertainties = [grid.uncertainty_px for grid, _ in parts if grid.uncertainty_px is not None]
    return to_grid(
        Lattice(origin, matrix[:, 0].copy(), matrix[:, 1].copy()),
        nearest.sensor_shape,
        nominal_pitch_px,
        residual_px=max(grid.residual_px for grid, _ in parts),
        quality=min(grid.quality for grid, _ in parts),
        source="white images",
        uncertainty_px=max(uncertainties) if uncertainties else None,
    )


def _bracket(steps: Sequence[int], wanted: int) -> list[tuple[int, float]]:
    """Return the nearest steps on both sides and their shares.

    Examples
    --------
    >>> _bracket([0, 100, 300], 150), _bracket([0, 100], 100), _bracket([0, 100], 120)
    ([(100, 0.75), (300, 0.25)], [(100, 1.0)], [(100, 1.0)])
    """
    below = max((step for step in steps if step <= wanted), default=None)
    above = min((step for step in steps if step >= wanted), default=None)
    if below is None or above is None or below == above:
        only = below if below is not None else above
        return [] if only is None else [(only, 1.0)]
    share = (wanted - below) / (above - below)
    return [(below, 1 - share), (above, share)]
