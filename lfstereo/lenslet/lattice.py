"""A plain affine lattice, and how it becomes a :class:`LensletGrid`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfstereo.arrays import Float64
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.smooth_field import SmoothField

_SAME_PITCH = 0.02


@dataclass(frozen=True, slots=True)
class Lattice:
    """Points ``origin + i * row + j * diagonal`` for all whole ``i`` and ``j``, in px of the raw sensor."""

    origin: Float64
    """``(2,)`` (x, y) of lenslet (0, 0)."""
    row: Float64
    """``(2,)`` step to the right neighbour in the row."""
    diagonal: Float64
    """``(2,)`` step to the lower right neighbour, about 60 degrees below ``row``."""

    @classmethod
    def of(cls, grid: LensletGrid) -> Lattice:
        """Return the lattice that a grid counts rows and columns of."""
        row, step_v = np.asarray(grid.step_u_px), np.asarray(grid.step_v_px)
        shift = 0.5 * row if grid.first_shifted_row == 0 else 0.0 * row
        return cls(origin=np.asarray(grid.origin_px) + shift, row=row, diagonal=step_v + 0.5 * row)

    @property
    def matrix(self) -> Float64:
        """``(2, 2)``: maps ``(i, j)`` to (x, y) px."""
        return np.stack([self.row, self.diagonal], axis=1)

    @property
    def reciprocal(self) -> Float64:
        """``(2, 2)``: rows are the two frequencies in cycles per px whose phases are ``i`` and ``j``."""
        return np.asarray(np.linalg.inv(self.matrix), np.float64)

    @property
    def pitch(self) -> float:
        """Pitch in px, the mean over the three directions of the lattice."""
        steps = (self.row, self.diagonal, self.diagonal - self.row)
        return float(np.mean([np.hypot(*step) for step in steps]))

    def indices_inside(self, shape: tuple[int, int], margin: float) -> Float64:
        """Return ``(N, 2)`` whole numbers ``(i, j)`` of the points at least ``margin`` px inside a frame."""
        height, width = shape
        corners = np.array([[0, 0], [width, 0], [0, height], [width, height]], np.float64)
        reach = (corners - self.origin) @ self.reciprocal.T
        low, high = np.floor(reach.min(0)), np.ceil(reach.max(0))
        j, i = np.mgrid[low[1] : high[1] + 1, low[0] : high[0] + 1]
        index = np.stack([i.ravel(), j.ravel()], axis=1)
        x, y = (self.origin + index @ self.matrix.T).T
        inside = (x >= margin) & (x <= width - 1 - margin) & (y >= margin) & (y <= height - 1 - margin)
        return np.asarray(index[inside], np.float64)


def to_grid(
    lattice: Lattice,
    shape: tuple[int, int],
    nominal_pitch_px: float,
    residual_px: float,
    quality: float,
    source: str,
    uncertainty_px: float | None = None,
    field: SmoothField | None = None,
) -> LensletGrid:
    """Choose the rows and columns that fill a sensor and number them from its top-left corner.

    The counts follow from the sensor and the camera's nominal pitch, so all cameras of one model at every zoom
    give light fields of one size: 434 x 541 lenslets for an Illum, centred on the sensor to within half a lenslet.
    The outermost lenslets may lie partly beyond its border.

    Parameters
    ----------
    lattice
        The fitted lattice.
    shape
        (height, width) of the sensor.
    nominal_pitch_px
        Pitch that the camera's metadata give; not used where it is more than 2 % off the fitted one.
    residual_px, quality, source, uncertainty_px, field
        Passed on to the grid.
    """
    height, width = shape
    step_u = lattice.row
    step_v = lattice.diagonal - 0.5 * lattice.row
    along = step_u / np.hypot(*step_u)
    row_distance = float(along[0] * step_v[1] - along[1] * step_v[0])
    pitch = float(np.hypot(*step_u))
    known = abs(nominal_pitch_px / lattice.pitch - 1) < _SAME_PITCH
    rows = round(height / (nominal_pitch_px * np.sqrt(3) / 2 if known else row_distance))
    columns = round(width / (nominal_pitch_px if known else pitch))
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    j_first = round(float((lattice.reciprocal @ (middle - lattice.origin))[1]) - (rows - 1) / 2)
    left = lattice.origin + j_first * lattice.diagonal
    along_row = np.linalg.solve(np.stack([step_u, step_v], axis=1), middle - left - (rows - 1) / 2 * step_v)[0]
    # Half steps are free to choose: an odd one means that row 0 is itself a shifted row.
    halves = round(2 * (along_row - (columns - 1) / 2 - 0.25))
    origin = left + 0.5 * halves * step_u
    return LensletGrid(
        origin_px=(float(origin[0]), float(origin[1])),
        step_u_px=(float(step_u[0]), float(step_u[1])),
        step_v_px=(float(step_v[0]), float(step_v[1])),
        first_shifted_row=1 - halves % 2,
        rows=rows,
        columns=columns,
        sensor_shape=shape,
        residual_px=residual_px,
        quality=quality,
        source=source,
        uncertainty_px=uncertainty_px,
        field=field,
    )
