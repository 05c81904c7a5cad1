"""Where to focus: the slope of each textured pixel of a light field, and the range that a stack must span."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from lfstereo.arrays import Bool, Float32
from lfstereo.errors import ConfigError, QualityError, ShapeError
from lfstereo.lightfield.field import LightField
from lfstereo.options import option
from lfstereo.progress import Progress, silent

_LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Weights of linear RGB in luminance, ITU-R BT.709."""
_COARSE_STEP = 0.5
_ROUNDS = ((1, 3), (3, 2), (None, 2))
"""How far views are from the centre view, and how often the slope is improved with them."""
_LEAST_PIXELS = 50
_NEIGHBOURS_AGREE_PX = 0.5
"""Largest difference, at the outermost view, of a slope from the median of the 5 x 5 px around it."""
_LEAST_NOISE = 1e-3
"""Mismatch of views, in square roots of luminance, that rounding alone brings about."""
_TINY = 1e-9


@dataclass(frozen=True, slots=True)
class FocusRangeOptions:
    """How the range of slopes in a light field is found."""

    search: float = option(5.0, "largest slope that is looked for, nearer or farther", "px per view")
    window_px: float = option(2.0, "sigma of the window in which one slope is assumed", "px")
    uncertainty: float = option(0.1, "slopes less certain than this, at the outermost view, do not count", "px")
    share: float = option(0.005, "share of the slopes beyond either limit, taken for wrong")


@dataclass(frozen=True, slots=True)
class SlopeMap:
    """Slopes of a light field as far as its texture tells them."""

    slope: Float32
    """``(V, U)`` px per view of the centre view's pixels, positive = nearer."""
    uncertainty: Float32
    """``(V, U)`` standard deviation of the slope in px per view, from noise and mismatch against texture."""
    certain: Bool
    """``(V, U)`` where the slope can be relied on."""


@dataclass(frozen=True, slots=True)
class FocusRange:
    """The slopes that a focal stack must span."""

    near: float
    """Largest slope, px per view."""
    far: float
    """Smallest slope, px per view."""
    certain_share: float
    """Share of the pixels whose slope could be relied on."""


def find_focus_range(
    light_field: LightField, options: FocusRangeOptions = FocusRangeOptions(), progress: Progress = silent
) -> FocusRange:
    """Find between which slopes the scene of a light field lies.

    Raises
    ------
    ShapeError
        If there is a single view.
    ConfigError
        If an option is not possible.
    QualityError
        If hardly any pixel has texture to tell its slope by.
    """
    if not 0 <= options.share < 0.5:
        raise ConfigError(f"share = {options.share}: expected a share from 0 to below 0.5")
    found = estimate_slopes(light_field, options, progress)
    slopes = found.slope[found.certain]
    if len(slopes) < _LEAST_PIXELS:
        raise QualityError(
            f"{light_field.source}: found {len(slopes)} pixels with a sure slope, expected {_LEAST_PIXELS} or more; "
            "give the near and the far limit"
        )
    far, near = np.quantile(slopes, [options.share, 1 - options.share])
    return FocusRange(near=float(near), far=float(far), certain_share=float(found.certain.mean()))


def estimate_slopes(
    light_field: LightField, options: FocusRangeOptions = FocusRangeOptions(), progress: Progress = silent
) -> SlopeMap:
    """Estimate the slope of each pixel of the centre view from the views in its row and column.

    The best of evenly spaced slopes is found at half size; it is then improved by least squares between the views and
    the image gradient, first with near views, then with all.

    Raises
    ------
    ShapeError
        If there is a single view.
    ConfigError
        If an option is not possible.

    References
    ----------
    Lucas and Kanade, "An iterative image registration technique with an application to stereo vision" (1981);
    Adelson and Wang, "Single lens stereo with a plenoptic camera" (1992), section on depth from view derivatives.
    """
    for name in ("search", "window_px", "uncertainty"):
        if not 0 < getattr(options, name) < np.inf:
            raise ConfigError(f"{name} = {getattr(options, name)}: expected a number above 0")
    cross = _cross(light_field)
    if not cross:
        raise ShapeError(f"{light_field.source}: found a single view, expected two or more to tell slopes from")
    centre = _tone(light_field.views[light_field.centre])
    views = {away: _tone(light_field.views[place]) for away, place in cross.items()}
    slope = _coarse(centre, views, options)
    steps = sum(times for _, times in _ROUNDS)
    done = 0
    uncertainty = np.full_like(slope, np.inf)
    for reach, times in _ROUNDS:
        among = {away: view for away, view in views.items() if reach is None or max(map(abs, away)) <= reach}
        for _ in range(times if among else 0):
            slope, uncertainty = _improved(slope, centre, among, options)
            done += 1
            progress(done, steps)
    outermost = max(max(map(abs, away)) for away in views)
    smooth = cv2.medianBlur(slope, 5)
    agrees = np.abs(slope - smooth) * outermost < _NEIGHBOURS_AGREE_PX
    inside = np.abs(slope) <= options.search
    certain = (uncertainty * outermost < options.uncertainty) & agrees & inside & _within(slope, outermost)
    return SlopeMap(smooth, uncertainty, certain)


def _cross(light_field: LightField) -> dict[tuple[int, int], tuple[int, int]]:
    """Return the views in the centre row and column: (x, y) views away -> (t, s)."""
    t0, s0 = light_field.centre
    count_t, count_s = light_field.views.shape[:2]
    across = {(s - s0, 0): (t0, s) for s in range(count_s) if s != s0}
    return across | {(0, t - t0): (t, s0) for t in range(count_t) if t != t0}


def _tone(view: Float32) -> Float32:
    """Return luminance in even steps of visibility: its square root, lightly smoothed against noise."""
    root: Float32 = np.sqrt(np.maximum(view @ _LUMA, 0))
    smooth: Float32 = cv2.GaussianBlur(root, (0, 0), 0.7)
    return smooth


def _coarse(centre: Float32, views: dict[tuple[int, int], Float32], options: FocusRangeOptions) -> Float32:
    """Return the best of a row of slopes at half size, from the nearest views."""
    half = tuple(max(n // 2, 1) for n in centre.shape[::-1])
    small = cv2.resize(centre, half, interpolation=cv2.INTER_AREA)
    near = {away: view for away, view in views.items() if max(map(abs, away)) <= 2}
    shrunk = {away: cv2.resize(view, half, interpolation=cv2.INTER_AREA) for away, view in near.items()}
    steps = int(np.ceil(options.search / _COARSE_STEP))
    slopes = _COARSE_STEP * np.arange(-steps, steps + 1)
    best, least = np.zeros(small.shape, np.float32), np.full(small.shape, np.inf, np.float32)
    for slope in slopes:
        cost = np.zeros(small.shape, np.float32)
        for (x, y), view in shrunk.items():
            move = np.array([[1, 0, slope * x / 2], [0, 1, slope * y / 2]])
            moved = cv2.warpAffine(view, move, half, borderMode=cv2.BORDER_REPLICATE)
            cost += np.abs(moved - small)
        cost = cv2.GaussianBlur(cost, (0, 0), max(options.window_px, 1.0))
        better = cost < least
        best[better], least[better] = slope, cost[better]
    full: Float32 = cv2.resize(cv2.medianBlur(best, 5), centre.shape[::-1], interpolation=cv2.INTER_NEAREST)
    return full


def _improved(
    slope: Float32, centre: Float32, views: dict[tuple[int, int], Float32], options: FocusRangeOptions
) -> tuple[Float32, Float32]:
    """Return the slope after one step of least squares, and its standard deviation."""
    rows, columns = centre.shape
    x, y = np.meshgrid(np.arange(columns, dtype=np.float32), np.arange(rows, dtype=np.float32))
    kernel = np.array([[-0.5, 0.0, 0.5]], np.float32)
    gradient_x, gradient_y = cv2.filter2D(centre, -1, kernel), cv2.filter2D(centre, -1, kernel.T)
    towards, texture, misfit = (np.zeros(centre.shape, np.float32) for _ in range(3))
    for (right, down), view in views.items():
        moved = cv2.remap(view, x - slope * right, y - slope * down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        change = right * gradient_x + down * gradient_y
        residual = moved - centre
        towards += residual * change
        texture += change * change
        misfit += residual * residual
    sigma = options.window_px
    towards, texture, misfit = (cv2.GaussianBlur(part, (0, 0), sigma) for part in (towards, texture, misfit))
    step = towards / (texture + _TINY)
    limit = 1.0 / max(max(map(abs, away)) for away in views)
    left = np.maximum(misfit - step * towards, 0) / len(views) + np.float32(_LEAST_NOISE**2)
    # A Gaussian window is 4 pi sigma^2 px large; a quarter of them are taken for independent, smoothed as views are.
    deviation = np.sqrt(left / (np.pi * sigma**2 * (texture + _TINY)))
    return slope + np.clip(step, -limit, limit), deviation.astype(np.float32)


def _within(slope: Float32, outermost: int) -> Bool:
    """Return where the outermost views still see the pixel: elsewhere their border was compared."""
    rows, columns = slope.shape
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    room = np.minimum(np.minimum(x, columns - 1 - x), np.minimum(y, rows - 1 - y))
    inside: Bool = np.abs(slope) * outermost <= room
    return inside
