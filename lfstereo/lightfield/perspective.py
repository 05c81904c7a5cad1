"""Pictures from between the views: a shifted perspective, and a quilt of many for a holographic display."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from lfstereo.arrays import Float32, Rgb, UInt8
from lfstereo.errors import ConfigError
from lfstereo.lightfield.encoding import srgb8
from lfstereo.lightfield.field import LightField
from lfstereo.options import option
from lfstereo.progress import Progress, silent


@dataclass(frozen=True, slots=True)
class QuiltOptions:
    """How many perspectives a quilt holds, and what lies in the plane of the display."""

    columns: int = option(8, "tiles in a row of the quilt")
    rows: int = option(6, "rows of tiles")
    slope: float = option(0.0, "slope of what shall lie in the plane of the display", "px per view")
    reach_views: float | None = option(
        None, "how far the outer perspectives are from the centre; unset: as far as the views reach", "views"
    )
    tile_width_px: int = option(0, "width of a tile; 0: that of a view", "px")


def perspective_view(light_field: LightField, position: tuple[float, float], slope: float = 0.0) -> Rgb:
    """Return the scene as seen from a place between the views, ``(V, U, 3)``.

    The four views around the place are each moved as something at the slope would move, and blended; what lies at
    that slope is sharp, the rest as sharp as the views are close.

    Parameters
    ----------
    light_field
        Views ``(T, S, V, U, 3)``.
    position
        (x, y) in views from the centre view, x to the right, y downwards; beyond the views, the outermost is shown.
    slope
        px per view.

    Raises
    ------
    ConfigError
        If the position or the slope is not a number.

    Examples
    --------
    Half a view to the right, a point of slope 1 lies half a pixel further left.

    >>> views = np.zeros((1, 3, 1, 9, 3), np.float32)
    >>> for s in range(3):
    ...     views[0, s, 0, 5 - s] = 1.0
    >>> field = LightField(views, None, None, "", "example")
    >>> perspective_view(field, (0.5, 0.0), 1.0)[0, 2:6, 0].tolist()
    [0.0, 0.5, 0.5, 0.0]
    """
    if not np.all(np.isfinite([*position, slope])):
        raise ConfigError(f"position {position}, slope {slope}: expected finite numbers")
    t0, s0 = light_field.centre
    rows, columns = light_field.views.shape[2:4]
    picture = np.zeros((rows, columns, 3), np.float32)
    place = [
        float(np.clip(at + middle, 0, count - 1))
        for at, middle, count in zip(position[::-1], (t0, s0), light_field.views.shape[:2], strict=True)
    ]
    low = [min(int(at), count - 1) for at, count in zip(place, light_field.views.shape[:2], strict=True)]
    for t in (low[0], low[0] + 1):
        for s in (low[1], low[1] + 1):
            gain = (1 - abs(place[0] - t)) * (1 - abs(place[1] - s))
            if gain > 0:
                picture += np.float32(gain) * _moved(
                    light_field.views[t, s], slope * (s - place[1]), slope * (t - place[0])
                )
    return picture


def quilt(light_field: LightField, options: QuiltOptions = QuiltOptions(), progress: Progress = silent) -> UInt8:
    """Return perspectives from left to right as tiles of one picture, for a holographic display.

    The leftmost perspective is the tile at the bottom left; they go on to the right, then row by row upwards.

    Parameters
    ----------
    light_field
        Views ``(T, S, V, U, 3)``.
    options
        Number of tiles and the plane of the display.
    progress
        Told the tiles done.

    Returns
    -------
    ``(rows * v, columns * u, 3)`` 8-bit sRGB.

    Raises
    ------
    ConfigError
        If an option is not possible.

    References
    ----------
    Looking Glass Factory, "Quilts" (developer documentation, 2023): order of tiles and file names.
    """
    if options.columns < 1 or options.rows < 1 or options.tile_width_px < 0:
        raise ConfigError(
            f"quilt of {options.columns} x {options.rows} tiles, {options.tile_width_px} px wide: expected 1 or more "
            "each way, and 0 px or more"
        )
    s0, count_s = light_field.centre[1], light_field.views.shape[1]
    reach = min(s0, count_s - 1 - s0) if options.reach_views is None else options.reach_views
    if not 0 <= reach <= max(s0, count_s - 1 - s0):
        raise ConfigError(f"reach_views = {reach}: expected 0 to {max(s0, count_s - 1 - s0)}, where there are views")
    places = np.linspace(-reach, reach, options.columns * options.rows)
    height, width = _tile_size(light_field, options)
    picture = np.empty((options.rows * height, options.columns * width, 3), np.uint8)
    for n, place in enumerate(places):
        row, column = options.rows - 1 - n // options.columns, n % options.columns
        view = _converged(light_field, float(place), options.slope)
        tile = cv2.resize(view, (width, height), interpolation=cv2.INTER_AREA)
        picture[row * height : (row + 1) * height, column * width : (column + 1) * width] = srgb8(tile)
        progress(n + 1, len(places))
    return picture


def quilt_name(stem: str, light_field: LightField, options: QuiltOptions) -> str:
    """Return the file name by which display software knows the tiles: columns, rows and the tiles' aspect.

    Examples
    --------
    >>> field = LightField(np.zeros((1, 2, 3, 4, 3), np.float32), None, None, "", "example")
    >>> quilt_name("scene", field, QuiltOptions(columns=8, rows=6))
    'scene_qs8x6a1.33.png'
    """
    height, width = _tile_size(light_field, options)
    return f"{stem}_qs{options.columns}x{options.rows}a{width / height:.2f}.png"


def _tile_size(light_field: LightField, options: QuiltOptions) -> tuple[int, int]:
    height, width = light_field.views.shape[2:4]
    if options.tile_width_px == 0:
        return height, width
    return max(1, round(height * options.tile_width_px / width)), options.tile_width_px


def _converged(light_field: LightField, place: float, slope: float) -> Rgb:
    """Return a perspective moved so that what lies at the slope stays where it is."""
    return _moved(perspective_view(light_field, (place, 0.0), slope), slope * place, 0.0)


def _moved(picture: Float32, right_px: float, down_px: float) -> Float32:
    if right_px == 0 and down_px == 0:
        return picture
    rows, columns = picture.shape[:2]
    x, y = np.arange(columns, dtype=np.float32) - right_px, np.arange(rows, dtype=np.float32) - down_px
    map_x = np.ascontiguousarray(np.broadcast_to(x, (rows, columns)))
    map_y = np.ascontiguousarray(np.broadcast_to(y[:, None], (rows, columns)))
    moved: Float32 = cv2.remap(picture, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return moved
