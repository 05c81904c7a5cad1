"""What the views of a light field show at each pixel of a plane of focus: mean, median, extremes, deviation.

These need every view's value at once, and a tilted plane moves each pixel by its own amount, so each pixel asks all
views in turn; :mod:`lfstereo.focus.shift_kernels` is faster where a mean over whole translations is wanted.
"""

from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np

from lfstereo.arrays import Bool, Float32, Float64, UInt8
from lfstereo.errors import ConfigError
from lfstereo.focus.aperture import Reduction, RefocusOptions
from lfstereo.focus.shift_kernels import TAPS, compiled, tap_gains
from lfstereo.focus.spectral_shift import shift_by_spectrum
from lfstereo.lightfield.field import LightField
from lfstereo.progress import Progress, silent

_ROWS_PER_REPORT = 64
_REDUCTIONS: tuple[Reduction, ...] = ("mean", "median", "max", "min", "deviation")
_LEAST_SHARE = {"linear": 1e-4, "cubic": 0.1}
"""Weight of an interpolated sample below which it does not count: the quotient by it would be of no worth."""


def reduce_views(
    light_field: LightField,
    slopes_px: Float64,
    aperture: Float32,
    options: RefocusOptions = RefocusOptions(),
    progress: Progress = silent,
) -> Float32:
    """Return one picture per slope of what the views' values have in common, ``(K, V, U, 3)``.

    The values of a pixel are those of all views there, each interpolated from samples by their weight; their own
    weight, times that of the view in the aperture, counts in the mean, the median and the standard deviation. A
    pixel that no weight reaches shows the centre view, and no deviation.

    Parameters
    ----------
    light_field
        Views ``(T, S, V, U, 3)``.
    slopes_px
        ``(K,)`` px per view at the middle of the picture.
    aperture
        ``(T, S)`` how much each view counts.
    options
        The reduction, the interpolation and the tilt.
    progress
        Told the image rows done.

    Raises
    ------
    ConfigError
        If a tilt is asked for with shifts by the spectrum, which move a view as a whole.
    """
    if options.interpolation == "fourier" and any(options.tilt):
        raise ConfigError(
            f"tilt = {options.tilt}: found interpolation 'fourier', which shifts whole views; expected linear or cubic"
        )
    rows, columns = light_field.views.shape[2:4]
    slices = np.empty((len(slopes_px), rows, columns, 3), np.float32)
    for k, slope in enumerate(slopes_px):
        field, at, kind = light_field, float(slope), options.interpolation
        if kind == "fourier":
            field, at, kind = shift_by_spectrum(light_field, at), 0.0, "linear"
        for first in range(0, rows, _ROWS_PER_REPORT):
            part = slices[k, first : first + _ROWS_PER_REPORT]
            _reduce_part(field, at, aperture, replace(options, interpolation=kind), first, part)
            progress(k * rows + first + len(part), len(slopes_px) * rows)
    return slices


def _reduce_part(
    field: LightField, slope: float, aperture: Float32, options: RefocusOptions, first: int, part: Float32
) -> None:
    rows, columns = field.views.shape[2:4]
    views = np.ascontiguousarray(field.views)
    weight = np.empty((0, 0, 0, 0), np.uint8) if field.weight is None else np.ascontiguousarray(field.weight)
    plane = np.array([slope, options.tilt[0] / max(columns - 1, 1), options.tilt[1] / max(rows - 1, 1)])
    cubic, kind = options.interpolation == "cubic", _REDUCTIONS.index(options.reduction)
    least = _LEAST_SHARE[options.interpolation]
    reached = np.empty(part.shape[:2], np.bool_)
    _reduce_rows(views, weight, aperture, plane, field.centre, cubic, kind, least, first, part, reached)
    if not reached.all():
        missing = np.zeros_like(part) if options.reduction == "deviation" else field.views[field.centre][first:]
        part[~reached] = missing[: len(part)][~reached]


@compiled()
def _sample(view: Float32, weight: UInt8, y: float, x: float, cubic: bool, gains: Float32, value: Float32) -> float:
    """Fill ``value (3,)`` with the weighted sum of the samples around ``(x, y)`` and return the sum of weights."""
    top = -tap_gains(-y, cubic, gains[0]) - TAPS + 1
    left = -tap_gains(-x, cubic, gains[1]) - TAPS + 1
    value[:] = 0
    total = np.float32(0.0)
    for j in range(TAPS):
        v = top + j
        down = gains[0, TAPS - 1 - j]
        if down == 0 or v < 0 or v >= view.shape[0]:
            continue
        for i in range(TAPS):
            u = left + i
            gain = down * gains[1, TAPS - 1 - i]
            if gain == 0 or u < 0 or u >= view.shape[1]:
                continue
            if weight.shape[0] > 0:
                if weight[v, u] == 0:
                    continue
                gain *= np.float32(weight[v, u]) * np.float32(1.0 / 255.0)
            total += gain
            for c in range(3):
                value[c] += gain * view[v, u, c]
    return float(total)


@compiled()
def _weighted_median(values: Float32, shares: Float32) -> float:
    """Return the value with half the weight on either side; the middle of two where they part it evenly."""
    order = np.argsort(values)
    half = np.float64(0.0)
    for share in shares:
        half += share
    half *= 0.5
    below = np.float64(0.0)
    for n in range(order.shape[0]):
        below += shares[order[n]]
        if below >= half * (1 - 1e-6):
            if below <= half * (1 + 1e-6) and n + 1 < order.shape[0]:
                return float(0.5 * (values[order[n]] + values[order[n + 1]]))
            return float(values[order[n]])
    return float(values[order[-1]])


@compiled()
def _reduced(values: Float32, shares: Float32, kind: int) -> float:
    if kind == 1:
        return _weighted_median(values, shares)
    if kind == 2:
        return float(values.max())
    if kind == 3:
        return float(values.min())
    total, mean = np.float32(0.0), np.float32(0.0)
    for n in range(values.shape[0]):
        total += shares[n]
        mean += shares[n] * values[n]
    mean /= total
    if kind == 0:
        return float(mean)
    spread = np.float32(0.0)
    for n in range(values.shape[0]):
        spread += shares[n] * (values[n] - mean) ** 2
    return float(np.sqrt(spread / total))


@compiled(parallel=True)
def _reduce_rows(
    views: Float32,
    weight: UInt8,
    aperture: Float32,
    plane: Float64,
    centre: tuple[int, int],
    cubic: bool,
    kind: int,
    least: float,
    first_row: int,
    picture: Float32,
    reached: Bool,
) -> None:
    """Fill ``picture (R, U, 3)`` with the reduction of the views' values, rows from ``first_row`` on.

    ``plane`` is the slope at the picture's middle and what it gains per px to the right and downwards.
    """
    count_t, count_s, rows, columns = views.shape[:4]
    for r in numba.prange(picture.shape[0]):
        y = first_row + r
        values = np.empty((3, count_t * count_s), np.float32)
        shares = np.empty(count_t * count_s, np.float32)
        gains = np.empty((2, TAPS), np.float32)
        value = np.empty(3, np.float32)
        for x in range(columns):
            slope = plane[0] + plane[1] * (x - 0.5 * (columns - 1)) + plane[2] * (y - 0.5 * (rows - 1))
            count = 0
            for t in range(count_t):
                for s in range(count_s):
                    if aperture[t, s] <= 0:
                        continue
                    of_view = weight[t, s] if weight.shape[0] > 0 else weight[:, :, 0, 0]
                    at_y, at_x = y - slope * (t - centre[0]), x - slope * (s - centre[1])
                    share = _sample(views[t, s], of_view, at_y, at_x, cubic, gains, value)
                    if share > least:
                        for c in range(3):
                            values[c, count] = value[c] / share
                        shares[count] = share * aperture[t, s]
                        count += 1
            reached[r, x] = count > 0
            for c in range(3):
                if count > 0:
                    picture[r, x, c] = _reduced(values[c, :count], shares[:count], kind)
