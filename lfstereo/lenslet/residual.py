"""How far each micro-image lies from the fitted lattice, as numbers and as a map."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float32, Float64, UInt8
from lfstereo.container.capture import Capture
from lfstereo.lenslet.centres import measure_centres
from lfstereo.lenslet.flatten import flatten
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.lattice import Lattice
from lfstereo.lenslet.options import GridOptions
from lfstereo.lenslet.profile import mean_micro_image

_FIT_RADIUS_PITCHES = 0.58
_LOST_PITCHES = 0.35
"""A centre measured farther off than this, in pitches, was not found."""
_ROUNDS = 4
_CENTRED_PX = 0.005
_MARGIN_PX = 2.0
_CELL_LENSLETS = 12
_INK, _PAPER = (20, 20, 20), (255, 255, 255)


@dataclass(frozen=True, slots=True)
class GridResidual:
    """Measured centres of the micro-images against the lattice."""

    centres: Float64
    """``(N, 2)`` (x, y) of the lattice, sensor px."""
    displacement: Float64
    """``(N, 2)`` (x, y) px from there to the measured centre."""
    found: Bool
    """``(N,)`` where the micro-image was found near its place."""
    field: Float64
    """``(N,)`` distance from the middle of the sensor, 1 = its corners."""

    def rms_px(self, inner: float = 0.0, outer: float = 1.0) -> float:
        """Return the RMS distance in px of the lenslets found between two fields; 0 where there are none."""
        zone = self.found & (self.field >= inner) & (self.field <= outer)
        if not zone.any():
            return 0.0
        return float(np.sqrt(np.mean(np.sum(self.displacement[zone] ** 2, axis=1))))


def measure_residual(capture: Capture, grid: LensletGrid, options: GridOptions = GridOptions()) -> GridResidual:
    """Measure all micro-images that lie whole on the sensor.

    Parameters
    ----------
    capture
        White image or photograph.
    grid
        Its lenslet grid.
    options
        Those of the fit; of them the shading allowed across a micro-image and the part that gives the mean one.
    """
    lattice = Lattice.of(grid)
    flat = flatten(capture, lattice.pitch)
    radius = _FIT_RADIUS_PITCHES * lattice.pitch
    height, width = flat.shape
    index = lattice.indices_inside((height, width), radius + 2 + _MARGIN_PX)
    centres = lattice.origin + index @ lattice.matrix.T
    shading = options.photograph_shading_per_px if grid.source == "photograph" else options.white_shading_per_px
    moved = np.zeros(2)
    for _ in range(_ROUNDS):
        # A centre is measured to first order, so what all lenslets share is taken out before.
        around = Lattice(lattice.origin + moved, lattice.row, lattice.diagonal)
        micro_image = mean_micro_image(flat, around, share=options.template_share)
        measured = measure_centres(flat, centres + moved, micro_image, radius, shading)
        shared = np.median(measured.displacement, axis=0)
        if np.hypot(*shared) < _CENTRED_PX or np.hypot(*(moved + shared)) > _MARGIN_PX:
            break
        moved = moved + shared
    displacement = measured.displacement + moved
    middle = np.array([width - 1, height - 1]) / 2
    return GridResidual(
        centres=np.asarray(centres, np.float64),
        displacement=displacement,
        found=np.hypot(*displacement.T) < _LOST_PITCHES * lattice.pitch,
        field=np.asarray(np.hypot(*(centres - middle).T) / np.hypot(*middle), np.float64),
    )


def residual_field(residual: GridResidual, shape: tuple[int, int], cell_px: float) -> tuple[Float32, Bool]:
    """Return the median displacement in square cells of the sensor.

    Parameters
    ----------
    residual
        Of all micro-images.
    shape
        (height, width) of the sensor, px.
    cell_px
        Side of a cell, px.

    Returns
    -------
    ``(rows, columns, 2)`` float32 px in x and y, and ``(rows, columns)``: True where a cell holds lenslets.
    """
    rows, columns = (max(1, round(side / cell_px)) for side in shape)
    place = (residual.centres[residual.found] / (shape[1], shape[0]) * (columns, rows)).astype(np.int64)
    cell = np.clip(place[:, 1], 0, rows - 1) * columns + np.clip(place[:, 0], 0, columns - 1)
    order = np.argsort(cell, kind="stable")
    starts = np.searchsorted(cell[order], np.arange(rows * columns + 1))
    moved = residual.displacement[residual.found][order]
    field = np.zeros((rows * columns, 2), np.float32)
    known = np.diff(starts) > 0
    for n in np.flatnonzero(known):
        field[n] = np.median(moved[starts[n] : starts[n + 1]], axis=0)
    return field.reshape(rows, columns, 2), known.reshape(rows, columns)


def draw_residual(residual: GridResidual, grid: LensletGrid, width_px: int = 1520) -> UInt8:
    """Draw the residual as a map of the sensor: colour for its size, arrows for its direction.

    Arrows that point inwards and grow towards the border are the main lens cutting the micro-images (cat's eye); the
    grid is fitted where it does not. An arrow field that turns, or that differs from cell to cell, is a bad grid.

    Parameters
    ----------
    residual
        Of all micro-images.
    grid
        Gives the sensor's size and the pitch.
    width_px
        Width of the picture.

    Returns
    -------
    ``(h, width_px, 3)`` uint8 RGB; the scale is written below the map.
    """
    pitch = float(np.hypot(*grid.step_u_px))
    cell_px = max(_CELL_LENSLETS * pitch, max(grid.sensor_shape) / 60)
    field, known = residual_field(residual, grid.sensor_shape, cell_px)
    size = np.hypot(field[..., 0], field[..., 1])
    full = max(float(np.percentile(size[known], 98)) if known.any() else 0.0, 1e-3)
    shades = np.clip(size / full * 255, 0, 255).astype(np.uint8)
    colours = np.asarray(cv2.applyColorMap(shades, cv2.COLORMAP_VIRIDIS))[..., ::-1].copy()
    colours[~known] = (128, 128, 128)
    zoom = max(4, width_px // field.shape[1])
    picture = np.repeat(np.repeat(colours, zoom, axis=0), zoom, axis=1)
    length = 0.9 * zoom / full
    for row, column in np.argwhere(known):
        x, y = (column + 0.5) * zoom, (row + 0.5) * zoom
        dx, dy = np.clip(field[row, column] * length, -1.5 * zoom, 1.5 * zoom)
        tip = (round(x + dx), round(y + dy))
        cv2.arrowedLine(picture, (round(x), round(y)), tip, _PAPER, 1, cv2.LINE_AA, tipLength=0.3)
    picture = np.ascontiguousarray(picture[:, :width_px])
    picture = np.pad(picture, ((0, 0), (0, max(0, width_px - picture.shape[1])), (0, 0)), constant_values=255)
    text = (
        f"median displacement per cell; yellow and an arrow of one cell = {full:.4f} px; RMS of all "
        f"{residual.rms_px():.4f} px, middle {residual.rms_px(0, 0.45):.4f} px, border {residual.rms_px(0.8, 1):.4f} "
        f"px; {residual.found.mean():.2%} of {len(residual.found)} found"
    )
    legend = np.full((30, width_px, 3), _PAPER, np.uint8)
    cv2.putText(legend, text, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.48, _INK, 1, cv2.LINE_AA)
    return np.concatenate([picture, legend], axis=0)
