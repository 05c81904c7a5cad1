"""An item, opened: the content of its page and the views to refocus it from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lfstereo import __version__
from lfstereo.arrays import Float32
from lfstereo.errors import ContainerError, LfstereoError
from lfstereo.lightfield.encoding import srgb8
from lfstereo.lightfield.field import LightField
from lfstereo.lightfield.samples import sample_views
from lfstereo.lightfield.views import display_gain
from lfstereo.pipeline import open_light_field
from lfstereo.progress import Progress, silent
from lfstereo.viewer.content import PAGE_NAME, encode_views
from lfstereo.viewer.embedding import array_text, colour_table, jpeg_uri, picture_from_uri
from lfstereo.viewer.live import LiveField, live_field, live_field_from_pictures, slope_map
from lfstereo.viewer.shelf import Item
from lfstereo.viewer.template import read_content

_LEAST_VIEWS = 4
"""Fewer views make no picture worth refocusing."""
_SLOPE_PER_CODE = 1 / 4096


@dataclass(frozen=True, slots=True)
class OpenItem:
    """What the server needs of one item."""

    content: dict[str, Any]
    """As :mod:`lfstereo.viewer.content` says, without ``live``."""
    live: LiveField | None
    """``None`` where there are too few views."""
    slope_from_axis: tuple[float, float]
    """``(a, b)`` of ``slope = a x + b`` for a value x of the focus scale."""
    folder: Path | None
    """The result folder, whose files may be asked for."""


def open_item(item: Item, whites: Path | None = None, progress: Progress = silent) -> OpenItem:
    """Read a result's page, or read or decode a light field.

    Parameters
    ----------
    item
        What to open.
    whites
        Folder of white images, needed for raw captures.
    progress
        Told the work done on a raw capture.

    Raises
    ------
    InputError
        If the file cannot be read, or a raw capture's white images are missing.
    QualityError
        If the lenslet grid of a raw capture cannot be trusted.
    """
    if item.kind == "result":
        return _open_result(item)
    return _open_field(item, open_light_field(item.path, whites, progress))


def _open_result(item: Item) -> OpenItem:
    page = item.path / PAGE_NAME
    content = read_content(page)
    try:
        views = content["views"]
        pictures = [picture_from_uri(view["picture"]) for view in views]
        places = [(int(view["s"]), int(view["t"])) for view in views]
        first, second = (float(value) for value in content["slope_from_disparity"])
        live = live_field_from_pictures(pictures, places) if len(views) >= _LEAST_VIEWS else None
    except (KeyError, TypeError, ValueError, IndexError) as error:
        if isinstance(error, LfstereoError):
            raise
        raise ContainerError(f"{page}: damaged ({error!r}); run the pair again to get a new page") from error
    return OpenItem(content, live, (first, second), item.path)


def _open_field(item: Item, light_field: LightField) -> OpenItem:
    gain = display_gain(light_field)
    count_t, count_s, rows, columns = light_field.views.shape[:4]
    live = live_field(light_field, gain) if count_t * count_s >= _LEAST_VIEWS else None
    slopes, (far, near) = slope_map(live) if live is not None else (None, (-1.0, 1.0))
    described = {
        "views": f"{count_s} × {count_t}",
        "size": f"{columns} × {rows} px",
        "camera": light_field.serial or "unknown",
        "zoom step": "unknown" if light_field.zoom_step is None else light_field.zoom_step,
        "focus step": "unknown" if light_field.focus_step is None else light_field.focus_step,
        "shown brighter by": round(gain, 2),
    }
    centre = srgb8(light_field.views[light_field.centre] * gain)
    content = {
        "title": [Path(item.name).name],
        "lede": f"{count_s} × {count_t} views of {columns} × {rows} px, {item.kind}.",
        "made": f"lfstereo {__version__}",
        "size": [rows, columns],
        "turbo": colour_table(),
        "pictures": {"centre_left": jpeg_uri(centre)},
        "slices": [],
        **encode_views(sample_views(light_field, gain)),
        "disparity": None,
        "overlays": [],
        "slopes": None if slopes is None else _encoded(slopes),
        "geometry": None,
        "axis": {"near": near, "far": far, "unit": "px per view", "metric": False},
        "slope_from_disparity": None,
        "record": {"field": described},
        "files": [],
        "live": None,
    }
    return OpenItem(content, live, (1.0, 0.0), None)


def _encoded(slopes: Float32) -> dict[str, Any]:
    """Return slopes as 16-bit codes from the lowest on."""
    lowest = float(slopes.min())
    codes = np.rint((slopes - lowest) / _SLOPE_PER_CODE).astype(np.uint16)
    return {"values": array_text(codes), "lowest": lowest, "slope_per_code": _SLOPE_PER_CODE}
