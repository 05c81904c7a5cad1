"""Choose the grid that a photograph is decoded with, and say how well it fits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfstereo.arrays import Float64, UInt16
from lfstereo.container.capture import Capture, read_capture
from lfstereo.container.members import is_archive
from lfstereo.errors import AssetError, GridFitError
from lfstereo.lenslet.between import interpolated_grid, neighbours
from lfstereo.lenslet.drift import measure_drift
from lfstereo.lenslet.fit import estimate_grid_from_photograph
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.home import library_folder
from lfstereo.lenslet.lattice import Lattice
from lfstereo.lenslet.library import WhiteImage, WhiteLibrary, open_library
from lfstereo.lenslet.options import GridOptions
from lfstereo.lenslet.remembered_grid import remembered_grid
from lfstereo.lenslet.white import first_bright, refuse_other_camera, whites_of_camera
from lfstereo.progress import Progress, silent

_BETTER_PX = 0.003
"""An interpolated grid must fit the photograph better by this much to be taken."""


@dataclass(frozen=True, slots=True)
class GridChoice:
    """What a photograph is decoded with."""

    grid: LensletGrid
    white: Capture | None
    """White image for devignetting; ``None`` where there is none that fits."""
    white_grid: LensletGrid | None
    """That white image's own grid: where its micro-images lie."""
    offset_px: float | None
    """RMS distance of the grid from the photograph's micro-images; ``None`` where it was taken from them."""
    hot_pixels: UInt16 | None = None
    """``(N, 2)`` (x, y) pixels that the factory found bad."""
    warning: str = ""
    """What the user must know, on one line; empty where all is well."""

    def white_moved(self) -> Float64 | None:
        """Return the ``(2, 3)`` affine map from places of this grid to those of the white image, px.

        ``None`` where the white image's own grid is used, or there is no white image.
        """
        if self.white_grid is None or self.white_grid is self.grid:
            return None
        here, there = Lattice.of(self.grid), Lattice.of(self.white_grid)
        turn = there.matrix @ here.reciprocal
        middle = np.array([(self.grid.sensor_shape[1] - 1) / 2, (self.grid.sensor_shape[0] - 1) / 2])
        nearest_here = here.origin + np.round((middle - here.origin) @ here.reciprocal.T) @ here.matrix.T
        whole = np.round((nearest_here - there.origin) @ there.reciprocal.T)
        nearest_there = there.origin + whole @ there.matrix.T
        return np.column_stack([turn, nearest_there - turn @ nearest_here])


def choose_grid(
    photograph: Capture, whites: Path | None, options: GridOptions = GridOptions(), progress: Progress = silent
) -> GridChoice:
    """Choose the grid of a photograph: of the nearest white image, between neighbours, or its own.

    The white image of the same camera nearest in zoom, then in focus, is taken, as the Light Field Toolbox does. Where
    the photograph lies between the zoom or focus steps of several, their grids are interpolated, and the
    interpolated one is used if it lies nearer to the photograph's own micro-images. Where no white image fits, or the
    best lies more than ``largest_offset_px`` off, the grid is taken from the photograph, and the choice says so.

    Parameters
    ----------
    photograph
        The capture to decode.
    whites
        Folder or archive of white images, or one white image; ``None`` looks among those imported before
        (``lfstereo whites import``).
    options
        Of the fit and of the choice.
    progress
        Told of the work done.

    Raises
    ------
    AssetError
        If the folder named does not exist, or the one white image named is of another camera.
    ContainerError, MetadataError
        If the chosen white image is damaged.
    GridFitError
        If the white image is none, or the photograph shows no grid that could be trusted.
    """
    if whites is not None and whites.is_file() and not is_archive(whites):
        white = read_capture(whites)
        refuse_other_camera(white.metadata, photograph.metadata, str(whites))
        return _checked(photograph, [(white, remembered_grid(white, options, progress), None)], options, progress)
    if whites is None and not library_folder().is_dir():
        return _own_grid(photograph, "no white images were given", options, progress)
    library = open_library(whites or library_folder())
    try:
        fitting = whites_of_camera(library, photograph.metadata)
        nearest = [first_bright(_of_serial(fitting, serial)) for serial in _serials(fitting)]
    except AssetError as error:
        return _own_grid(photograph, str(error), options, progress)
    found = [(capture, remembered_grid(capture, options, progress), white) for white, capture in nearest]
    if len(found) == 1:
        between = _between(photograph, library, found[0][1], options)
        found += [(found[0][0], between, found[0][2])] if between else []
    return _checked(photograph, found, options, progress)


_Candidate = tuple[Capture, LensletGrid, WhiteImage | None]


def _checked(
    photograph: Capture, candidates: Sequence[_Candidate], options: GridOptions, progress: Progress
) -> GridChoice:
    """Return the candidate nearest to the photograph's micro-images, or the photograph's own grid if none is near."""
    offsets = [_offset(photograph, grid, options) for _, grid, _ in candidates]
    best = 0
    for n in range(1, len(offsets)):
        if offsets[n] < offsets[best] - _BETTER_PX:
            best = n
    white, grid, entry = candidates[best]
    if offsets[best] > options.largest_offset_px:
        far = f"{offsets[best]:.2f} px" if np.isfinite(offsets[best]) else "far"
        reason = (
            f"the grid of {white.source} lies {far} off the picture's own micro-images, at most "
            f"{options.largest_offset_px:g} px are trusted"
        )
        return _own_grid(photograph, reason, options, progress)
    warning = ""
    if not photograph.metadata.serial:
        warning = (
            f"{photograph.source}: tells no serial number; of the cameras known, that of {white.source} fits best, its "
            f"grid lies {offsets[best]:.3f} px off the picture's micro-images"
        )
    return GridChoice(
        grid=grid,
        white=white,
        white_grid=grid if grid.source == "white image" else candidates[0][1],
        offset_px=offsets[best],
        hot_pixels=entry.bad_pixels() if entry else None,
        warning=warning,
    )


def _offset(photograph: Capture, grid: LensletGrid, options: GridOptions) -> float:
    try:
        return measure_drift(photograph, grid, options).offset_px
    except GridFitError:
        return float("inf")


def _own_grid(photograph: Capture, reason: str, options: GridOptions, progress: Progress) -> GridChoice:
    grid = estimate_grid_from_photograph(photograph, options, progress)
    warning = (
        f"{photograph.source}: {reason}; lenslet grid and vignetting are estimated from the picture itself: "
        f"{grid.quality:.0%} of its lenslets agree, standard error {grid.uncertainty_px or 0:.3f} px"
    )
    return GridChoice(grid, white=None, white_grid=None, offset_px=None, warning=warning)


def _serials(whites: tuple[WhiteImage, ...]) -> list[str]:
    return list(dict.fromkeys(white.serial for white in whites))


def _of_serial(whites: tuple[WhiteImage, ...], serial: str) -> tuple[WhiteImage, ...]:
    return tuple(white for white in whites if white.serial == serial)


def _between(
    photograph: Capture, library: WhiteLibrary, nearest: LensletGrid, options: GridOptions
) -> LensletGrid | None:
    """Return the grid interpolated between the white images around a photograph's zoom and focus, if there are any."""
    lens = photograph.metadata.lens
    around = neighbours(library.of_camera(photograph.metadata), lens.zoom_step, lens.focus_step)
    if len(around) < 2:
        return None
    try:
        parts = [(remembered_grid(white.read(), options), share) for white, share in around]
    except GridFitError:
        return None
    pitch = photograph.metadata.lenslets.pitch_m / photograph.metadata.pixel_pitch_m
    return interpolated_grid(parts, nearest, pitch)
