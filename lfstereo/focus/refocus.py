"""Refocus a light field by shift-and-add, and render the focal stack of one camera of a rectified pair."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lfstereo.arrays import Float32, Float64
from lfstereo.conventions import DISPARITY_RANGE_PX, SLICES_DEFAULT
from lfstereo.errors import ConfigError, InputError, ShapeError
from lfstereo.focus.aperture import RefocusOptions, aperture_weights, blur_ratio
from lfstereo.focus.stack import FocalStack
from lfstereo.lightfield.field import LightField
from lfstereo.progress import Progress, silent

_ROWS_PER_REPORT = 128


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

    A picture is the mean over the views of ``I_ts(x - slope (s - s0), y - slope (t - t0))``, interpolated linearly,
    by cubic convolution or exactly, and weighted by the aperture and by the confidence of each sample; a sample
    outside its view has no weight. A pixel that no weight reaches shows the centre view.

    Parameters
    ----------
    light_field
        Views ``(T, S, V, U, 3)``.
    slopes
        ``(K,)`` px of shift between neighbouring views, positive = nearer than the plane of zero slope; with a tilt,
        that of the picture's middle.
    options
        Which views take part, how they are shifted, and what is shown of their values.
    progress
        Told the work done.

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
        If the aperture has no area, or two options do not go together.

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
    slopes_px = _checked_slopes(light_field, slopes, options)
    field = _without_dim_samples(light_field, options.least_weight)
    aperture = aperture_weights(field, options)
    if options.reduction != "mean" or any(options.tilt):
        from lfstereo.focus.view_statistics import reduce_views

        return reduce_views(field, slopes_px, aperture, options, progress)
    if options.interpolation == "fourier":
        from lfstereo.focus.spectral_shift import refocus_by_spectrum

        return refocus_by_spectrum(field, slopes_px, aperture, progress)
    return _averaged(field, slopes_px, aperture, options.interpolation == "cubic", progress)


def _averaged(field: LightField, slopes_px: Float64, aperture: Float32, cubic: bool, progress: Progress) -> Float32:
    from lfstereo.focus.shift_kernels import average_views

    count_t, count_s, rows, columns = field.views.shape[:4]
    views = np.ascontiguousarray(field.views).reshape(count_t, count_s, rows, columns * 3)
    if field.weight is None:
        weight, coverage = np.empty((0, 0, 0, 0), np.uint8), _coverage(field, slopes_px, aperture, cubic)
    else:
        weight, coverage = np.ascontiguousarray(field.weight), np.empty((1, 1, 0), np.float32)
    slices = np.empty((len(slopes_px), rows, columns * 3), np.float32)
    for first in range(0, rows, _ROWS_PER_REPORT):
        last = min(first + _ROWS_PER_REPORT, rows)
        part = slices[:, first:last]
        average_views(views, weight, coverage, aperture, slopes_px, field.centre, cubic, first, part)
        progress(last, rows)
    return slices.reshape(len(slopes_px), rows, columns, 3)


def _checked_slopes(
    light_field: LightField, slopes: Sequence[float] | Float64 | Float32, options: RefocusOptions
) -> Float64:
    where = light_field.source or "light field"
    slopes_px = np.asarray(slopes, np.float64)
    if slopes_px.ndim != 1 or slopes_px.size == 0:
        raise ShapeError(f"{where}: found slopes of shape {slopes_px.shape}, expected (K,) with at least one")
    if light_field.views.dtype != np.float32:
        raise ShapeError(f"{where}: found views of type {light_field.views.dtype}, expected float32 linear RGB")
    largest = max(light_field.views.shape[2:4])
    lean = 0.5 * (abs(options.tilt[0]) + abs(options.tilt[1]))
    for slope in slopes_px:
        if not abs(slope) + lean <= largest:
            raise InputError(f"{where}: slope {slope} px per view, expected a shift within the view ({largest} px)")
    return slopes_px


def _without_dim_samples(light_field: LightField, least: float) -> LightField:
    """Return the light field with no weight where it is below a share of the largest."""
    if not 0 <= least <= 1:
        raise ConfigError(f"least_weight = {least}: expected a share from 0 to 1")
    if least == 0 or light_field.weight is None:
        return light_field
    weight = np.where(light_field.weight >= 255 * least, light_field.weight, 0).astype(np.uint8)
    return replace(light_field, weight=weight)


def _coverage(field: LightField, slopes_px: Float64, aperture: Float32, cubic: bool) -> Float32:
    """Summed weight ``(K, V, U)`` of the samples that lie inside their view, where all count alike."""
    t0, s0 = field.centre
    rows, columns = field.views.shape[2:4]
    along_u = _inside(columns, slopes_px[:, None] * (np.arange(field.views.shape[1]) - s0), cubic)
    along_v = _inside(rows, slopes_px[:, None] * (np.arange(field.views.shape[0]) - t0), cubic)
    return (along_v.transpose(0, 2, 1) @ (aperture.astype(np.float64) @ along_u)).astype(np.float32)


def _inside(count: int, shifts_px: Float64, cubic: bool) -> Float64:
    """Return ``(*shifts, count)`` what is left of a row of ones after a shift."""
    from lfstereo.focus.shift_kernels import TAPS, tap_gains

    gains = np.empty(TAPS, np.float32)
    left = np.zeros((*shifts_px.shape, count))
    for place in np.ndindex(shifts_px.shape):
        first = tap_gains(float(shifts_px[place]), cubic, gains)
        for j, gain in enumerate(gains):
            left[place][max(0, first + j) : max(0, count + min(0, first + j))] += gain
    return left
