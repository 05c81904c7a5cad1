"""The grid of a white image, fitted once and kept."""

from __future__ import annotations

import dataclasses
import hashlib
from typing import Any

import numpy as np

from lfstereo.container.capture import Capture
from lfstereo.lenslet.fit import fit_grid
from lfstereo.lenslet.grid import LensletGrid
from lfstereo.lenslet.home import remembered
from lfstereo.lenslet.options import GridOptions
from lfstereo.lenslet.smooth_field import SmoothField
from lfstereo.progress import Progress, silent

_METHOD = 1
"""To be raised whenever `fit_grid` gives other numbers."""
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
    stored = remembered(
        f"grid-{digest.hexdigest()[:32]}",
        lambda: dataclasses.asdict(fit_grid(white, options, progress)),
        lambda found: found.keys() == _NAMES,
    )
    return _from_json(stored)


def _from_json(stored: dict[str, Any]) -> LensletGrid:
    field = stored["field"]
    pairs = ("origin_px", "step_u_px", "step_v_px", "sensor_shape")
    values: dict[str, Any] = stored | {name: tuple(stored[name]) for name in pairs}
    if field is not None:
        coefficients = tuple((x, y) for x, y in field["coefficients"])
        values["field"] = SmoothField(field["degree"], coefficients, tuple(field["shape"]))
    return LensletGrid(**values)
