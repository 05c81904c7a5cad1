"""Filters of a light field that let one depth, a range of depths, or anything that is a scene at all through.

What lies at one slope has its spectrum on a plane through zero: ``ft = slope * fv`` and ``fs = slope * fu``. A range of
slopes spans a fan in each of these two pairs of axes (the dual fan), all slopes together lie on a hypercone, and where
the two meet is the hyperfan, the smallest set that holds a range of depths.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Literal

import numpy as np
import scipy.fft

from lfstereo.arrays import Float32, Views
from lfstereo.errors import ConfigError
from lfstereo.lightfield.field import LightField
from lfstereo.options import option
from lfstereo.progress import Progress, silent

FilterKind = Literal["line", "plane", "dual-fan", "hypercone", "hyperfan"]
_LEAST_WEIGHT = 10 * float(np.finfo(np.float32).eps)
_SWEPT_PLANES = 5
Axes = tuple[Float32, Float32, Float32, Float32]
"""Frequencies along t, s, v and u in cycles per sample, each ready to be broadcast against the others."""


@dataclass(frozen=True, slots=True)
class FilterOptions:
    """What a filter lets through."""

    kind: FilterKind = option(
        "hyperfan",
        "line: one slope, rows and columns one after the other; plane: one slope; dual-fan: a range of slopes; "
        "hypercone: every slope, but no noise beside them; hyperfan: a range of slopes, but no noise beside them",
    )
    near: float = option(0.5, "largest slope of the range; for one slope, that slope", "px per view")
    far: float = option(-0.5, "smallest slope of the range", "px per view")
    bandwidth: float = option(0.04, "distance from it at which half the power is let through", "cycles per sample")
    rolloff: Literal["gaussian", "butterworth"] = option("gaussian", "how it falls beyond")
    order: int = option(3, "steepness of a Butterworth roll-off")
    swept: bool = option(False, "make the hyperfan of 5 planes, instead of the hypercone times the dual fan")
    margin_views: int = option(0, "empty views put beside the others, so that the two sides do not mix")
    margin_px: int = option(16, "empty px put beside each view, likewise")


def filter_light_field(
    light_field: LightField, options: FilterOptions = FilterOptions(), progress: Progress = silent
) -> LightField:
    """Return the light field with only what a filter lets through; its centre view is a picture with that focus.

    Parameters
    ----------
    light_field
        Views ``(T, S, V, U, 3)``.
    options
        What is let through.
    progress
        Told the colours done.

    Returns
    -------
    A light field whose weight is what the filter left of the weights.

    Raises
    ------
    ConfigError
        If an option is not possible.

    References
    ----------
    Dansereau, Pizarro, Williams, "Linear volumetric focus for light field cameras" (2015), sections 4 and 5.
    """
    weight = None if light_field.weight is None else light_field.weight.astype(np.float32) / np.float32(255)
    views, left = filter_views(light_field.views, weight, options, progress)
    return replace(light_field, views=views, weight=np.rint(255 * left).astype(np.uint8))


def filter_views(
    views: Views, weight: Float32 | None, options: FilterOptions = FilterOptions(), progress: Progress = silent
) -> tuple[Views, Float32]:
    """Filter views ``(T, S, V, U, 3)`` of weight ``(T, S, V, U)`` 0 to 1; return views and what is left of the weight.

    Colours times weight and the weight are filtered alike and divided; where next to no weight is left both are 0.
    Light cannot become negative, nor brighter than white or than the brightest sample.

    Raises
    ------
    ConfigError
        If an option is not possible.

    References
    ----------
    Dansereau, "Light Field Toolbox for MATLAB" v0.5.3 (2020), LFFilt4DFFT and LFFilt2DFFT.
    """
    _check(options)
    count_t, count_s, rows, columns = views.shape[:4]
    margins = (options.margin_views, options.margin_views, options.margin_px, options.margin_px)
    t, s, v, u = (n + m for n, m in zip((count_t, count_s, rows, columns), margins, strict=True))
    share = np.ones(views.shape[:4], np.float32) if weight is None else weight
    brightest = max(1.0, float(views.max(initial=0)))
    stages: list[tuple[tuple[int, int, int, int], tuple[int, ...]]] = [((t, s, v, u), (0, 1, 2, 3))]
    if options.kind == "line":
        stages = [((t, 1, v, 1), (0, 2)), ((1, s, 1, u), (1, 3))]
    for n, (size, axes) in enumerate(stages):
        response = frequency_response(size, options)
        lengths = [size[axis] for axis in axes]
        left = _filtered(share, response, lengths, axes)
        enough = left > _LEAST_WEIGHT
        divisor = np.where(enough, left, np.float32(np.inf))
        result = np.empty(views.shape, np.float32)
        for c in range(3):
            result[..., c] = _filtered(views[..., c] * share, response, lengths, axes) / divisor
            progress(3 * n + c + 1, 3 * len(stages))
        views, share = np.clip(result, 0, brightest, out=result), np.clip(np.where(enough, left, 0), 0, 1)
    return views, share


def frequency_response(size: tuple[int, int, int, int], options: FilterOptions) -> Float32:
    """Return how much of each frequency a filter lets through, 0 to 1.

    Parameters
    ----------
    size
        Samples along t, s, v and u.
    options
        The filter.

    Returns
    -------
    ``(T, S, V, U // 2 + 1)``, zero frequency first; as the response is the same at opposite frequencies, the other
    half along the last axis is not kept. A last axis of one sample gives way to v.

    References
    ----------
    Dansereau, "Light Field Toolbox for MATLAB" v0.5.3 (2020), LFBuild4DFreqPlane, -DualFan, -Hypercone, -Hyperfan.
    """
    if options.kind in ("line", "plane"):
        return _falling(_squared(size, partial(_from_plane, slope=options.near)), options)
    if options.kind == "hypercone":
        return _falling(_squared(size, _from_hypercone), options)
    if options.kind == "hyperfan" and options.swept:
        slopes = np.linspace(options.near, options.far, _SWEPT_PLANES)
        nearest = np.minimum.reduce([_squared(size, partial(_from_plane, slope=float(slope))) for slope in slopes])
        return _falling(nearest, options)
    fans = [_squared(size, partial(_from_fan, pair=pair, near=options.near, far=options.far)) for pair in (0, 1)]
    both = _falling(fans[0], options) * _falling(fans[1], options)
    return both if options.kind == "dual-fan" else both * _falling(_squared(size, _from_hypercone), options)


def _squared(size: tuple[int, int, int, int], distance: Callable[[Axes], Float32]) -> Float32:
    """Return the squared distance of each frequency; the highest of an even count stands for both of its signs."""
    half = 3 if size[3] > 1 else 2
    lines = [scipy.fft.rfftfreq(n) if axis == half else scipy.fft.fftfreq(n) for axis, n in enumerate(size)]
    squared = distance(_spread(lines))
    even = [axis for axis, n in enumerate(size) if n % 2 == 0 and squared.shape[axis] > 1]
    for among in (chosen for k in range(1, len(even) + 1) for chosen in combinations(even, k)):
        here = tuple(slice(size[a] // 2, size[a] // 2 + 1) if a in among else slice(None) for a in range(4))
        turned = [-line[here[axis]] if axis in among else line for axis, line in enumerate(lines)]
        squared[here] = np.minimum(squared[here], distance(_spread(turned)))
    return squared


def _spread(lines: list[np.ndarray[tuple[int, ...], np.dtype[np.float64]]]) -> Axes:
    t, s, v, u = (
        line.astype(np.float32).reshape([-1 if a == axis else 1 for a in range(4)]) for axis, line in enumerate(lines)
    )
    return t, s, v, u


def _from_plane(axes: Axes, slope: float) -> Float32:
    """Squared distance along the view frequencies from the plane of one slope."""
    t, s, v, u = axes
    squared: Float32 = (t - np.float32(slope) * v) ** 2 + (s - np.float32(slope) * u) ** 2
    return squared


def _from_fan(axes: Axes, pair: int, near: float, far: float) -> Float32:
    """Squared distance along the view frequency from the fan between two slopes, of t and v (0) or s and u (1)."""
    view, picture = axes[pair], axes[pair + 2]
    towards = np.where(picture >= 0, view, -view)
    above = towards - np.float32(near) * np.abs(picture)
    below = np.float32(far) * np.abs(picture) - towards
    squared: Float32 = np.maximum(np.maximum(above, below), 0) ** 2
    return squared


def _from_hypercone(axes: Axes) -> Float32:
    """Squared distance from ``t u = s v``, where the spectra of all slopes lie."""
    t, s, v, u = axes
    one: Float32 = np.hypot(t + u, s - v)
    other: Float32 = np.hypot(s + v, t - u)
    squared: Float32 = (one - other) ** 2 / np.float32(4)
    return squared


def _falling(squared: Float32, options: FilterOptions) -> Float32:
    """Return the response at a squared distance: half the power at the bandwidth."""
    if options.rolloff == "gaussian":
        gauss: Float32 = np.exp(squared * np.float32(-0.5 * np.log(2) / options.bandwidth**2))
        return gauss
    ratio = squared * np.float32(1 / options.bandwidth**2)
    butterworth: Float32 = (1 / np.sqrt(1 + ratio**options.order)).astype(np.float32)
    return butterworth


def _filtered(samples: Float32, response: Float32, lengths: list[int], axes: tuple[int, ...]) -> Float32:
    spectrum = scipy.fft.rfftn(samples, lengths, axes, workers=-1)
    spectrum *= response
    kept = tuple(slice(n) for n in samples.shape)
    back: Float32 = scipy.fft.irfftn(spectrum, lengths, axes, overwrite_x=True, workers=-1)[kept]
    return back


def _check(options: FilterOptions) -> None:
    ranged = options.kind in ("dual-fan", "hyperfan")
    if not (np.isfinite(options.near) and np.isfinite(options.far)) or (ranged and options.near < options.far):
        raise ConfigError(
            f"slopes from {options.near} to {options.far}: expected numbers that fall from near to far; swap them"
        )
    if not (np.isfinite(options.bandwidth) and options.bandwidth > 0):
        raise ConfigError(f"bandwidth = {options.bandwidth}: expected cycles per sample above 0")
    for name in ("order", "margin_views", "margin_px"):
        least = 1 if name == "order" else 0
        if getattr(options, name) < least:
            raise ConfigError(f"{name} = {getattr(options, name)}: expected {least} or more")
