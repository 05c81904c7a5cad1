"""The lattice of micro-image centres on the sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.lenslet.smooth_field import SmoothField


@dataclass(frozen=True, slots=True)
class LensletGrid:
    """Affine hexagonal lattice of micro-image centres, in px of the raw sensor.

    Lenslet ``(row v, column u)`` lies at ``origin + (u + shift(v)/2) * step_u + v * step_v`` with
    ``shift(v) = (v + first_shifted_row) % 2 == 0``, i.e. row ``first_shifted_row`` and every second one
    from it lie half a pitch to the right.
    """

    origin_px: tuple[float, float]
    """(x, y) of lenslet (0, 0), before its row's half-pitch shift."""
    step_u_px: tuple[float, float]
    """(x, y) from one lenslet to its right neighbour in the row."""
    step_v_px: tuple[float, float]
    """(x, y) from one row to the next, without the half-pitch shift."""
    first_shifted_row: int
    """0 or 1."""
    rows: int
    columns: int
    sensor_shape: tuple[int, int]
    """(height, width) of the frame it was fitted to."""
    residual_px: float
    """Robust RMS distance of the measured centres to the lattice."""
    quality: float
    """0..1: share of expected lenslets whose measured centre agrees with the lattice."""
    source: str
    """``"white image"``, ``"white images"`` (interpolated between them), ``"photograph"`` or ``"given"``."""
    uncertainty_px: float | None = None
    """Standard error of a lattice point, mean over the sensor; ``None`` where nothing was measured."""
    field: SmoothField | None = None
    """How the micro-images' centres depart from the straight lattice, where that was asked for."""

    def centres(self) -> Float64:
        """Return all centres as ``(rows, columns, 2)``, (x, y) in px, the smooth field included."""
        v, u = np.mgrid[: self.rows, : self.columns].astype(np.float64)
        shifted = (np.arange(self.rows)[:, None] + self.first_shifted_row) % 2 == 0
        u = u + 0.5 * shifted
        step_u, step_v = np.asarray(self.step_u_px), np.asarray(self.step_v_px)
        centres: Float64 = np.asarray(self.origin_px) + u[..., None] * step_u + v[..., None] * step_v
        return centres if self.field is None else centres + self.field.at(centres)
