"""A fitted grid against the lattice that the factory noted for the same zoom and focus."""

from __future__ import annotations

import numpy as np

from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.lattice import Lattice
from lfstereo.lenslet.library import WhiteImage

_PLACES_PER_SIDE = 5


def factory_offset(grid: LensletGrid, white: WhiteImage) -> float | None:
    """Return the RMS distance in px of a white image's grid from the factory's lattice, modulo whole lenslets.

    What the factory noted is a start value of unknown convention, so a distance of a px or two is no fault of the grid.

    Parameters
    ----------
    grid
        Fitted to the white image.
    white
        The white image, with the camera's table of lattices.

    Returns
    -------
    Distance over the whole sensor; ``None`` where the table has no entry for this zoom and focus step.

    Raises
    ------
    ContainerError, MetadataError
        If the table is damaged.
    """
    wanted = white.zoom_step, white.focus_step
    found = next((f for f in white.factory_lattices() if (f.zoom_step, f.focus_step) == wanted), None)
    if found is None:
        return None
    height, width = grid.sensor_shape
    steps = np.linspace(0, 1, _PLACES_PER_SIDE)
    places = np.stack(np.meshgrid(steps * width, steps * height), axis=-1).reshape(-1, 2)
    noted = Lattice(np.array(found.origin_px), np.array(found.step_x_px), np.array(found.step_y_px))
    points = noted.origin + np.round((places - noted.origin) @ noted.reciprocal.T) @ noted.matrix.T
    fitted = Lattice.of(grid)
    index = (points - fitted.origin) @ fitted.reciprocal.T
    apart = (index - np.round(index)) @ fitted.matrix.T
    return float(np.sqrt((apart**2).sum(1).mean()))
