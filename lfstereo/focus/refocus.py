"""Refocus a light field by shift-and-add, and render the focal stack of one camera of a rectified pair."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.conventions import DISPARITY_RANGE_PX, SLICES_DEFAULT
from lfstereo.errors import InputError, ShapeError
from lfstereo.focus.aperture import RefocusOptions, aperture_weights, blur_ratio
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.field import LightField
from lfstereo.progress import Progress, silent

_ROWS_PER_REPORT = 128
_LEAST_WEIGHT = 1e-4
"""Summed weight, in fully trusted views, below which a slice shows the centre view instead of a quotient."""


def slice_disparities(d_max: float = DISPARITY_RANGE_PX, d_min: float = 0.0, count: int = SLICES_DEFAULT) -> Float32:
    """Return evenly spaced focus disparities from near to far.

    Parameters
    ----------
    d_max, d_min
        Disparity (px) of the nearest and of the farthest slice.
    count
        Number of slices.

    Raises
    ------
    InputError
        If there are fewer than two slices, or ``d_max`` is not above ``d_min``.

    Examples
    --------
    >>> slice_disparities(90.0, 0.0, 4).tolist()
    [90.0, 60.0, 30.0, 0.0]
    """
    if count < 2:
        raise InputError(f"slices: found {count}, expected at least 2")
    if not (np.isfinite(d_max) and np.isfinite(d_min) and d_max > d_min):
        raise InputError(
            f"slices: found disparities from {d_max} to {d_min} px, expected them to fall from near to far"
        )
    return np.linspace(d_max, d_min, count, dtype=np.float32)


def render_stack(
    light_field: LightField,
    disparities_px: Float32,
    slope_from_disparity: tuple[float, float],
    aperture_ratio: float | None = None,
    options: RefocusOptions = RefocusOptions(),
    progress: Progress = silent,
) -> FocalStack:
    """Refocus a rectified light field at a row of disparities.

    Parameters
    ----------
    light_field
        Views of one camera of the rectified pair.
    disparities_px
        ``(K,)`` disparity (px of the rectified left centre view) of each slice, falling from near to far.
    slope_from_disparity
        Slope in px per view is ``first * disparity + second``.
    aperture_ratio
        Blur diameter in px per px of disparity, D/B; unset: what the number of views tells.
    options
        Which views take part.
    progress
        Told the image rows done.

    Raises
    ------
    InputError
        If the disparities do not fall, or a slope cannot be.
    ShapeError
        If the disparities are not a row of numbers, or the views are not float32.
    ConfigError
        If the radius of the aperture is not positive.
    """
    per_px, at_zero = slope_from_disparity
    focused = np.asarray(disparities_px, np.float32)
    if aperture_ratio is None:
        aperture_ratio = blur_ratio(light_field, per_px, options)
    slices = refocus(light_field, focused.astype(np.float64) * per_px + at_zero, options, progress)
    return FocalStack(slices, focused, aperture_ratio, light_field.source)


def refocus(
    light_field: LightField,
    slopes: Sequence[float] | Float64 | Float32,
    options: RefocusOptions = RefocusOptions(),
    progress: Progress = silent,
) -> Float32:
    """Return the pictures that a lens of the light field's aperture takes when focused at each slope.

    A picture is the mean over the views of ``I_ts(x - slope (s - s0), y - slope (t - t0))``, linearly
    interpolated and weighted by the aperture and by the confidence of each sample; a sample outside its
    view has no weight. A pixel that no weight reaches shows the centre view.

    Parameters
    ----------
    light_field
        Views ``(T, S, V, U, 3)``.
    slopes
        ``(K,)`` px of shift between neighbouring views, positive = nearer than the plane of zero slope.
    options
        Which views take part.
    progress
        Told the image rows done.

    Returns
    -------
    Float32
        ``(K, V, U, 3)`` linear RGB.

    Raises
    ------
    ShapeError
        If the slopes are not a list of numbers, or the views are not float32.
    InputError
        If a slope is not finite or moves a view by more than its own size.
    ConfigError
        If the radius of the aperture is not positive.

    References
    ----------
    Ng, Levoy, Brédif, Duval, Horowitz, Hanrahan, "Light field photography with a hand-held plenoptic camera"
    (2005), section 4.

    Examples
    --------
    A point one pixel to the left in the view to the right has slope 1, and is sharp there.

    >>> views = np.zeros((1, 3, 1, 7, 3), np.float32)
    >>> for s in range(3):
    ...     views[0, s, 0, 4 - s] = 1.0
    >>> field = LightField(views, None, None, "", "example")
    >>> refocus(field, [1.0], RefocusOptions(aperture="all"))[0, 0, :, 0].tolist()
    [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    """
    slopes_px = _checked_slopes(light_field, slopes)
    aperture = aperture_weights(light_field, options)
    rows, columns = light_field.views.shape[2:4]
    slices = np.empty((len(slopes_px), rows, columns, 3), np.float32)
    for first in range(0, rows, _ROWS_PER_REPORT):
        last = min(first + _ROWS_PER_REPORT, rows)
        slices[:, first:last] = _refocused_rows(light_field, slopes_px, aperture, first, last)
        progress(last, rows)
    return slices


def _checked_slopes(light_field: LightField, slopes: Sequence[float] | Float64 | Float32) -> Float64:
    where = light_field.source or "light field"
    slopes_px = np.asarray(slopes, np.float64)
    if slopes_px.ndim != 1 or slopes_px.size == 0:
        raise ShapeError(f"{where}: found slopes of shape {slopes_px.shape}, expected (K,) with at least one")
    if light_field.views.dtype != np.float32:
        raise ShapeError(f"{where}: found views of type {light_field.views.dtype}, expected float32 linear RGB")
    largest = max(light_field.views.shape[2:4])
    for slope in slopes_px:
        if not abs(slope) <= largest:
            raise InputError(f"{where}: slope {slope} px per view, expected a shift within the view ({largest} px)")
    return slopes_px


def _refocused_rows(field: LightField, slopes_px: Float64, aperture: Float32, first: int, last: int) -> Float32:
    from lfstereo.focus.shift_kernels import sum_views, sum_weighted_views

    count_t, count_s, rows, columns = field.views.shape[:4]
    views = np.ascontiguousarray(field.views).reshape(count_t, count_s, rows, columns * 3)
    summed = np.zeros((len(slopes_px), last - first, columns * 3), np.float32)
    if field.weight is None:
        sum_views(views, aperture, slopes_px, field.centre, first, summed)
        weights = _coverage(field, slopes_px, aperture)[:, first:last]
    else:
        weights = np.zeros((len(slopes_px), last - first, columns), np.float32)
        weight = np.ascontiguousarray(field.weight)
        sum_weighted_views(views, weight, aperture, slopes_px, field.centre, first, summed, weights)
    reached = weights > _LEAST_WEIGHT
    summed = summed.reshape(len(slopes_px), last - first, columns, 3)
    summed *= (1.0 / np.where(reached, weights, 1.0)).astype(np.float32)[..., None]
    if not reached.all():
        centre = np.broadcast_to(field.views[field.centre][first:last], summed.shape)
        summed[~reached] = centre[~reached]
    return summed


def _coverage(field: LightField, slopes_px: Float64, aperture: Float32) -> Float32:
    """Summed weight ``(K, V, U)`` of the samples that lie inside their view, where all count alike."""
    t0, s0 = field.centre
    rows, columns = field.views.shape[2:4]

    def inside(count: int, views_away: Float64) -> Float64:
        at = np.arange(count) - slopes_px[:, None, None] * views_away[:, None]
        return np.clip(np.minimum(at + 1.0, count - at), 0.0, 1.0)

    along_u = inside(columns, np.arange(field.views.shape[1], dtype=np.float64) - s0)
    along_v = inside(rows, np.arange(field.views.shape[0], dtype=np.float64) - t0)
    return (along_v.transpose(0, 2, 1) @ (aperture.astype(np.float64) @ along_u)).astype(np.float32)
