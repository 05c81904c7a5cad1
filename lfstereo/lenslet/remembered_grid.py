"""The grid of a white image, fitted once and kept."""

from __future__ import annotations

import dataclasses
import hashlib
from typing import Any

import numpy as np

from lfstereo.container.capture import Capture
from lfstereo.container.metadata import LARGEST_SIDE_PX
from lfstereo.lenslet.fit import fit_grid
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.home import remembered
from lfstereo.lenslet.options import GridOptions
from lfstereo.lenslet.smooth_field import LARGEST_DEGREE, SmoothField
from lfstereo.progress import Progress, silent

_METHOD = 1
"""To be raised whenever `fit_grid` gives other numbers."""
_LARGEST = 1e9
_SOURCES = ("white image", "white images", "photograph", "given")
_NAMES = frozenset(field.name for field in dataclasses.fields(LensletGrid))


def remembered_grid(white: Capture, options: GridOptions = GridOptions(), progress: Progress = silent) -> LensletGrid:
    """Fit the grid of a white image as `fit_grid` does, or return what an earlier run found.

    Grids are kept in the user's cache folder by the content of the white image and by the options, so that a changed
    file or option is fitted anew. Several processes may ask at once.

    Raises
    ------
    GridFitError
        If the frame is no white image, shows no hexagonal pattern, or too few lenslets agree.
    ShapeError
        If the frame is smaller than a dozen lenslets.
    """
    meta = white.metadata
    digest = hashlib.sha256(np.ascontiguousarray(white.mosaic).data)
    digest.update(
        repr((_METHOD, options, meta.black, meta.white, meta.bayer, meta.lenslets, meta.pixel_pitch_m)).encode()
    )
    return remembered(
        f"grid-{digest.hexdigest()[:32]}",
        lambda: dataclasses.asdict(fit_grid(white, options, progress)),
        grid_from_json,
    )


def grid_from_json(stored: Any) -> LensletGrid:
    """Return the grid that was stored as the dictionary of its fields.

    Raises
    ------
    KeyError, TypeError, ValueError
        If a part of it is missing or unknown, or holds a value that cannot be.
    """
    if not isinstance(stored, dict) or stored.keys() != _NAMES:
        raise TypeError("found another form of grid")
    uncertainty, field, source = stored["uncertainty_px"], stored["field"], stored["source"]
    grid = LensletGrid(
        origin_px=_pair(stored["origin_px"]),
        step_u_px=_pair(stored["step_u_px"]),
        step_v_px=_pair(stored["step_v_px"]),
        first_shifted_row=_whole(stored["first_shifted_row"]) % 2,
        rows=_whole(stored["rows"]),
        columns=_whole(stored["columns"]),
        sensor_shape=_shape(stored["sensor_shape"]),
        residual_px=_number(stored["residual_px"]),
        quality=_number(stored["quality"]),
        source=str(source),
        uncertainty_px=None if uncertainty is None else _number(uncertainty),
        field=None if field is None else _field(field),
    )
    if grid.source not in _SOURCES:
        raise ValueError(f"found a grid of {source!r}")
    return grid


def _field(stored: Any) -> SmoothField:
    degree, pairs = _whole(stored["degree"]), tuple(_pair(pair) for pair in stored["coefficients"])
    if degree > LARGEST_DEGREE or len(pairs) != (degree + 1) * (degree + 2) // 2:
        raise ValueError(f"found {len(pairs)} coefficients of degree {degree}")
    return SmoothField(degree, pairs, _shape(stored["shape"]))


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _LARGEST:
        raise ValueError(f"found {value!r}, expected a number")
    return float(value)


def _pair(values: Any) -> tuple[float, float]:
    x, y = values
    return _number(x), _number(y)


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LARGEST_SIDE_PX:
        raise ValueError(f"found {value!r}, expected a whole number of px or rows")
    return value


def _shape(values: Any) -> tuple[int, int]:
    height, width = values
    return _whole(height), _whole(width)
