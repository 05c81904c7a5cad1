"""How far a lenslet grid lies from the micro-images of another frame, such as the photograph it is to decode."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.container.capture import Capture
from lfstereo.errors import GridFitError
from lfstereo.lenslet.centres import measure_centres
from lfstereo.lenslet.fit import robust_affine
from lfstereo.lenslet.flatten import flatten
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.lattice import Lattice
from lfstereo.lenslet.options import GridOptions
from lfstereo.lenslet.profile import BINS_PER_PIXEL, MicroImage, mean_micro_image

_TILES_PER_SIDE = 7
_TILE_PITCHES = 16
_FIT_RADIUS_PITCHES = 0.58
_LEAST_CENTRES = 30
_ROUNDS = 4
_CENTRED_PX = 0.01
_PLACES_PER_SIDE = 5
_MIDDLE_PITCHES, _RIM_PITCHES = 0.2, 0.05


@dataclass(frozen=True, slots=True)
class Drift:
    """Where a frame's micro-images lie against a grid."""

    offset_px: float
    """RMS distance over the trusted part of the sensor between the grid and the lattice that the frame shows."""
    shift_px: tuple[float, float]
    """Mean (x, y) from the grid to the frame's lattice."""
    lenslets: int
    """Number of micro-images measured."""


def measure_drift(frame: Capture, grid: LensletGrid, options: GridOptions = GridOptions()) -> Drift:
    """Measure a sample of a frame's micro-images against a grid that was fitted to another frame.

    Some 7 x 7 tiles of 16 lenslets each are looked at, as far as they lie where the main lens does not cut the
    micro-images. A lattice is fitted to what they show; scene and noise move single centres by a fraction of a px, the
    lattice hardly.

    Parameters
    ----------
    frame
        White image or photograph.
    grid
        The grid to check; within a third of a pitch of the truth, as otherwise the neighbour is found.
    options
        Shading allowed across micro-images, and the field that is trusted.

    Raises
    ------
    GridFitError
        If the frame shows too few micro-images near their places, or its micro-images are darkest there.
    """
    lattice = Lattice.of(grid)
    tiles = _tiles(frame, lattice.pitch, options.trusted_field)
    shading = options.white_shading_per_px if frame.metadata.is_white_image else options.photograph_shading_per_px
    moved = np.zeros(2)
    fitted, index = lattice, np.zeros((0, 2))
    for _ in range(_ROUNDS):
        around = Lattice(lattice.origin + moved, lattice.row, lattice.diagonal)
        template = mean_micro_image(
            tiles[0].flat, Lattice(around.origin - tiles[0].corner, around.row, around.diagonal)
        )
        if not _bright_middle(template, lattice.pitch):
            raise GridFitError(
                f"{frame.source}: found no brighter middle where the grid has its lenslets, expected one; the grid is "
                "another camera's"
            )
        index, measured, weight = _measure(tiles, around, template, shading)
        if len(index) < _LEAST_CENTRES:
            raise GridFitError(
                f"{frame.source}: found {len(index)} micro-images near the grid, expected at least {_LEAST_CENTRES}; "
                "the grid is not this camera's, or the frame is dark"
            )
        fitted, _ = robust_affine(index, measured, weight)
        # Centres are measured to first order, so what all share is taken out before measuring again.
        shared = (fitted.origin + index.mean(0) @ fitted.matrix.T) - (around.origin + index.mean(0) @ around.matrix.T)
        moved = moved + shared
        if np.hypot(*shared) < _CENTRED_PX or np.hypot(*moved) > 0.5 * lattice.pitch:
            break
    low, high = index.min(0), index.max(0)
    steps = np.linspace(0, 1, _PLACES_PER_SIDE)
    places = low + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) * (high - low)
    apart = (fitted.origin + places @ fitted.matrix.T) - (lattice.origin + places @ lattice.matrix.T)
    mean = apart.mean(0)
    return Drift(
        offset_px=float(np.sqrt((apart**2).sum(1).mean())),
        shift_px=(float(mean[0]), float(mean[1])),
        lenslets=len(index),
    )


@dataclass(frozen=True, slots=True)
class _Tile:
    flat: Float32
    corner: Float64
    """(x, y) of its first pixel on the sensor."""


def _tiles(frame: Capture, pitch: float, trusted_field: float) -> list[_Tile]:
    """Cut tiles of even origin out of a frame and even them out; the middle one comes first and is larger."""
    height, width = frame.mosaic.shape
    side = 2 * round(0.5 * _TILE_PITCHES * pitch)
    middle = np.array([width, height]) / 2
    found = [_tile(frame, middle, 3 * side, pitch)]
    for y in np.linspace(side / 2, height - side / 2, min(_TILES_PER_SIDE, height // side)):
        for x in np.linspace(side / 2, width - side / 2, min(_TILES_PER_SIDE, width // side)):
            apart = np.array([x, y]) - middle
            # The middle tile covers one and a half sides to each side already.
            if np.hypot(*apart) < trusted_field * np.hypot(*middle) and np.abs(apart).max() > 1.5 * side:
                found.append(_tile(frame, np.array([x, y]), side, pitch))
    return found


def _tile(frame: Capture, centre: Float64, side: int, pitch: float) -> _Tile:
    height, width = frame.mosaic.shape
    left, top = (2 * int(max(0, c - side / 2) // 2) for c in centre)
    part = frame.mosaic[top : min(height, top + side), left : min(width, left + side)]
    return _Tile(flatten(replace(frame, mosaic=part), pitch), np.array([left, top], np.float64))


def _bright_middle(micro_image: MicroImage, pitch: float) -> bool:
    """Return whether a mean micro-image is brighter in its middle than where three lenslets meet."""
    half = micro_image.brightness.shape[0] // 2
    y, x = np.mgrid[-half : half + 1, -half : half + 1] / BINS_PER_PIXEL
    radius = np.hypot(x, y) / pitch
    middle, rim = (radius < _MIDDLE_PITCHES), (np.abs(radius - 1 / np.sqrt(3)) < _RIM_PITCHES)
    return bool(micro_image.brightness[middle].mean() > micro_image.brightness[rim].mean())


def _measure(
    tiles: list[_Tile], lattice: Lattice, template: MicroImage, shading: float
) -> tuple[Float64, Float64, Float64]:
    """Return lattice coordinates, measured places (px) and weights of the micro-images of all tiles."""
    radius = _FIT_RADIUS_PITCHES * lattice.pitch
    parts = []
    for tile in tiles:
        local = Lattice(lattice.origin - tile.corner, lattice.row, lattice.diagonal)
        # The local mean is one-sided near the border of a tile.
        height, width = tile.flat.shape
        index = local.indices_inside((height, width), radius + lattice.pitch)
        expected = local.origin + index @ local.matrix.T
        centres = measure_centres(tile.flat, expected, template, radius, shading)
        near = np.hypot(*centres.displacement.T) < 0.35 * lattice.pitch
        weight = 1 / np.maximum(centres.misfit, 1e-3) ** 2
        parts.append((index[near], (expected + centres.displacement + tile.corner)[near], weight[near]))
    index, measured, weight = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return index, measured, weight
