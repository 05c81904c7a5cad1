"""Pictures of a light field for looking at: views side by side and epipolar-plane images."""

from __future__ import annotations

import cv2
import numpy as np

from lfstereo.arrays import Float32, Rgb, UInt8
from lfstereo.errors import ConfigError
from lfstereo.lightfield.encoding import srgb8
from lfstereo.lightfield.field import LightField

_GAP = 4
_EPI_ZOOM = 4


def horizontal_epi(light_field: LightField, row: int, view_row: int | None = None) -> Rgb:
    """Return the epipolar-plane image of one image row through a row of views, by default the centre one.

    Returns
    -------
    ``(S, U, 3)``: a point of slope sigma draws a line that moves by ``-sigma`` px per row downwards.

    Raises
    ------
    ConfigError
        If the light field has no such row.
    """
    t = light_field.centre[0] if view_row is None else view_row
    _check_inside(light_field, "row", row, 2)
    _check_inside(light_field, "row of views", t, 0)
    return np.ascontiguousarray(light_field.views[t, :, row])


def vertical_epi(light_field: LightField, column: int, view_column: int | None = None) -> Rgb:
    """Return the epipolar-plane image of one image column through a column of views, ``(T, V, 3)``.

    Raises
    ------
    ConfigError
        If the light field has no such column.
    """
    s = light_field.centre[1] if view_column is None else view_column
    _check_inside(light_field, "column", column, 3)
    _check_inside(light_field, "column of views", s, 1)
    return np.ascontiguousarray(light_field.views[:, s, :, column])


def _check_inside(light_field: LightField, name: str, index: int, axis: int) -> None:
    count = light_field.views.shape[axis]
    if not 0 <= index < count:
        raise ConfigError(f"{light_field.source}: found {name} {index}, expected 0 to {count - 1}")


def display_gain(light_field: LightField) -> float:
    """Return the factor that brings the brighter parts of the centre view near white."""
    bright = float(np.percentile(light_field.views[light_field.centre][::2, ::2], 99))
    return 1.0 / max(bright, 1e-3)


def montage(light_field: LightField, raw_crop: UInt8 | None = None) -> UInt8:
    """Draw the centre view, nine views at half size and three EPIs into one picture.

    Parameters
    ----------
    light_field
        What to draw; brightness is stretched so that 99 % of the centre view fits.
    raw_crop
        ``(h, w, 3)`` picture of the raw frame with the grid drawn over it, added below if given.

    Returns
    -------
    ``(H, W, 3)`` uint8 sRGB.
    """
    gain = np.float32(display_gain(light_field))
    rows, columns = light_field.views.shape[:2]
    height, width = light_field.views.shape[2:4]
    centre = srgb8(light_field.views[light_field.centre] * gain)
    t_picks, s_picks = ([round(n * f) for f in (0.25, 0.5, 0.75)] for n in (rows - 1, columns - 1))
    small = (max(width // 3, 1), max(height // 3, 1))
    nine = _stack(
        [_stack([_shrunk(light_field.views[t, s] * gain, small) for s in s_picks], axis=1) for t in t_picks], axis=0
    )
    epis = _stack([_epi(light_field, round(height * f), gain) for f in (0.3, 0.5, 0.7)], axis=0)
    parts = [_stack([centre, nine], axis=1), epis]
    if raw_crop is not None:
        parts.append(raw_crop)
    return _stack(parts, axis=0)


def _epi(light_field: LightField, row: int, gain: np.float32) -> UInt8:
    return np.repeat(srgb8(horizontal_epi(light_field, row) * gain), _EPI_ZOOM, axis=0)


def _shrunk(view: Float32, size: tuple[int, int]) -> UInt8:
    return srgb8(np.asarray(cv2.resize(view, size, interpolation=cv2.INTER_AREA), np.float32))


def _stack(pictures: list[UInt8], axis: int) -> UInt8:
    """Put pictures in a row (axis 1) or column (axis 0), padded to one size, with a gap between."""
    across = max(picture.shape[1 - axis] for picture in pictures)
    padded = []
    for n, picture in enumerate(pictures):
        room = [(0, 0), (0, 0), (0, 0)]
        room[1 - axis] = (0, across - picture.shape[1 - axis])
        room[axis] = (0, _GAP if n < len(pictures) - 1 else 0)
        padded.append(np.pad(picture, room))
    return np.concatenate(padded, axis=axis)
