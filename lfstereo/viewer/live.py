"""Refocus while somebody watches: any slope, aperture and tilt in a fraction of a tenth of a second.

Views are kept as bytes, the square root of linear light, so that a whole light field fits into a fifth of the memory
that its floats need and into the bandwidth of an ordinary machine. Exact refocusing is :mod:`lfstereo.focus.refocus`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lfstereo.arrays import Float32, Rgb, UInt8, check_shape
from lfstereo.errors import ConfigError
from lfstereo.focus.measures import depth_from_focus
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.encoding import srgb8, srgb_to_linear
from lfstereo.lightfield.field import LightField

BORDER_PX = 24
"""Px by which every view is continued on all sides; no view is shifted farther."""
_LARGEST_PEAK = 4.0
_STEPS_PER_CODE = 16
_CANDIDATES = 25
_WIDEST_SLOPE = 1.0
"""Slope, px per view, beyond which nothing is looked for."""
_LEAST_SPARE = 0.05


@dataclass(frozen=True, slots=True)
class LiveField:
    """Views of a light field, ready to be refocused at once."""

    codes: UInt8
    """``(N, V + 2 border, (U + 2 border) * 3)``: 255 times the square root of the share of ``peak``."""
    places: Float32
    """``(N, 2)`` (s, t) of each view from the centre, row of the grid by row."""
    size: tuple[int, int]
    """(V, U) of the views."""
    peak: float
    """Linear light that the code 255 stands for."""
    gain: float
    """Factor on linear light that makes a picture as bright as the page's others."""

    @property
    def radius_views(self) -> float:
        """Radius of the largest round aperture, views."""
        reach = np.abs(self.places).max(axis=0)
        return float(min(n for n in reach if n > 0 or not reach.any())) + 0.5

    @property
    def largest_slope(self) -> float:
        """Slope, px per view, at which the outermost view reaches the border."""
        return float((BORDER_PX - 2) / max(1.0, np.abs(self.places).max()))


@dataclass(frozen=True, slots=True)
class LiveFocus:
    """Where a live picture is focused."""

    slope: float
    """Px per view at the picture's middle."""
    radius_views: float
    """Radius of the round aperture."""
    tilt: tuple[float, float] = field(default=(0.0, 0.0))
    """Slope gained from the left to the right border, and from the top to the bottom."""


def live_field(light_field: LightField, gain: float) -> LiveField:
    """Take the views of a light field; those without any confidence show the centre view instead.

    Parameters
    ----------
    light_field
        Views of any grid.
    gain
        Factor that makes its pictures bright enough to look at.
    """
    count_t, count_s = light_field.views.shape[:2]
    t0, s0 = light_field.centre
    peak = min(max(1.0, float(light_field.views.max())), _LARGEST_PEAK / gain)
    centre = _codes(light_field.views[t0, s0], peak)
    codes = np.empty((count_t * count_s, *_bordered(centre).shape), np.uint8)
    for n in range(len(codes)):
        t, s = divmod(n, count_s)
        view = _codes(light_field.views[t, s], peak)
        if light_field.weight is not None:
            blind = light_field.weight[t, s] == 0
            view[blind] = centre[blind]
        codes[n] = _bordered(view)
    places = np.array([(s - s0, t - t0) for t in range(count_t) for s in range(count_s)], np.float32)
    return LiveField(codes, places, light_field.views.shape[2:4], peak, gain)


def live_field_from_pictures(pictures: list[UInt8], places: list[tuple[int, int]]) -> LiveField:
    """Take ``(V, U, 3)`` sRGB pictures of views at the given (s, t)."""
    order = sorted(range(len(places)), key=lambda n: (places[n][1], places[n][0]))
    codes = np.stack([_bordered(_codes(srgb_to_linear(pictures[n]), 1.0)) for n in order])
    return LiveField(codes, np.array([places[n] for n in order], np.float32), pictures[0].shape[:2], 1.0, 1.0)


def render(live: LiveField, focus: LiveFocus) -> Rgb:
    """Return the ``(V, U, 3)`` linear RGB picture of a round aperture, as :func:`lfstereo.focus.refocus.refocus`.

    Raises
    ------
    ConfigError
        If the aperture has no radius, or a view would be shifted by more than its border.
    """
    from lfstereo.viewer.live_kernel import refocus_codes

    gains = _gains(live, focus)
    rows, columns = live.size
    right, down = focus.tilt[0] / max(columns - 1, 1), focus.tilt[1] / max(rows - 1, 1)
    corner = focus.slope - 0.5 * (focus.tilt[0] + focus.tilt[1])
    begins = np.diff(live.places[:, 1], prepend=np.float32(-1e6)) != 0
    picture = np.empty((rows, columns, 3), np.float32)
    plane = (float(corner), float(right), float(down))
    refocus_codes(live.codes, live.places, gains, begins.astype(np.uint8), BORDER_PX, plane, picture)
    picture *= np.float32(live.peak / 255**2)
    return picture


def picture_of(live: LiveField, linear: Rgb) -> UInt8:
    """Return the 8-bit sRGB picture of linear RGB at the field's brightness."""
    steps = np.sqrt(linear * np.float32(1.0 / live.peak)) * np.float32(255 * _STEPS_PER_CODE)
    index = np.minimum(steps, 255 * _STEPS_PER_CODE).astype(np.uint16)
    ramp = (np.arange(255 * _STEPS_PER_CODE + 1, dtype=np.float32) / np.float32(255 * _STEPS_PER_CODE)) ** 2
    table = srgb8(ramp * np.float32(live.peak * live.gain))
    picture: UInt8 = table[index]
    return picture


def slope_map(live: LiveField) -> tuple[Float32, tuple[float, float]]:
    """Find what slope every px is in focus at, from a coarse focal stack.

    Returns
    -------
    slopes
        ``(V, U)`` px per view.
    span
        Slopes of the farthest and of the nearest things that stand out, with a little to spare.
    """
    most = min(_WIDEST_SLOPE, live.largest_slope)
    candidates = np.linspace(most, -most, _CANDIDATES, dtype=np.float32)
    slices = np.stack([render(live, LiveFocus(float(slope), live.radius_views)) for slope in candidates])
    found = depth_from_focus(FocalStack(slices * np.float32(live.gain), candidates, 1.0, "live view"))
    clear = found.confidence >= np.median(found.confidence)
    far, near = np.percentile(found.disparity[clear], [2, 98])
    spare = max(0.12 * (near - far), _LEAST_SPARE)
    most = live.largest_slope
    return found.disparity, (float(max(far - spare, -most)), float(min(near + spare, most)))


def _gains(live: LiveField, focus: LiveFocus) -> Float32:
    if not 0 < focus.radius_views < np.inf:
        raise ConfigError(f"radius = {focus.radius_views} views: expected one above 0")
    steepest = abs(focus.slope) + 0.5 * (abs(focus.tilt[0]) + abs(focus.tilt[1]))
    if not steepest <= live.largest_slope:
        raise ConfigError(f"slope = {steepest} px per view, expected at most {live.largest_slope:.3f}, tilt included")
    gains = np.clip(focus.radius_views + 0.5 - np.hypot(live.places[:, 0], live.places[:, 1]), 0.0, 1.0)
    shares: Float32 = np.asarray(gains / gains.sum(), np.float32)
    return shares


def _codes(view: Rgb, peak: float) -> UInt8:
    check_shape("view", view, (None, None, 3))
    share = np.clip(view * np.float32(1.0 / peak), 0.0, 1.0)
    codes: UInt8 = np.rint(np.sqrt(share) * np.float32(255)).astype(np.uint8)
    return codes


def _bordered(view: UInt8) -> UInt8:
    wide = np.pad(view, ((BORDER_PX, BORDER_PX), (BORDER_PX, BORDER_PX), (0, 0)), mode="edge")
    return wide.reshape(wide.shape[0], -1)
